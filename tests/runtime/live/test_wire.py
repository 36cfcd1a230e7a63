"""A live host that has a wire: what it brings is recorded under the service's own host, and replays."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path

import msgspec
import zenoh
from google.protobuf.message import Message

from drivers.robotino.serial.config import SerialConfig
from drivers.robotino.serial.service import RobotinoSerial
from experiments.session import prepare
from replays.recording import load
from replays.replay import replay
from runtime.bus import envelope
from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import client, hub
from runtime.config.layers import Layer
from runtime.live.config import LiveConfig
from runtime.live.graph import Graph
from runtime.live.host import LiveHost
from runtime.live.launcher import Launcher
from runtime.live.wire import Bring
from runtime.messages import SerialData
from runtime.node import Node
from runtime.recorder import header
from runtime.recorder.writer import Recorder
from runtime.sample import Sample
from runtime.time import Time
from tests.live_system import free_endpoint

ANSWER = bytes.fromhex("aa23000205332e302e300405312e322e334110cdccc0410000c03f0001000060ea00002701008ff8")
"""versions and power, of a bench board (reference 2.7)"""


class Far:
    """The far end of a wire: answers every frame, as long as it is open, from a thread of its own."""

    sends, brings = "serial/sent", "serial/received"

    def __init__(self) -> None:
        self.carried: list[bytes] = []
        self.closed = False
        self._bring: Bring | None = None
        self._now: Callable[[], Time] = int

    def open(self, bring: Bring, now: Callable[[], Time]) -> None:
        self._bring, self._now = bring, now

    def carry(self, message: Message) -> None:
        assert isinstance(message, SerialData) and self._bring is not None
        self.carried.append(message.data)
        answer = SerialData(stamp=self._now(), data=ANSWER, open=True)
        threading.Thread(target=self._bring, args=(answer,)).start()

    def close(self) -> None:
        self.closed = True


def test_what_a_wire_brings_is_published_recorded_and_replayed(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    bus = BusConfig(robot="wired", listen=(endpoint,), connect=(endpoint,))
    keys, heard, far = Keys(bus.robot), list[Sample](), Far()

    def hear(sample: zenoh.Sample) -> None:
        heard.append(envelope.opened(keys.name(str(sample.key_expr)), sample))

    with hub(bus), client(bus) as listening, client(bus) as hosting, client(bus) as stranger:
        subscriber = listening.declare_subscriber(keys.everything(), hear)
        node = Node(RobotinoSerial(SerialConfig()), None)
        host = LiveHost(node, hosting, keys, LiveConfig(), wire=far)
        thread = threading.Thread(target=host.run)
        thread.start()
        try:
            end = time.monotonic() + 20.0
            while len(far.carried) < 20 and time.monotonic() < end:
                # Who else says that the line said something is not heard: there is one publisher, and that is the host.
                lie = SerialData(data=b"lie", open=True).SerializeToString()
                stranger.put(keys.topic("serial/received"), lie, attachment=envelope.pack(1 << 20, 1))
                time.sleep(0.05)
        finally:
            host.stop()
            thread.join(10.0)
        subscriber.undeclare()
    assert far.closed and len(far.carried) >= 20
    sent = [SerialData.FromString(one.payload).data for one in heard if one.topic == "serial/sent"]
    assert sent == far.carried
    brought = [one for one in heard if one.topic == "serial/received" and one.sequence < 1 << 20]
    assert [one.sequence for one in brought] == list(range(1, len(brought) + 1))
    assert {SerialData.FromString(one.payload).data for one in brought} == {ANSWER}
    assert node.service.state.hardware == "3.0.0"  # type: ignore[attr-defined]
    path = tmp_path / "a.mcap"
    head = header.of_this_machine("live", 1, [RobotinoSerial.name])
    settings = msgspec.json.encode({"sections": {RobotinoSerial.name: msgspec.to_builtins(SerialConfig())}})
    with Recorder(path, head, settings) as recorder:
        for sample in {(one.topic, one.sequence): one for one in heard}.values():  # latched values come again
            if not sample.topic.startswith("health/") and sample.sequence != 1 << 20:
                recorder(sample)
    report = replay(load(path), services=lambda _: RobotinoSerial)
    assert report.identical
    assert report.nodes[0].topics["serial/sent"].recorded == len(sent)


def test_the_graph_names_the_host_of_a_wire_unless_a_double_is_in_the_system() -> None:
    alone = Graph.of(["robotino-serial"])
    assert "serial/received" in alone.outputs["robotino-serial"]
    both = Graph.of(["emulated-serial", "robotino-serial"])
    assert "serial/received" not in both.outputs["robotino-serial"]
    assert "serial/received" in both.outputs["emulated-serial"]


def test_what_a_service_warns_of_is_said_where_the_system_was_started() -> None:
    """Nobody is at the base's address: without a word the system would look healthy."""
    endpoint = free_endpoint()
    camera = {"calibration": {"width": 64, "height": 48, "focal": [50, 50], "centre": [32, 24]}}
    values = {
        "system": {"base": "robotino-rest"},
        "robotino-rest": {"url": "http://127.0.0.1:9"},
        "opencv-camera": {**camera, "mount": {"x": 0.1, "z": 1.0, "pitch": 0.9}},
        "tracker": {"diameter": 0.3},
        "bus": {"robot": "nobody", "listen": [endpoint], "connect": [endpoint]},
    }
    session, lines = prepare([Layer("test", values)]), list[str]()
    bus = session.effective.sections["bus"]
    assert isinstance(bus, BusConfig)
    launcher = Launcher(session.plan(), bus, ["robotino-rest"], say=lines.append)
    thread = threading.Thread(target=launcher.run)
    thread.start()
    try:
        end = time.monotonic() + 60.0
        while not any("refused: /data/o" in one for one in lines) and time.monotonic() < end:
            time.sleep(0.1)
    finally:
        launcher.stop()
        thread.join(20.0)
    assert any(one.startswith("robotino-rest: refused: /data/o") for one in lines), lines
