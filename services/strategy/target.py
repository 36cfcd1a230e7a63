"""What every strategy returns: the intermediate pushing target and what follows from it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.geometry.corridor import CorridorGeometry

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Target:
    """An intermediate pushing target."""

    t: Array
    """(2,), m, map frame, on Q"""
    p: Array
    """(2,), m, map frame: the desired robot position, on the push-line (d_o + d_r)/2 behind o (Fig. 4d)"""
    feasible: bool
    """False: no point meets the strategy's conditions, t is its fallback"""
    index: int
    """of the point of Q at t or last before it"""
    distance_to_go: float
    """m along Q from the point closest to o to g"""


def push_position(o: Array, t: Array, d_r: float, d_o: float, along: Array) -> Array:
    """Return p (2,), m: the push-line o-t extended behind `o` by (d_o + d_r)/2.

    Args:
        along: (2,), the path's direction, taken where t and o coincide.
    """
    dx, dy = t - o
    if math.hypot(dx, dy) < 1e-9:
        dx, dy = along
    length = math.hypot(dx, dy)
    return np.asarray(o - 0.5 * (d_o + d_r) / length * np.array((dx, dy)))


def make(
    geometry: CorridorGeometry, o: Array, d_r: float, d_o: float, x: float, y: float, index: int, feasible: bool,
    arc: float,
) -> Target:  # fmt: skip
    """Return the target (`x`, `y`), the object being at arc length `arc` m of Q."""
    t = np.array((x, y))
    i = min(index, len(geometry.path) - 2)
    along = geometry.path[i + 1] - geometry.path[i]
    return Target(t, push_position(o, t, d_r, d_o, along), feasible, index, float(geometry.arc[-1]) - arc)
