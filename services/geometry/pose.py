"""Poses in the plane, and where something was a moment ago. A pose is (3,): x, y, m, and theta, rad."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from runtime.time import SECOND, Time, nanoseconds
from services.geometry.angles import wrap

Array = NDArray[np.float64]

_JUMP, _FASTEST = 0.3, 3.0
"""m and m/s that odometry may go on from one to the next"""


def compose(pose: Array, step: Array) -> Array:
    """Return the pose, (3,), after a step, (3,), in the frame of `pose`."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return np.array(
        (pose[0] + c * step[0] - s * step[1], pose[1] + s * step[0] + c * step[1], wrap(float(pose[2] + step[2])))
    )


def between(first: Array, second: Array) -> Array:
    """Return the step, (3,), that leads from `first` to `second`, in the frame of `first`."""
    dx, dy = second[0] - first[0], second[1] - first[1]
    c, s = math.cos(first[2]), math.sin(first[2])
    return np.array((c * dx + s * dy, -s * dx + c * dy, wrap(float(second[2] - first[2]))))


def rotation(angle: float) -> Array:
    """Return the matrix, (2, 2), that turns by `angle`, rad, counter-clockwise."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])


def placed(points: Array, pose: Array) -> Array:
    """Return points, (N, 2), m, of the frame of `pose`, in the frame that `pose` is of."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return np.asarray(points @ np.array([[c, s], [-s, c]]) + pose[:2])


@dataclass
class History:
    """Poses of the last while.

    Attributes:
        stamps, poses: ns and (3,), oldest first.
    """

    stamps: list[Time] = field(default_factory=list)
    poses: list[Array] = field(default_factory=list)

    def add(self, stamp: Time, pose: Array, memory: float) -> bool:
        """Take a pose, (3,), and forget those from more than `memory` s before. Returns False if it is no newer one."""
        if self.stamps and stamp <= self.stamps[-1]:
            return False
        self.stamps.append(stamp)
        self.poses.append(pose)
        while self.stamps[0] < stamp - nanoseconds(memory):
            del self.stamps[0], self.poses[0]
        return True

    def leaps(self, stamp: Time, pose: Array) -> bool:
        """Return whether no base can have come from the last pose to this one, (3,): the odometry has begun anew."""
        if not self.stamps:
            return False
        step, seconds = between(self.poses[-1], pose), max(stamp - self.stamps[-1], 0) / SECOND
        return math.hypot(step[0], step[1]) > _JUMP + _FASTEST * seconds

    def at(self, stamp: Time) -> Array:
        """Return the pose, (3,), at `stamp`: between two that are known, or the nearest one. There has to be one."""
        k = int(np.searchsorted(self.stamps, stamp))
        if k == 0 or k == len(self.stamps):
            return self.poses[min(k, len(self.stamps) - 1)]
        first, second = self.stamps[k - 1], self.stamps[k]
        step = between(self.poses[k - 1], self.poses[k])
        return compose(self.poses[k - 1], (stamp - first) / (second - first) * step)
