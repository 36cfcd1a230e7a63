"""What the camera sees of the floor, as mapping draws it: stretches that are free, and where something stands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from runtime.messages import SeenFloor
from services.geometry.pose import placed

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_OVER = 1.6
"""times its distance from below the camera out to which what is met may be the object's upper parts, seen over the
floor behind it: those of a thing of 0.37 of the camera's height"""


_FARTHEST = 50.0
"""m: no camera on a base sees a floor from farther away"""


class BadFloor(ValueError):
    """A message of which the columns do not fit together."""


@dataclass(frozen=True)
class Seen:
    """N stretches of floor, base frame.

    Attributes:
        start: (2,), m, the point below the camera.
        firsts, lasts: (N, 2), m; met: (N,), whether something stands at the last.
    """

    start: Array
    firsts: Array
    lasts: Array
    met: Mask

    @classmethod
    def of(cls, message: SeenFloor) -> Seen:
        """Return what a message says.

        Raises:
            BadFloor: its columns differ in length, or a stretch ends before it begins, or is nowhere near.
        """
        columns = [np.array(one, np.float64) for one in (message.bearing, message.first, message.last, message.met)]
        lengths = [len(one) for one in columns]
        if len(set(lengths)) > 1:
            raise BadFloor(f"bearing, first, last and met have {lengths} entries, expected as many of each")
        bearing, first, last, met = columns
        if (first < 0.0).any() or (last < first).any():
            raise BadFloor("a stretch of floor that begins below 0 m or ends before it begins")
        start = np.array((message.position.x, message.position.y))
        farthest = max(float(last.max(initial=0.0)), *np.abs(start).tolist())
        if farthest > _FARTHEST:
            raise BadFloor(f"{farthest:g} m from the base, expected at most {_FARTHEST:g}")
        ways = np.column_stack([np.cos(bearing), np.sin(bearing)])
        return cls(start, start + first[:, None] * ways, start + last[:, None] * ways, met > 0.0)

    def of_thing(self, centre: Array, radius: float) -> Mask:
        """Return which of the stretches, (N,), end at a thing around `centre`, (2,), base frame, or at its picture."""
        to, away = self.lasts - self.start, centre - self.start
        far, distance = np.hypot(*to.T), max(float(np.hypot(*away)), 1e-6)
        aside = np.abs(to[:, 0] * away[1] - to[:, 1] * away[0]) / distance
        near = np.hypot(*(self.lasts - centre).T) <= radius
        along = (far >= distance - radius) & (far <= _OVER * (distance + radius)) & (to @ away > 0.0)
        return np.asarray(near | (along & (aside <= far * radius / distance)))

    def on_map(self, pose: Array) -> Array:
        """Return where the stretches end, (N, 2), m, on the map of a base at `pose`, (3,)."""
        return placed(self.lasts, pose)

    def shortened(self, which: Mask, by: float) -> Seen:
        """Return the stretches with those of `which`, (N,), `by` m shorter, and nothing met there."""
        along = self.lasts - self.firsts
        length = np.hypot(*along.T)
        lasts = np.where(which[:, None], self.lasts - by * along / np.maximum(length, 1e-9)[:, None], self.lasts)
        kept = ~which | (length > by)
        return Seen(self.start, self.firsts[kept], np.ascontiguousarray(lasts[kept]), (self.met & ~which)[kept])
