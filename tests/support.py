"""Small services and helpers that the tests of the runtime share."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec

from runtime import topics
from runtime.guard import Guard
from runtime.messages import CancelRequest, ObjectState, Odometry, PushTarget, RobotPose, VelocityCommand
from runtime.node import Node
from runtime.sample import Sample
from runtime.scheduler import Scheduler, Timing
from runtime.service import Effects, Input, Output, RequestInput, Service, Timer, on
from runtime.time import Time

ROOT = Path(__file__).parent.parent
PACKAGES = ("runtime", "services", "drivers", "replays", "experiments")


class Nothing(msgspec.Struct, frozen=True):
    """A configuration without keys."""


class Pace(msgspec.Struct, frozen=True):
    """How often a source speaks."""

    period: float = 0.1  # s


@dataclass
class Count:
    """A state that counts."""

    n: int = 0


@dataclass
class Heard:
    """A state that remembers what came when."""

    events: list[tuple[Time, str, int]] = field(default_factory=list)


class OdometrySource(Service):
    """Publishes an odometry every period, counting in `driver_sequence`."""

    name = "odometry-source"
    Config = Pace
    odometry = Output(topics.ODOMETRY)
    tick = Timer(lambda config: config.period)
    state: Count

    def __init__(self, config: Pace) -> None:
        super().__init__(config)
        self.state = Count()

    @on(tick)
    def speak(self, now: Time) -> Effects:
        self.state.n += 1
        yield self.odometry(Odometry(stamp=now, driver_sequence=self.state.n))


class CommandSource(Service):
    """Publishes a command every period: a topic of which only the latest counts."""

    name = "command-source"
    Config = Pace
    command = Output(topics.COMMAND)
    tick = Timer(lambda config: config.period)
    state: Count

    def __init__(self, config: Pace) -> None:
        super().__init__(config)
        self.state = Count()

    @on(tick)
    def speak(self, now: Time) -> Effects:
        self.state.n += 1
        yield self.command(VelocityCommand(stamp=now, driver_sequence=self.state.n))


class Listener(Service):
    """Remembers everything it hears, and says nothing. Its beat is its own timer."""

    name = "listener"
    Config = Pace
    odometry = Input(topics.ODOMETRY)
    command = Input(topics.COMMAND)
    beat = Timer(lambda config: config.period)
    cancel = RequestInput("push/cancel", CancelRequest)
    state: Heard

    def __init__(self, config: Pace, name: str = "listener") -> None:
        super().__init__(config)
        self.name = name  # type: ignore[misc]
        self.state = Heard()

    @on(odometry)
    def hear_odometry(self, odometry: Odometry, now: Time) -> None:
        self.state.events.append((now, "odometry", odometry.driver_sequence))

    @on(command)
    def hear_command(self, command: VelocityCommand, now: Time) -> None:
        self.state.events.append((now, "command", command.driver_sequence))

    @on(beat)
    def keep_time(self, now: Time) -> None:
        self.state.events.append((now, "beat", 0))

    @on(cancel)
    def answer(self, cancel: CancelRequest, now: Time) -> Effects:
        self.state.events.append((now, "cancel", 0))
        yield self.cancel.accept()

    def heard(self, what: str) -> list[tuple[Time, int]]:
        """Return (time, number) of each event of the kind `what`."""
        return [(time, number) for time, kind, number in self.state.events if kind == what]


class Relay(Service):
    """Answers every odometry with a robot pose at once."""

    name = "relay"
    Config = Nothing
    odometry = Input(topics.ODOMETRY)
    pose = Output(topics.ROBOT_POSE)
    state: Count

    def __init__(self, config: Nothing) -> None:
        super().__init__(config)
        self.state = Count()

    @on(odometry)
    def relay(self, odometry: Odometry, now: Time) -> Effects:
        self.state.n += 1
        yield self.pose(RobotPose(stamp=now, driver_sequence=odometry.driver_sequence))


class Silent(Service):
    """Has inputs, outputs and a name, and does nothing: a part for systems that must not be built."""

    name = "silent"
    Config = Nothing
    object_state = Input(topics.OBJECT_STATE)
    target = Output(topics.PUSH_TARGET)

    def __init__(self, config: Nothing) -> None:
        super().__init__(config)
        self.state = Count()

    @on(object_state)
    def hear(self, object_state: ObjectState, now: Time) -> Iterator[Any]:
        yield self.target(PushTarget(stamp=now))


@dataclass
class Tape:
    """A sink that keeps what it is given."""

    samples: list[Sample] = field(default_factory=list)

    def __call__(self, sample: Sample) -> None:
        self.samples.append(sample)

    def of(self, topic: str) -> list[Sample]:
        """Return the samples of one topic."""
        return [sample for sample in self.samples if sample.topic == topic]


def schedule(services: Sequence[Service], timing: Timing | None = None, start: Time = 0) -> tuple[Scheduler, Tape]:
    """Return an unguarded scheduler of `services`, and the tape of what it sends."""
    tape = Tape()
    return Scheduler([Node(service, None) for service in services], tape, timing, start), tape


def run(services: Sequence[Service], until: Time, timing: Timing | None = None) -> Tape:
    """Run `services` under guard to the end of `until`, flushed; return what was sent."""
    tape = Tape()
    with Guard() as guard:
        scheduler = Scheduler([Node(service, guard) for service in services], tape, timing)
        scheduler.run(until)
        scheduler.finish()
    return tape


def sources(*packages: str) -> Iterator[tuple[Path, ast.Module]]:
    """Return every Python file of `packages`, parsed; generated ones are left out."""
    for package in packages:
        for path in sorted((ROOT / package).rglob("*.py")):
            if not path.name.endswith("_pb2.py"):
                yield path, ast.parse(path.read_text(encoding="utf-8"))


def imported(tree: ast.Module) -> Iterator[tuple[str, int]]:
    """Return (dotted name, line) of everything that a module imports, anywhere in it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            yield node.module, node.lineno
            yield from ((f"{node.module}.{alias.name}", node.lineno) for alias in node.names)
