"""Takes the grid's corners out of a path and keeps its clearance: shortcuts, then an elastic band. Kernels."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from services.corridor.dijkstra import factor
from services.geometry.field import lookup, slope

Array = NDArray[np.float64]

SLACK = 0.005
"""m a path may be nearer to an obstacle than asked, between points that are not."""

_SAMPLE = 0.05


@njit("f8(f8[:,::1],f8,f8,f8,f8,f8,f8,f8,f8,f8,f8,b1)", cache=True)
def line_cost(
    values: Array, x0: float, y0: float, spacing: float, ax: float, ay: float, bx: float, by: float,
    need: float, comfort: float, weight: float, forced: bool,
) -> float:  # fmt: skip
    """Return the cost of the straight line from a to b; infinite where it comes too near, unless `forced`."""
    length = math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
    steps = max(1, math.ceil(length / _SAMPLE))
    total = 0.0
    for k in range(steps):
        t = (k + 0.5) / steps
        c = lookup(values, x0, y0, spacing, ax + t * (bx - ax), ay + t * (by - ay))
        if c < need - SLACK and not forced:
            return np.inf
        total += factor(c, need, comfort, weight)
    return total * length / steps


@njit("f8[:,::1](f8[:,::1],f8,f8,f8,f8[:,::1],f8,f8,f8)", cache=True)
def shortcut(
    values: Array,
    x0: float,
    y0: float,
    spacing: float,
    path: Array,
    need: float,
    comfort: float,
    weight: float,
) -> Array:
    """Return the cheapest chain of straight lines between points of `path` (N, 2), ends kept."""
    n = len(path)
    best, parent = np.zeros(n), np.zeros(n, np.int64)
    for j in range(1, n):
        bx, by = path[j, 0], path[j, 1]
        best[j] = best[j - 1] + line_cost(
            values, x0, y0, spacing, path[j - 1, 0], path[j - 1, 1], bx, by, need, comfort, weight, True
        )
        parent[j] = j - 1
        for i in range(j - 2, -1, -1):
            ax, ay = path[i, 0], path[i, 1]
            # A metre costs at least 1, so most lines need not be looked at.
            if best[i] + math.sqrt((bx - ax) ** 2 + (by - ay) ** 2) >= best[j]:
                continue
            cost = best[i] + line_cost(values, x0, y0, spacing, ax, ay, bx, by, need, comfort, weight, False)
            if cost < best[j]:
                best[j] = cost
                parent[j] = i
    count = 1
    k = n - 1
    while k > 0:
        k = parent[k]
        count += 1
    out = np.empty((count, 2))
    k = n - 1
    for c in range(count - 1, -1, -1):
        out[c, 0], out[c, 1] = path[k, 0], path[k, 1]
        k = parent[k]
    return out


@njit("f8[:,::1](f8[:,::1],f8,f8,f8,f8[:,::1],f8,f8,f8,i8)", cache=True)
def relax(
    values: Array, x0: float, y0: float, spacing: float, path: Array, need: float, comfort: float, weight: float,
    sweeps: int,
) -> Array:  # fmt: skip
    """Return `path` (N, 2), evenly spaced, pulled taut as a band whose tension is `factor`; ends kept.

    At rest curvature * factor = its gradient across the band. A point does not move to where it would have
    less clearance than is needed.
    """
    out = path.copy()
    n = len(out)
    for _ in range(sweeps):
        for i in range(1, n - 1):
            x, y = out[i, 0], out[i, 1]
            tx, ty = out[i + 1, 0] - out[i - 1, 0], out[i + 1, 1] - out[i - 1, 1]
            span = math.sqrt(tx * tx + ty * ty)
            if span == 0.0:
                continue
            mx, my = 0.5 * (out[i + 1, 0] + out[i - 1, 0]) - x, 0.5 * (out[i + 1, 1] + out[i - 1, 1]) - y
            c = lookup(values, x0, y0, spacing, x, y)
            if c < comfort:
                gx, gy = slope(values, x0, y0, spacing, x, y)
                across = (gy * tx - gx * ty) / span
                steep = -2.0 * weight * (comfort - c) / (comfort - need) ** 2 / factor(c, need, comfort, weight)
                push = -0.125 * span * span * steep * across
                limit = 0.25 * span
                push = min(limit, max(-limit, push))
                mx, my = mx - push * ty / span, my + push * tx / span
            px, py = x + 0.5 * mx, y + 0.5 * my
            if lookup(values, x0, y0, spacing, px, py) >= min(need, c):
                out[i, 0], out[i, 1] = px, py
    return out
