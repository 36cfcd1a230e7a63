"""A laser scan as mapping uses it: ends of beams in the base's frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scan:
    """Beams of one scan.

    Attributes:
        ends: (N, 2), m, base frame, where beams end or are no longer looked at.
        returned: (N,), whether something is there.
        start: (2,), m, base frame, of the sensor.
    """

    ends: Array
    returned: NDArray[np.bool_]
    start: Array

    @classmethod
    def of(cls, ranges: Array, angles: Array, mount: Array, furthest: float, nothing: float) -> Scan:
        """Return the scan of `ranges`, (N,), m, at `angles`, (N,), rad, sensor frame.

        Args:
            mount: (3,), m and rad, pose of the sensor on the base.
            furthest: m; what is beyond is not looked at: the beam counts as free up to there.
            nothing: m; ranges from here on, and those that are not finite or not positive, are no measurement.
        """
        good = np.isfinite(ranges) & (ranges > 0.0) & (ranges < nothing)
        ranges, angles = ranges[good], angles[good] + mount[2]
        length = np.minimum(ranges, furthest)
        ends = mount[:2] + length[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
        return cls(np.ascontiguousarray(ends), ranges < furthest, np.array(mount[:2], np.float64))

    @property
    def reach(self) -> float:
        """Return how far from the base the farthest end is, m."""
        return float(np.hypot(*self.ends.T).max(initial=0.0))

    def thinned(self, count: int) -> Array:
        """Return about so many of the ends at which something is, evenly over the scan, (M, 2)."""
        ends = self.ends[self.returned]
        every = max(1, len(ends) // count)
        return np.ascontiguousarray(ends[::every])
