"""What a double of a link drives: a base, simulated somewhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from drivers.robotino.infrared import COUNT, FARTHEST
from drivers.robotino.kinematics import Twist
from drivers.robotino.odometry import DeadReckoning


@dataclass(frozen=True)
class LaserReading:
    """A scan: ranges, m, evenly from angle `first` to `last`, rad; 0 where nothing came back."""

    first: float
    last: float
    ranges: tuple[float, ...]


class Plant(Protocol):
    """A base as its board sees it."""

    def drive(self, twist: Twist) -> None:
        """Let the wheels aim at this motion from now on, m/s and rad/s, base frame."""

    @property
    def pose(self) -> Twist:
        """Return where the wheels say the base is: x, y, theta, m and rad, from where it began."""

    @property
    def twist(self) -> Twist:
        """Return how the base moves, m/s and rad/s, base frame."""

    @property
    def distances(self) -> tuple[float, ...]:
        """Return what the nine infra-red sensors see, m."""

    @property
    def bumper(self) -> bool:
        """Return whether the bumper is pressed."""

    @property
    def scan(self) -> LaserReading | None:
        """Return what the laser sees; None: there is none."""


@dataclass
class IdealPlant:
    """A base alone on a floor, that does at once what its wheels do. `pass_by` lets time go by."""

    reckoning: DeadReckoning
    twist: Twist = (0.0, 0.0, 0.0)
    distances: tuple[float, ...] = (FARTHEST,) * COUNT
    bumper: bool = False
    scan: LaserReading | None = None

    @classmethod
    def at_rest(cls) -> IdealPlant:
        """Return a base at its origin."""
        return cls(DeadReckoning())

    @property
    def pose(self) -> Twist:
        """Return where it is."""
        return self.reckoning.x, self.reckoning.y, self.reckoning.theta

    def drive(self, twist: Twist) -> None:
        """Move so from now on."""
        self.twist = twist

    def pass_by(self, seconds: float) -> None:
        """Let so many seconds pass."""
        vx, vy, omega = self.twist
        self.reckoning.go((vx * seconds, vy * seconds, omega * seconds))
