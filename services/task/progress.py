"""Scores a push as it goes: path lengths, and whether the robot circles (Sec. 6.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from services.geometry.angles import difference

Array = NDArray[np.float64]

LEASH = 0.03
"""m, see `PathLength`."""

ORBIT_TURN = math.tau
"""rad that the robot's bearing from the object sweeps, without progress, for it to count as circling."""


@dataclass(slots=True)
class PathLength:
    """The length of a noisy path: that of the way of a follower on a leash, plus the leash at its end.

    Noise smaller than the leash does not add up. Bias: the follower cuts corners, by leash^2/(2 R^2) of the
    length on an arc of radius R (0.5 % at R = 0.3 m).
    """

    x: float = 0.0
    """m, of the follower"""
    y: float = 0.0
    behind: float = 0.0
    """m, from the follower to the newest position"""
    travelled: float = 0.0
    """m, of the follower"""
    started: bool = False

    def add(self, x: float, y: float, leash: float = LEASH) -> None:
        """Take the next position (x, y), m."""
        if not self.started:
            self.x, self.y, self.started = x, y, True
            return
        dx, dy = x - self.x, y - self.y
        self.behind = math.hypot(dx, dy)
        if self.behind > leash:
            pull = self.behind - leash
            self.x += dx * pull / self.behind
            self.y += dy * pull / self.behind
            self.travelled += pull
            self.behind = leash

    @property
    def length(self) -> float:
        """Return the length so far, m."""
        return self.travelled + self.behind


@dataclass(slots=True)
class Progress:
    """What is measured during a push."""

    robot_path: PathLength = field(default_factory=PathLength)
    object_path: PathLength = field(default_factory=PathLength)
    bearing: float = 0.0
    """rad, map frame, of the robot from the object"""
    swept: float = 0.0
    """rad, net turn of that bearing since `progressed`"""

    def add(self, r: Array, o: Array) -> None:
        """Take the next positions of robot and object ((2,), m, map frame)."""
        bearing = math.atan2(r[1] - o[1], r[0] - o[0])
        if self.object_path.started:
            self.swept += difference(bearing, self.bearing)
        self.bearing = bearing
        self.robot_path.add(float(r[0]), float(r[1]))
        self.object_path.add(float(o[0]), float(o[1]))

    def progressed(self) -> None:
        """Say that the object has come nearer to the goal: what the robot did before does not count as circling."""
        self.swept = 0.0

    def orbiting(self) -> bool:
        """Tell whether the robot has gone round the object since the last progress."""
        return abs(self.swept) >= ORBIT_TURN

    @property
    def robot_length(self) -> float:
        """L_Qr, m."""
        return self.robot_path.length

    @property
    def object_length(self) -> float:
        """L_Qo, m."""
        return self.object_path.length
