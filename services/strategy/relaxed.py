"""The relaxed strategy for narrow corridors: the farthest point of Q that meets (5) and (6) (Sec. 4.2)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from services.geometry.corridor import CorridorGeometry
from services.geometry.field import lookup, minimum
from services.geometry.path import closest_kernel
from services.strategy.lookahead import ahead
from services.strategy.target import Target, make

Array = NDArray[np.float64]

FALLBACK = 0.3
"""m ahead of c. The paper names none, though (6) has no solution wherever W_p < d_r/2. In a prototype's study
success was 21, 26 and 52 % with 0, 0.1 and 0.3 m."""


def choose(geometry: CorridorGeometry, o: Array, d_r: float, d_o: float, fallback: float = FALLBACK) -> Target:
    """Return the solution of (4)-(6), or where there is none the point `fallback` m ahead of c.

    Distances to E count as negative outside: (5) asks for p inside the pushing corridor, (6) for o-t inside it
    by more than max(d_o, d_r)/2. Candidates are the q_i ahead of c and, last, c itself: never points behind.

    Args:
        o: (2,), m, map frame.
        d_r, d_o: m, diameters of robot and object.
    """
    f = geometry.field
    x, y, index, feasible, arc = _search(
        geometry.path, geometry.clearance, geometry.start, *f.grid,
        o[0], o[1], 0.5 * (d_r + d_o), 0.5 * max(d_r, d_o),
    )  # fmt: skip
    if not feasible:
        return ahead(geometry, o, d_r, d_o, arc, fallback, feasible=False)
    return make(geometry, o, d_r, d_o, x, y, index, True, arc)


@njit("Tuple((f8,f8,i8,b1,f8))(f8[:,::1],f8[::1],i8,f8[:,::1],f8,f8,f8,f8,f8,f8,f8)", cache=True)
def _search(
    path: Array, clearance: Array, start: int, values: Array, x0: float, y0: float, resolution: float,
    ox: float, oy: float, behind: float, beside: float,
) -> tuple[float, float, int, bool, float]:  # fmt: skip
    """Return t, its index, whether it is feasible, and the arc length of c."""
    index, _, cx, cy, _, arc = closest_kernel(path, clearance, start, ox, oy)
    if lookup(values, x0, y0, resolution, ox, oy) <= beside:
        return cx, cy, index, False, arc
    for i in range(len(path) - 1, index - 1, -1):
        tx, ty = (path[i, 0], path[i, 1]) if i > index else (cx, cy)
        dx, dy = tx - ox, ty - oy
        length = math.sqrt(dx * dx + dy * dy)
        if length < 1e-6:
            continue
        px, py = ox - behind * dx / length, oy - behind * dy / length
        if lookup(values, x0, y0, resolution, px, py) <= 0.0:
            continue
        if minimum(values, x0, y0, resolution, ox, oy, tx, ty, beside) > beside:
            return tx, ty, i, True, arc
    return cx, cy, index, False, arc
