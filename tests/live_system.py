"""A live system with real processes, for tests: starts it, asks for a push, listens, ends it."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import zenoh
from google.protobuf.message import DecodeError

from experiments.session import Session, prepare
from experiments.systems import NODES
from runtime.bus import envelope
from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import client
from runtime.config.layers import Layer
from runtime.live.launcher import Launcher
from runtime.messages import PushGoal, PushPhase, PushStatus, Reply, Truth, VelocityCommand
from runtime.sample import Sample

START_LIMIT = 60.0


def free_endpoint() -> str:
    """Return a loopback endpoint that is free now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


@dataclass
class System:
    """A running system, as a test sees it."""

    launcher: Launcher
    bus: BusConfig
    keys: Keys
    session: zenoh.Session
    goal: PushGoal
    heard: dict[str, list[Sample]] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)

    def ask_for_push(self) -> Reply:
        """Ask for the session's goal."""
        for answer in self.session.get(
            self.keys.request("push/goal"), payload=self.goal.SerializeToString(), timeout=5.0
        ):
            assert answer.ok is not None
            return Reply.FromString(bytes(answer.ok.payload))
        raise AssertionError("nobody answered push/goal")

    def status(self) -> PushStatus:
        """Return the newest push status; what is none, as tests of garbage send it, is passed over."""
        for sample in reversed(self.heard.get("push/status", [])):
            with suppress(DecodeError):
                return PushStatus.FromString(sample.payload)
        return PushStatus()

    def truths(self) -> list[Truth]:
        """Return the truth so far."""
        return [Truth.FromString(sample.payload) for sample in self.heard.get("truth", [])]

    def commands(self) -> list[VelocityCommand]:
        """Return the commands so far."""
        return [VelocityCommand.FromString(sample.payload) for sample in self.heard.get("command", [])]

    def wait(self, until: Callable[[], bool], limit: float, what: str) -> None:
        """Wait until something holds; fail after `limit` s, naming it."""
        deadline = time.monotonic() + limit
        while not until():
            assert time.monotonic() < deadline, f"not within {limit} s: {what}; {self.status()}; {self.lines}"
            time.sleep(0.02)

    def wait_for_end(self, limit: float) -> PushStatus:
        """Wait until the push has ended."""
        self.wait(lambda: self.status().phase == PushPhase.ENDED, limit, "the end of the push")
        return self.status()


def short_session(robot: str, **sim: object) -> Session:
    """Return a session with a short push in the open."""
    endpoint = free_endpoint()
    values = {"scene": "open", "goal": [-0.2, 0.1], "object": "cylinder", "seed": 2, **sim}
    bus = {"robot": robot, "listen": [endpoint], "connect": [endpoint]}
    return prepare([Layer("test", {"sim": values, "bus": bus})])


@contextmanager
def running(session: Session, record: Path | None = None) -> Iterator[System]:
    """Run all services of `session` in their own processes, and end them."""
    bus = session.effective.sections["bus"]
    assert isinstance(bus, BusConfig)
    lines: list[str] = []
    launcher = Launcher(session.plan(), bus, NODES, record, say=lines.append)
    thread = threading.Thread(target=launcher.run)
    thread.start()
    try:
        with client(bus, patience=20.0) as zenoh_session:
            system = System(launcher, bus, Keys(bus.robot), zenoh_session, session.goal, lines=lines)

            def hear(sample: zenoh.Sample) -> None:
                topic = system.keys.name(str(sample.key_expr))
                with suppress(envelope.BadEnvelope):
                    system.heard.setdefault(topic, []).append(envelope.opened(topic, sample))

            subscriber = zenoh_session.declare_subscriber(system.keys.everything(), hear)
            system.wait(launcher.ready, START_LIMIT, "all services up")
            yield system
            subscriber.undeclare()
    finally:
        launcher.stop()
        thread.join(20.0)
    assert not thread.is_alive(), "the launcher did not end"
