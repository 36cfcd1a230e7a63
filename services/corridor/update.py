"""Algorithm 1: does what the robot senses still fit the corridor?

The depth for (Q, C) is the depth for (Q, W_p) plus d_r/2, since W_p = C - d_r/2: one field serves both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from services.geometry.field import Field, lookup

Array = NDArray[np.float64]

THRESHOLD = 0.05
"""m, of disagreement that does not count (Sec. 6.1)."""


@dataclass(frozen=True, slots=True)
class Obstacle:
    """The sensed obstacle that is closest to the robot."""

    distance: float
    """m from the robot's centre"""
    bearing: float
    """rad, map frame, from the robot"""
    point: Array
    """(2,), m, map frame"""


@dataclass(frozen=True, slots=True)
class Disagreement:
    """How the closest obstacle compares with the corridor's edge on the same ray."""

    nearer: bool
    """an obstacle has come into the corridor"""
    farther: bool
    """the corridor ends before the obstacle. This alone is usual: discs touch obstacles in few places"""
    difference: float
    """m, distance to the obstacle less distance to the edge; 0 with nothing in sight"""


def external(hits: Array, r: Array, o: Array, d_r: float, d_o: float, margin: float) -> Array:
    """Return those of `hits` (M, 2), m, map frame, that are neither the object nor the robot.

    Those within d_o/2 + `margin` of `o` are taken for the object, within d_r/2 of `r` for the robot.
    """
    from_object = np.hypot(*(hits - o).T)
    from_robot = np.hypot(*(hits - r).T)
    return hits[(from_object > 0.5 * d_o + margin) & (from_robot > 0.5 * d_r)]


def distance_robot_closest_obstacle(hits: Array, r: Array) -> Obstacle | None:
    """Return the hit closest to `r` (line 1), the first of equals, or None without hits.

    Args:
        hits: (M, 2), m, map frame, end points of beams that hit something other than robot and object.
    """
    if len(hits) == 0:
        return None
    offsets = hits - r
    k = int(np.argmin(np.hypot(*offsets.T)))
    dx, dy = float(offsets[k, 0]), float(offsets[k, 1])
    return Obstacle(math.hypot(dx, dy), math.atan2(dy, dx), hits[k].copy())


def distance_robot_corridor_edge(field: Field, d_r: float, r: Array, bearing: float, limit: float = 20.0) -> float:
    """Return the distance, m, from `r` along `bearing` (rad, map frame) to the edge of (Q, C) (line 2).

    Negative by the depth where the robot's centre is outside (Q, C); `limit` where the edge is farther.
    """
    return _march(
        *field.grid, 0.5 * d_r, r[0], r[1],
        math.cos(bearing), math.sin(bearing), limit,
    )  # fmt: skip


def disagrees(field: Field, d_r: float, r: Array, hits: Array, threshold: float = THRESHOLD) -> Disagreement:
    """Compare the closest obstacle with the corridor's edge behind it or before it (line 3).

    The paper replans whenever the two differ. Then it would replan at nearly every step, since the ray to the
    closest obstacle seldom meets the corridor where a disc touches that obstacle; so the two directions are
    told apart and the caller decides.
    """
    obstacle = distance_robot_closest_obstacle(hits, r)
    if obstacle is None:
        return Disagreement(False, False, 0.0)
    edge = distance_robot_corridor_edge(field, d_r, r, obstacle.bearing)
    difference = obstacle.distance - edge
    return Disagreement(difference < -threshold, difference > threshold, difference)


@njit("f8(f8[:,::1],f8,f8,f8,f8,f8,f8,f8,f8,f8)", cache=True)
def _march(
    values: Array, x0: float, y0: float, resolution: float, offset: float,
    x: float, y: float, ux: float, uy: float, limit: float,
) -> float:  # fmt: skip
    # Depth is 1-Lipschitz: a step of that length cannot jump over the edge.
    travelled = 0.0
    here = lookup(values, x0, y0, resolution, x, y) + offset
    if here < 0.0:
        return here
    while here > 1e-3 and travelled < limit:
        travelled += here
        here = lookup(values, x0, y0, resolution, x + travelled * ux, y + travelled * uy) + offset
    return min(travelled, limit)
