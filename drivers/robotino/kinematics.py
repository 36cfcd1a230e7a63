"""The three-wheel drive: from the base's motion to its motors' and back.

x forward, y left, omega counter-clockwise seen from above. Motor 1 drives the wheel at 60 degrees (front left), motor 2
the one at 180 (rear), motor 3 the one at 300 (front right), each along its tangent, counter-clockwise positive
(reference 3.1, from api2's OmniDriveModel and controld3's DriveSystem, which hold the same matrix).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, isfinite, pi, sqrt

Motors = tuple[float, float, float]
"""rpm of the motors' shafts, before the gear; or revolutions, where way stands for speed"""
Twist = tuple[float, float, float]
"""vx, vy, m/s, and omega, rad/s, base frame; or m and rad, where way stands for speed"""

_SIN60 = sqrt(3.0) / 2.0


class NotFinite(ValueError):
    """A motion is NaN or infinite."""


@dataclass(frozen=True)
class Geometry:
    """A drive.

    Attributes:
        wheel_distance: rb, m, from the centre to a wheel. wheel_radius: rw, m. gear: motor turns per wheel turn.
        ticks: of the encoder, per turn of a motor. max_rpm: of a motor.
    """

    wheel_distance: float
    wheel_radius: float
    gear: float
    ticks: int
    max_rpm: float

    @property
    def turns_per_metre(self) -> float:
        """Return how often a motor turns while its wheel rolls 1 m."""
        return self.gear / (2.0 * pi * self.wheel_radius)

    def motors(self, twist: Twist) -> Motors:
        """Return the motors' speeds, rpm, that make the base move so (reference 3.2).

        Raises:
            NotFinite: a number is NaN or infinite.
        """
        vx, vy, omega = _finite("motion", twist)
        k, around = 60.0 * self.turns_per_metre, self.wheel_distance * omega
        return (
            k * (-_SIN60 * vx + 0.5 * vy + around),
            k * (-vy + around),
            k * (_SIN60 * vx + 0.5 * vy + around),
        )

    def twist(self, motors: Motors) -> Twist:
        """Return how the base moves while its motors turn at so many rpm (reference 3.2).

        Raises:
            NotFinite: a number is NaN or infinite.
        """
        m1, m2, m3 = _finite("motor speeds", motors)
        k = 60.0 * self.turns_per_metre
        return (
            (m3 - m1) / (2.0 * _SIN60 * k),
            (m1 + m3 - 2.0 * m2) / (3.0 * k),
            (m1 + m2 + m3) / (3.0 * self.wheel_distance * k),
        )

    def way(self, ticks: tuple[int, int, int]) -> Twist:
        """Return how far the base went, m, m and rad, base frame, while its encoders counted `ticks`."""
        # A motor that turns at 60 rpm for a second makes one turn.
        m1, m2, m3 = (60.0 * one / self.ticks for one in ticks)
        return self.twist((m1, m2, m3))

    def within(self, twist: Twist) -> tuple[Twist, bool]:
        """Return the motion that the motors can follow, and whether it differs: it is scaled, so its course stays.

        Raises:
            NotFinite: a number is NaN or infinite.
        """
        fastest = max(abs(one) for one in self.motors(twist))
        if fastest <= self.max_rpm:
            return twist, False
        share = self.max_rpm / fastest
        return (twist[0] * share, twist[1] * share, twist[2] * share), True


ROBOTINO_1_2 = Geometry(wheel_distance=0.132, wheel_radius=0.040, gear=16.0, ticks=2000, max_rpm=2000.0)
"""Robotino 1 and 2 (reference 3.2; controld2's limit)"""
ROBOTINO_3_4 = Geometry(wheel_distance=0.175, wheel_radius=0.060, gear=32.0, ticks=2000, max_rpm=3000.0)
"""Robotino 3 and 4 (reference 3.2, controld3.conf)"""


def ramped(now: Twist, wish: Twist, step: float, turn_step: float) -> Twist:
    """Return the motion after one step from `now` towards `wish`.

    Args:
        step: m/s by which the velocity may change, as a vector, so that its course does not bend.
        turn_step: rad/s by which the turn may change.
    """
    dx, dy, turn = wish[0] - now[0], wish[1] - now[1], wish[2] - now[2]
    size = hypot(dx, dy)
    share = min(1.0, step / size) if size > 0.0 else 0.0
    return (
        wish[0] if share == 1.0 else now[0] + share * dx,
        wish[1] if share == 1.0 else now[1] + share * dy,
        wish[2] if abs(turn) <= turn_step else now[2] + (turn_step if turn > 0.0 else -turn_step),
    )


def _finite(what: str, numbers: tuple[float, float, float]) -> tuple[float, float, float]:
    if not all(map(isfinite, numbers)):
        raise NotFinite(f"{what} {numbers}, expected finite numbers")
    return numbers
