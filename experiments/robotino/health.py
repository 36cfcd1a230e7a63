"""Whether a base is fit for a push: what was read of it, as a table, and a small move there and back."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rich.console import Console
from rich.table import Table

from drivers.robotino.health import Row
from drivers.robotino.rest.config import RestConfig
from drivers.robotino.rest.service import RobotinoRest
from drivers.robotino.rest.wire import HttpWire
from drivers.robotino.serial.config import SerialConfig
from drivers.robotino.serial.service import RobotinoSerial
from drivers.robotino.serial.wire import SerialWire
from runtime import topics
from runtime.live.alone import Alone
from runtime.messages import Twist2, VelocityCommand
from runtime.time import nanoseconds

_COLOURS = {"ok": "green", "missing": "yellow", "bad": "red"}
_NEEDED = {
    True: ("odometry", "bumper", "distances", "power", "laser"),
    False: ("line", "motors", "bumper", "distances"),
}
"""What a push cannot do without, over REST and over the serial link. Camera and laser beside the latter are others'."""

_WAY, _SPEED = 0.05, 0.05
"""m, m/s"""
_UP = 3.0
"""s for the driver to hear the base"""
_LONGEST = 3.0
"""s of a move"""
_STOPPING = 1.0
_DEADLINE = 0.2
_LOOK = 0.5
"""s to look at a base before it is moved"""
_STILL, _CREPT, _ROOM = 0.02, 0.005, 0.15
"""m/s and m that a base at rest may seem to move in that time; m that are to be free around it"""
_OFF = 0.03
"""m that odometry may be off the way wanted: how far the base goes on while it brakes"""


def show(where: str, rows: Sequence[Row]) -> None:
    """Print the table."""
    table = Table(title=where, title_justify="left", show_edge=False)
    for name in ("", "state", "reading"):
        table.add_column(name)
    table.add_column("ms", justify="right")
    for row in rows:
        state = f"[{_COLOURS[row.state]}]{row.state}[/]"
        table.add_row(row.name, state, row.words.replace("[", r"\["), f"{row.milliseconds:.0f}")
    Console().print(table)


def lacks(rows: Sequence[Row], over_rest: bool) -> list[str]:
    """Return what lacks, or is wrong, of what a push cannot do without."""
    states = {row.name: row.state for row in rows}
    bad = [row.name for row in rows if row.state == "bad"]
    return list(dict.fromkeys([*(one for one in _NEEDED[over_rest] if states.get(one) != "ok"), *bad]))


def wiggle(where: str, over_rest: bool, say: Callable[[str], None]) -> bool:
    """Move the base 5 cm forward and back. Returns whether its odometry says that it went, and came back."""
    base = (
        Alone(RobotinoRest(RestConfig(url=where, scan_rate=0.0)), HttpWire(where))
        if over_rest
        else Alone(RobotinoSerial(SerialConfig(device=where)), SerialWire(where))
    )
    with base.running():
        if not base.run(_UP, lambda: base.last(topics.ODOMETRY) is not None):
            say(f"not moved: no odometry within {_UP:g} s")
            return False
        start = _along(base)
        base.run(_LOOK)
        if (refused := _hindered(base, start)) is not None:
            say(f"not moved: {refused}")
            return False
        there = _go(base, 1.0, start)
        back = _go(base, -1.0, start)
        status = base.last(topics.STATUS)
    good = abs(there - start - _WAY) <= _OFF and abs(back - start) <= _OFF
    way = f"forward {1000 * (there - start):.0f} mm (50 wanted), then back to {1000 * (back - start):+.0f} mm"
    say(f"{way}, each within {1000 * _OFF:.0f} mm: {'as it should be' if good else 'NOT as it should be'}")
    if status is not None and (status.bumper or status.link_down):
        say("the bumper is pressed" if status.bumper else "the base was lost on the way")
        return False
    return good


def _hindered(base: Alone, start: float) -> str | None:
    """Return why the base had better not be moved, by what it says of itself; None: nothing."""
    odometry, ranges, status = base.last(topics.ODOMETRY), base.last(topics.RANGES), base.last(topics.STATUS)
    assert odometry is not None
    if abs(odometry.twist.vx) + abs(odometry.twist.vy) > _STILL or abs(odometry.pose.x - start) > _CREPT:
        return "it moves already: something else drives it, which has to be stopped first"
    if status is not None and status.bumper:
        return "its bumper is pressed"
    if ranges is not None and min(ranges.distance) < _ROOM:
        return f"something is {min(ranges.distance):.2f} m from it, by its infra-red sensors; {_ROOM} m are needed"
    return None


def _along(base: Alone) -> float:
    """Return where the base is ahead of where its driver began, m."""
    found = base.last(topics.ODOMETRY)
    assert found is not None
    return found.pose.x


def _go(base: Alone, direction: float, start: float) -> float:
    """Go to `_WAY` ahead of the start, or back to it; return where the base came to stand, m."""
    goal = start + (_WAY if direction > 0 else 0.0)
    # It brakes by 0.4 m/s^2 over REST, and stops at once over the serial link.
    early = _SPEED**2 / (2 * 0.4)

    def arrived() -> bool:
        found = base.last(topics.ODOMETRY)
        assert found is not None
        done = direction * (goal - found.pose.x) <= early
        wish = 0.0 if done else direction * _SPEED
        base.give(
            topics.COMMAND,
            VelocityCommand(
                stamp=base.now,
                twist=Twist2(vx=wish),
                deadline=nanoseconds(_DEADLINE),
                driver_sequence=found.driver_sequence,
            ),
        )
        return done

    base.run(_LONGEST, arrived)
    base.run(_STOPPING)
    return _along(base)
