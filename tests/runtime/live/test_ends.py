"""A live system started from the command line: how it ends, and what a stuck listener does to it (nothing)."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import zenoh
from mcap.reader import make_reader

from replays import integrity, report
from replays.recording import load
from replays.replay import replay
from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import client
from runtime.messages import PushGoal, PushPhase, PushStatus, Reply, Vector2, VelocityCommand
from tests.figures import Figures
from tests.live_system import free_endpoint

LISTENER = """
import sys, time, zenoh
from runtime.bus.config import BusConfig
from runtime.bus.session import client
with client(BusConfig(connect=(sys.argv[1],))) as session:
    subscriber = session.declare_subscriber("pushlane/**", lambda sample: time.sleep(0.2))
    print("listening", flush=True)
    time.sleep(600)
"""


class Running:
    """`pushlane run` in a process of its own, pushing."""

    def __init__(self, session: zenoh.Session, keys: Keys, process: subprocess.Popen[str], endpoint: str) -> None:
        self.process = process
        self.endpoint = endpoint
        self.commands: list[float] = []  # when they came, monotonic s
        self.phase = PushPhase.IDLE
        self._subscribers = [
            session.declare_subscriber(keys.topic("command"), lambda _: self.commands.append(time.monotonic())),
            session.declare_subscriber(keys.topic("push/status"), self._hear),
        ]
        goal = PushGoal(position=Vector2(x=3.0, y=0.1)).SerializeToString()
        deadline = time.monotonic() + 60.0
        while not self._accepted(session, keys, goal):
            assert time.monotonic() < deadline, "no push/goal within 60 s"
            time.sleep(0.2)
        while self.phase != PushPhase.PUSHING:
            assert time.monotonic() < deadline, "no pushing within 60 s"
            time.sleep(0.05)

    def memory(self) -> dict[int, int]:
        """Return the resident memory of the launcher and its children, kB."""
        listed = subprocess.run(["ps", "-eo", "pid=,ppid=,rss="], check=True, capture_output=True, text=True).stdout
        rows = [tuple(map(int, line.split())) for line in listed.splitlines()]
        return {pid: size for pid, parent, size in rows if self.process.pid in (pid, parent)}

    def _hear(self, sample: zenoh.Sample) -> None:
        self.phase = PushStatus.FromString(bytes(sample.payload)).phase

    @staticmethod
    def _accepted(session: zenoh.Session, keys: Keys, goal: bytes) -> bool:
        answers = session.get(keys.request("push/goal"), payload=goal, timeout=2.0)
        return any(one.ok is not None and Reply.FromString(bytes(one.ok.payload)).accepted for one in answers)


@contextmanager
def pushing(robot: str, *more: str) -> Iterator[Running]:
    """Start `pushlane run` and a push, and end what is left of it."""
    endpoint = free_endpoint()
    settings = [f"bus.robot={robot}", f"bus.listen=['{endpoint}']", f"bus.connect=['{endpoint}']"]
    settings += ["sim.scene=open", "sim.object=cylinder", "sim.seed=2", "task.time_limit=300"]
    command = [sys.executable, "-m", "runtime.cli.main", "run", *more]
    command += [part for one in settings for part in ("--set", one)]
    bus = BusConfig(robot=robot, listen=(endpoint,), connect=(endpoint,))
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        with client(bus, patience=20.0) as session:
            yield Running(session, Keys(robot), process, endpoint)
    finally:
        process.terminate()
        process.communicate(timeout=30)


@pytest.mark.alone
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
def test_a_signal_ends_all_in_good_order(number: signal.Signals, tmp_path: Path, figures: Figures) -> None:
    path = tmp_path / "session.mcap"
    with pushing("ending", "-o", str(path)) as system:
        time.sleep(3.0)
        children = set(system.memory()) - {system.process.pid}
        began = time.monotonic()
        system.process.send_signal(number)
        code = system.process.wait(30)
        took = time.monotonic() - began
    recording = load(path)
    commands = sorted(
        (s for (topic, _), s in recording.samples.items() if topic == "command"), key=lambda s: s.sequence
    )
    before, last = (VelocityCommand.FromString(sample.payload).twist for sample in commands[-2:])
    figures(f"{number.name}: ended after {took:.2f} s; last commands {before.vx:.2f}, {last.vx:.2f} m/s")
    assert code == 0
    assert took < 5.0  # 2 s on a machine of one's own
    assert not [pid for pid in children if Path(f"/proc/{pid}").exists()]
    assert abs(before.vx) + abs(before.vy) > 0.01
    assert (last.vx, last.vy, last.omega) == (0.0, 0.0, 0.0)
    assert integrity.damage(path) is None
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None and summary.chunk_indexes
    found = replay(recording)
    assert found.identical, "\n".join(report.text(found))
    assert all(node.complete for node in found.nodes)


@pytest.mark.alone
def test_a_stuck_or_slow_listener_slows_nobody(figures: Figures) -> None:
    with pushing("listened") as system:
        time.sleep(2.0)
        listeners = [
            subprocess.Popen([sys.executable, "-c", LISTENER, system.endpoint], stdout=subprocess.PIPE, text=True)
            for _ in range(2)
        ]
        try:
            for listener in listeners:
                assert listener.stdout is not None
                assert listener.stdout.readline() == "listening\n"
            os.kill(listeners[0].pid, signal.SIGSTOP)
            before, first = system.memory(), len(system.commands)
            threading.Event().wait(12.0)
            after, heard = system.memory(), np.diff(system.commands[first:])
        finally:
            for listener in listeners:
                listener.kill()
                listener.communicate()
    error = np.percentile(1000 * np.abs(heard - 0.05), 99)
    grown = max(after[pid] - before[pid] for pid in before)
    figures(f"a stuck and a slow listener for 12 s: {len(heard)} commands, p99 of period error {error:.1f} ms,")
    figures(f"longest gap {1000 * heard.max():.0f} ms; memory of any process grew by at most {grown} kB")
    assert set(after) == set(before)  # nobody was restarted
    assert len(heard) > 0.95 * 20 * 12
    assert grown < 30_000


@pytest.mark.alone
def test_services_of_a_launcher_that_was_killed_end_themselves(figures: Figures) -> None:
    with pushing("orphaned") as system:
        children = set(system.memory()) - {system.process.pid}
        assert len(children) >= 7
        system.process.kill()
        began = time.monotonic()
        while any(Path(f"/proc/{pid}").exists() for pid in children):
            assert time.monotonic() - began < 15.0, "services go on without their launcher"
            time.sleep(0.05)
    figures(f"launcher killed: all services ended after {time.monotonic() - began:.1f} s")
