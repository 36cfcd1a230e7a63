"""Runs a push while showing it: a live line on a terminal, plain lines elsewhere, and a summary at the end."""

from __future__ import annotations

import json
import math
import signal
import threading
import time
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.live import Live
from rich.table import Table

from experiments.session import Session, run
from runtime.errors import PushlaneError
from runtime.local import Interrupted, PushResult
from runtime.messages import FailureCause, PushOutcome, PushPhase, PushStatus
from runtime.recorder.writer import CannotRecord
from runtime.time import Time, seconds

if TYPE_CHECKING:
    from runtime.lockstep.run import Spread

_LINE_EVERY: Time = 5_000_000_000
_MOVED = 0.05
"""m that the robot has gone when a push has begun: one that fails for want of a way after that is kept"""


class NoPath(PushlaneError):
    """There is no way to the goal; nothing was pushed and nothing is kept."""


def run_shown(
    session: Session,
    record: Path | None,
    terminal: bool,
    quiet: bool,
    lockstep: bool = False,
    overwrite: bool = False,
) -> tuple[PushResult, float]:
    """Run `session`, showing it. Returns the result and the s it took.

    Raises:
        NoPath: the goal cannot be reached; `record` is not left behind.
    """
    started = time.perf_counter()
    console = Console()
    with Live(console=console, refresh_per_second=8) if terminal and not quiet else nullcontext() as live:
        show = _live(live, started) if live is not None else (None if quiet else _lines(started))
        watch = _interruptible(show)
        try:
            result = run(session, record, watch, lockstep=_spread() if lockstep else None, overwrite=overwrite)
        except (CannotRecord, Interrupted):
            raise  # what is there is not ours, or is worth keeping
        except PushlaneError:
            _discard(record)
            raise
    if result.status.cause == FailureCause.NO_PATH and result.status.robot_path_length < _MOVED:
        _discard(record)
        raise NoPath(result.status.reason)
    return result, time.perf_counter() - started


def show(
    session: Session,
    record: Path | None,
    as_json: bool,
    terminal: bool,
    lockstep: bool = False,
    overwrite: bool = False,
) -> bool:
    """Run `session` and print what came of it. Returns whether the object was delivered."""
    result, took = run_shown(session, record, terminal, quiet=as_json, lockstep=lockstep, overwrite=overwrite)
    facts = summary(session, result, took, record)
    if as_json:
        print(json.dumps(facts))
    else:
        print(_sentence(facts))
    return result.status.outcome == PushOutcome.DELIVERED


def summary(session: Session, result: PushResult, took: float, record: Path | None) -> dict[str, object]:
    """Return the figures of a push by name, in m and s."""
    status = result.status
    return {
        "outcome": PushOutcome.Name(status.outcome).lower(),
        "cause": FailureCause.Name(status.cause).lower(),
        "reason": status.reason,
        "scene": session.sim.scene,
        "object": session.world.body.name,
        "strategy": session.method[0],
        "controller": session.method[1],
        "seed": session.sim.seed,
        "distance_left": round(status.distance_left, 4),
        **({"yaw_left": round(status.yaw_left, 4)} if status.HasField("yaw_left") else {}),
        "elapsed": round(status.elapsed, 3),
        "robot_path_length": round(status.robot_path_length, 3),
        "object_path_length": round(status.object_path_length, 3),
        "simulated": round(seconds(result.end), 3),
        "took": round(took, 3),
        "times_real_time": round(seconds(result.end) / took, 1),
        "messages": sum(result.counts.values()),
        "file": str(record) if record else "",
    }


def _sentence(facts: dict[str, object]) -> str:
    reason = f" ({facts['reason']})" if facts["reason"] else ""
    kept = f"; recorded to {facts['file']}" if facts["file"] else ""
    turned = f" and {math.degrees(float(str(facts['yaw_left']))):.0f} degrees" if "yaw_left" in facts else ""
    return (
        f"{str(facts['outcome']).upper()}{reason}: {facts['object']} in {facts['scene']}, {facts['strategy']}, "
        f"{facts['controller']}, seed {facts['seed']}: {facts['distance_left']:.3f} m{turned} left after "
        f"{facts['elapsed']:.1f} s, robot path {facts['robot_path_length']:.2f} m, "
        f"object path {facts['object_path_length']:.2f} m; "
        f"{facts['times_real_time']} times real time, {facts['messages']} messages{kept}"
    )


def _interruptible(show: Callable[[Time, PushStatus], None] | None) -> Callable[[Time, PushStatus], None]:
    """Return `show`, which ends the run between two events once Ctrl-C or SIGTERM has come."""
    asked = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: asked.set())

    def watch(now: Time, status: PushStatus) -> None:
        if asked.is_set():
            raise Interrupted(f"interrupted at {seconds(now):.1f} simulated s; what was recorded is whole")
        if show is not None:
            show(now, status)

    return watch


def _live(live: Live, started: float) -> Callable[[Time, PushStatus], None]:
    def watch(now: Time, status: PushStatus) -> None:
        table = Table.grid(padding=(0, 2))
        table.add_row(
            f"[bold]{_phase(status)}[/bold]",
            f"{status.distance_left:.2f} m left",
            f"{seconds(now):.1f} s simulated",
            f"{_ratio(now, started):.1f} times real time",
            f"robot {status.robot_path_length:.2f} m, object {status.object_path_length:.2f} m",
        )
        live.update(table)

    return watch


def _lines(started: float) -> Callable[[Time, PushStatus], None]:
    shown = [-_LINE_EVERY, PushPhase.PHASE_UNSPECIFIED]

    def watch(now: Time, status: PushStatus) -> None:
        # How it ended is said by the summary, or by the error.
        if status.phase == PushPhase.ENDED or (now - shown[0] < _LINE_EVERY and status.phase == shown[1]):
            return
        shown[:] = [now, status.phase]
        print(
            f"{seconds(now):7.1f} s  {_phase(status):<8}  {status.distance_left:5.2f} m left  "
            f"{_ratio(now, started):5.1f} times real time",
            flush=True,
        )

    return watch


def _phase(status: PushStatus) -> str:
    return PushPhase.Name(status.phase).lower()


def _ratio(now: Time, started: float) -> float:
    return seconds(now) / max(time.perf_counter() - started, 1e-9)


def _spread() -> Spread:
    from runtime.lockstep.run import on_this_machine

    return on_this_machine()


def _discard(record: Path | None) -> None:
    if record is not None:
        record.unlink(missing_ok=True)
