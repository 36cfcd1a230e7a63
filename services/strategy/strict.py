"""The strict strategy: the farthest point of Q that meets (2) and (3) (Sec. 4.1)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from services.geometry.corridor import CorridorGeometry
from services.geometry.field import lookup, minimum, slope
from services.geometry.path import closest_kernel
from services.strategy.lookahead import ahead
from services.strategy.target import Target, make

Array = NDArray[np.float64]

FALLBACK = 0.1
"""m ahead of c. The paper takes c itself, which gives no direction when o is on the path."""


def choose(geometry: CorridorGeometry, o: Array, d_r: float, d_o: float, fallback: float = FALLBACK) -> Target:
    """Return the solution of (1)-(3), or where there is none the point `fallback` m ahead of c.

    l is perpendicular to the depth's gradient at o, and w is where that gradient leads from o to E_o. Angles
    between lines are unsigned. (3) asks for o-t to be inside E_o, not merely apart from it. Candidates are the
    q_i ahead of c and, last, c itself: never points behind.

    Args:
        o: (2,), m, map frame.
        d_r, d_o: m, diameters of robot and object.
    """
    f = geometry.field
    x, y, index, feasible, arc = _search(
        geometry.path, geometry.clearance, geometry.start, *f.grid,
        o[0], o[1], 0.5 * (d_r + d_o),
    )  # fmt: skip
    if not feasible:
        return ahead(geometry, o, d_r, d_o, arc, fallback, feasible=False)
    return make(geometry, o, d_r, d_o, x, y, index, True, arc)


@njit("Tuple((f8,f8,f8))(f8[:,::1],f8,f8,f8,f8[:,::1],i8,f8,f8,f8,f8,f8,f8)", cache=True)
def _condition(
    values: Array, x0: float, y0: float, resolution: float, path: Array, index: int,
    ox: float, oy: float, cx: float, cy: float, distance: float, offset: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Return the unit normal of l and the ratio d(o, c) / d(w, c) of (2)."""
    nx, ny = slope(values, x0, y0, resolution, ox, oy)
    if nx * nx + ny * ny < 0.04:
        # On the ridge the gradient says nothing; nor does (2), for there the ratio is about 0.
        nx, ny = cx - ox, cy - oy
        if distance < 1e-6:
            nx, ny = path[index, 1] - path[index + 1, 1], path[index + 1, 0] - path[index, 0]
    norm = math.sqrt(nx * nx + ny * ny)
    nx, ny = nx / norm, ny / norm
    inside = lookup(values, x0, y0, resolution, ox, oy) - offset
    wx, wy = ox - nx * inside, oy - ny * inside
    wide = math.sqrt((wx - cx) ** 2 + (wy - cy) ** 2)
    return nx, ny, distance / wide if wide > 1e-9 else np.inf


@njit("Tuple((f8,f8,i8,b1,f8))(f8[:,::1],f8[::1],i8,f8[:,::1],f8,f8,f8,f8,f8,f8)", cache=True)
def _search(
    path: Array, clearance: Array, start: int, values: Array, x0: float, y0: float, resolution: float,
    ox: float, oy: float, offset: float,
) -> tuple[float, float, int, bool, float]:  # fmt: skip
    """Return t, its index, whether it is feasible, and the arc length of c."""
    index, _, cx, cy, distance, arc = closest_kernel(path, clearance, start, ox, oy)
    if lookup(values, x0, y0, resolution, ox, oy) <= offset:
        return cx, cy, index, False, arc
    nx, ny, ratio = _condition(values, x0, y0, resolution, path, index, ox, oy, cx, cy, distance, offset)
    for i in range(len(path) - 1, index - 1, -1):
        tx, ty = (path[i, 0], path[i, 1]) if i > index else (cx, cy)
        dx, dy = tx - ox, ty - oy
        length = math.sqrt(dx * dx + dy * dy)
        if length < 1e-6 or abs(dx * nx + dy * ny) < ratio * length:
            continue
        if minimum(values, x0, y0, resolution, ox, oy, tx, ty, offset) > offset:
            return tx, ty, i, True, arc
    return cx, cy, index, False, arc
