"""The live table that `pushlane run` shows on a terminal: each service, and how the push goes."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass

import zenoh
from google.protobuf.message import DecodeError
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from runtime import topics
from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import NoBus, client
from runtime.live.launcher import Launcher
from runtime.messages import FailureCause, Health, PushOutcome, PushPhase, PushStatus

_REFRESH = 4
_OLD = 3.0
_BAR = 30


@dataclass(frozen=True)
class Line:
    """One service of this machine.

    Attributes:
        pid: of its process, None while it has none.
        restarts: how often it was started again.
        health: what it reported last, None before the first report.
        age: s since that came.
    """

    name: str
    pid: int | None
    restarts: int
    health: Health | None = None
    age: float = 0.0


def render(lines: list[Line], status: PushStatus | None, start: float = 0.0) -> RenderableType:
    """Return the table.

    Args:
        status: of the push, None before the first.
        start: m that were left when the push began.
    """
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("service")
    table.add_column("state")
    for name in ("restarts", "events/s", "handler ms", "longest ms", "queue", "dropped", "lost"):
        table.add_column(name, justify="right")
    for line in lines:
        table.add_row(line.name, _state(line), str(line.restarts), *_numbers(line.health))
    return Group(table, push_line(status, start))


def _state(line: Line) -> Text:
    if line.pid is None:
        return Text("restarting", "red")
    if line.health is None:
        # The recorder has no handlers, and reports none.
        return Text("up", "green") if line.name == "recorder" else Text("starting", "yellow")
    return Text("up", "green") if line.age < _OLD else Text(f"silent for {line.age:.0f} s", "red")


def _numbers(health: Health | None) -> list[str]:
    if health is None:
        return [""] * 6
    dropped = sum(row.dropped for row in health.inputs)
    lost = sum(row.lost + row.refused for row in health.inputs)
    busy = [f"{1000 * seconds:.1f}" for seconds in (health.busy_mean, health.busy_max)]
    return [str(health.handled), *busy, str(health.queue_length), str(dropped), str(lost)]


def push_line(status: PushStatus | None, start: float) -> RenderableType:
    """Return the state of the push, with a bar of how much of the `start` m is done."""
    if status is None or status.phase == PushPhase.IDLE:
        return Text("no push; pushlane push --to X Y asks for one", "dim")
    turned = f" and {math.degrees(status.yaw_left):.0f} degrees" if status.HasField("yaw_left") else ""
    left = f"{status.distance_left:.2f} m{turned} left, {status.elapsed:.1f} s"
    if status.phase == PushPhase.ENDED:
        outcome = PushOutcome.Name(status.outcome).lower()
        cause = f", {FailureCause.Name(status.cause).lower().replace('_', ' ')}" if status.cause else ""
        return Text(f"push {outcome}{cause}: {left}", "green" if status.outcome == PushOutcome.DELIVERED else "red")
    row = Table.grid(padding=(0, 1))
    done = max(start - status.distance_left, 0.0)
    row.add_row(f"push {PushPhase.Name(status.phase).lower()}", ProgressBar(max(start, 1e-3), done, width=_BAR), left)
    return row


class Watch:
    """What a running system reports, kept for the table."""

    def __init__(self, keys: Keys) -> None:
        self._keys = keys
        self._health: dict[str, tuple[Health, float]] = {}
        self.status: PushStatus | None = None
        self.start = 0.0

    def hear(self, sample: zenoh.Sample) -> None:
        """Take what came."""
        self.take(self._keys.name(str(sample.key_expr)), bytes(sample.payload), time.monotonic())

    def take(self, topic: str, payload: bytes, now: float) -> None:
        """Take a message; others than health and status are left out, and what does not parse."""
        with suppress(DecodeError):
            if topic == topics.PUSH_STATUS.name:
                status = PushStatus.FromString(payload)
                began = self.status is None or status.elapsed < self.status.elapsed
                self.start = status.distance_left if began else max(self.start, status.distance_left)
                self.status = status
            elif topic.startswith("health/"):
                self._health[topic.removeprefix("health/")] = (Health.FromString(payload), now)

    def lines(self, pids: Mapping[str, int], restarts: Mapping[str, int], now: float) -> list[Line]:
        """Return a line for each service of this machine."""
        found = []
        for name, count in restarts.items():
            health, heard = self._health.get(name, (None, now))
            found.append(Line(name, pids.get(name), count, health, now - heard))
        return found


@contextmanager
def shown(launcher: Launcher, bus: BusConfig, console: Console) -> Iterator[None]:
    """Show the table of `launcher` on `console` while the block runs. What is printed there appears above it."""
    ended = threading.Event()
    worker = threading.Thread(target=_show, args=(launcher, bus, console, ended), name="table", daemon=True)
    worker.start()
    try:
        yield
    finally:
        ended.set()
        worker.join(3.0)


def _show(launcher: Launcher, bus: BusConfig, console: Console, ended: threading.Event) -> None:
    keys = Keys(bus.robot)
    watch = Watch(keys)
    try:
        # Slow to show rather than slow to run: the table is a client like any other, and its callback only stores.
        with client(bus) as session, Live(console=console, refresh_per_second=_REFRESH) as live:
            declared = [
                session.declare_subscriber(keys.topic(name), watch.hear) for name in ("health/*", "push/status")
            ]
            while not ended.wait(1.0 / _REFRESH):
                lines = watch.lines(launcher.pids, launcher.restarts, time.monotonic())
                live.update(render(lines, watch.status, watch.start))
            for one in declared:
                one.undeclare()
    except NoBus as error:
        console.print(f"no table: {error}")
