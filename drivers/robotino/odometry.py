"""Odometry: where the wheels say that the base went since the driver began."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, hypot, sin

from drivers.angles import wrap
from drivers.robotino.kinematics import Twist
from runtime.messages import Odometry, Pose2, Twist2
from runtime.time import Time

DISTANCE, TURN, HEADING = 0.02, 0.03, 0.02
"""Deviations: m per root of a metre, along and across; rad per root of a radian; rad per root of a metre. Those of the
simulated rooms; no data sheet gives any."""

_SMALL = 1e-6
_WRAP = 2**32


@dataclass
class DeadReckoning:
    """The pose in the odom frame, which is where the base was when the driver began.

    Attributes:
        x, y, theta: m, m and rad in (-pi, pi].
        travelled, turned: m and rad, all there was.
    """

    x: float = 0.0
    y: float = 0.0
    theta: float = 0.0
    travelled: float = 0.0
    turned: float = 0.0

    def go(self, way: Twist) -> None:
        """Go `way`, m, m and rad, base frame: along an arc, as a base does whose wheels turn evenly."""
        dx, dy, turn = way
        if abs(turn) < _SMALL:
            ahead, aside = dx - 0.5 * turn * dy, dy + 0.5 * turn * dx
        else:
            along, across = sin(turn) / turn, (1.0 - cos(turn)) / turn
            ahead, aside = along * dx - across * dy, across * dx + along * dy
        c, s = cos(self.theta), sin(self.theta)
        self.x += c * ahead - s * aside
        self.y += s * ahead + c * aside
        self.theta = wrap(self.theta + turn)
        self.travelled += hypot(dx, dy)
        self.turned += abs(turn)

    def message(self, stamp: Time, twist: Twist, sequence: int) -> Odometry:
        """Return the message.

        Args:
            twist: m/s and rad/s, base frame.
        """
        place = DISTANCE**2 * self.travelled
        heading = TURN**2 * self.turned + HEADING**2 * self.travelled
        return Odometry(
            stamp=stamp,
            pose=Pose2(x=self.x, y=self.y, theta=self.theta),
            twist=Twist2(vx=twist[0], vy=twist[1], omega=twist[2]),
            driver_sequence=sequence,
            covariance=[place, 0, 0, 0, place, 0, 0, 0, heading],
        )


def way(before: Twist, after: Twist) -> Twist:
    """Return the way, m, m and rad, base frame, from one pose (x, y, theta) to another along an arc: `go` goes it."""
    turn = wrap(after[2] - before[2])
    half = 0.5 * turn
    # The chord of the arc points half the turn ahead, and is shorter than it.
    c, s = cos(before[2] + half), sin(before[2] + half)
    longer = half / sin(half) if abs(half) > 1e-9 else 1.0
    dx, dy = longer * (after[0] - before[0]), longer * (after[1] - before[1])
    return c * dx + s * dy, -s * dx + c * dy, turn


def counted(before: int, now: int) -> int:
    """Return by how much a counter of 32 bits with a sign went from `before` to `now`, the shorter way round."""
    return (now - before + _WRAP // 2) % _WRAP - _WRAP // 2
