"""Judges whether an object has come to rest where it should, from noisy observations of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from runtime.messages import ObjectState
from runtime.time import seconds
from services.geometry.angles import difference

Array = NDArray[np.float64]


@dataclass(slots=True)
class Arrival:
    """The newest observations of the object, over the time that it is to be at rest.

    The mean of n observations of what rests is known sqrt(n) times better than one of them, so that noise which no
    single observation could prove to be within the precision does not keep an object from being delivered.
    """

    seen: list[tuple[float, float, float, float]] = field(default_factory=list)
    """stamp, s; x, y, m, map frame; yaw, rad, continuous; 0 where none is seen"""

    def needed(self, variance: float, speed: float) -> float:
        """Return over how long, s, to observe for the slope to be known to `speed` by two standard deviations.

        Args:
            variance: m^2 (rad^2), of an observation. That of a slope over T s with n of them is 12 variance / (n T^2).
            speed: m/s (rad/s).
        """
        if len(self.seen) < 2:
            return 0.0
        period = (self.seen[-1][0] - self.seen[0][0]) / (len(self.seen) - 1)
        return math.cbrt(4.0 * 12.0 * variance * period / speed**2)

    def add(self, object: ObjectState, rest: float) -> None:
        """Take an observation; those of the last `rest` s are kept, and the one before them."""
        time, yaw = seconds(object.stamp), object.yaw
        if self.seen:
            yaw = self.seen[-1][3] + difference(yaw, self.seen[-1][3])
        self.seen.append((time, object.position.x, object.position.y, yaw))
        while len(self.seen) > 2 and time - self.seen[1][0] >= rest:
            self.seen.pop(0)

    def covers(self, rest: float) -> bool:
        """Tell whether the observations reach back over `rest`, s."""
        return len(self.seen) > 1 and self.seen[-1][0] - self.seen[0][0] >= rest

    def speed(self) -> tuple[float, float]:
        """Return the slopes of the straight lines through the observations: m/s, and rad/s, at least 0.

        Two observations at least.
        """
        t, x, y, yaw = np.array(self.seen).T
        t = t - t.mean()
        return math.hypot(t @ x, t @ y) / float(t @ t), abs(t @ yaw) / float(t @ t)

    def mean(self) -> tuple[float, float, float, float]:
        """Return of how long ago the mean is, s, the mean position, m, and yaw, rad."""
        t, x, y, yaw = np.array(self.seen).mean(axis=0)
        return float(self.seen[-1][0] - t), float(x), float(y), float(yaw)
