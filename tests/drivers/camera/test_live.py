"""A feeder, the camera service on its live host, and a recording: over Zenoh, in one process."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import msgspec
import pytest
import zenoh

from drivers.camera.feed import feed
from drivers.camera.service import CameraService
from drivers.camera.source import opened
from experiments.camera.bus import expected_size, give
from replays.recording import load
from replays.replay import replay
from runtime.bus import envelope
from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import client, hub
from runtime.live.config import LiveConfig
from runtime.live.host import LiveHost
from runtime.live.operate import NoAnswer
from runtime.messages import CompressedImage
from runtime.node import Node
from runtime.recorder import header
from runtime.recorder.writer import Recorder
from runtime.sample import Sample
from tests.drivers.camera.test_service import HEIGHT, WIDTH, config, picture
from tests.live_system import free_endpoint


def test_pictures_of_a_folder_are_fed_recorded_and_replayed(tmp_path: Path) -> None:
    folder = tmp_path / "pictures"
    folder.mkdir()
    sent = [picture(seed=number) for number in range(6)]
    for number, data in enumerate(sent):
        (folder / f"{number}.jpg").write_bytes(data)
    (folder / "3-small.jpg").write_bytes(picture(32, 24))
    endpoint = free_endpoint()
    bus = BusConfig(robot="fed", listen=(endpoint,), connect=(endpoint,))
    keys, heard, lines = Keys(bus.robot), list[Sample](), list[str]()

    def hear(sample: zenoh.Sample) -> None:
        heard.append(envelope.opened(keys.name(str(sample.key_expr)), sample))

    with hub(bus), client(bus) as listening, client(bus) as hosting, client(bus) as feeding:
        subscriber = listening.declare_subscriber(keys.everything(), hear)
        with pytest.raises(NoAnswer, match="no camera service"):
            expected_size(feeding, keys, 0.0)
        assert give(feeding, keys, CompressedImage()).startswith("no camera service answered")
        host = LiveHost(Node(CameraService(config()), None), hosting, keys, LiveConfig())
        thread = threading.Thread(target=host.run)
        thread.start()
        try:
            assert expected_size(feeding, keys, 10.0) == (WIDTH, HEIGHT)
            tally = feed(
                opened(str(folder), time.monotonic),
                lambda picture: give(feeding, keys, picture),
                20.0,
                time.monotonic,
                threading.Event().wait,
                lines.append,
            )
        finally:
            host.stop()
            thread.join(10.0)
        subscriber.undeclare()
    assert (tally.taken, tally.refused, tally.failed) == (6, 1, 0)
    assert lines == ["3-small.jpg: refused: a picture of 32 x 24 pixels, expected 64 x 48 as in calibration"]
    images = [CompressedImage.FromString(sample.payload) for sample in heard if sample.topic == "image"]
    assert [image.data for image in images] == sent
    path = tmp_path / "a.mcap"
    head = header.of_this_machine("live", 1, [CameraService.name])
    settings = msgspec.json.encode({"sections": {CameraService.name: msgspec.to_builtins(config())}})
    with Recorder(path, head, settings) as recorder:
        for sample in {(one.topic, one.sequence): one for one in heard}.values():  # latched values come again
            if not sample.topic.startswith("health/"):
                recorder(sample)
    report = replay(load(path), services=lambda _: CameraService)
    assert report.identical
