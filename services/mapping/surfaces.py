"""Scans settle on the surfaces of a map: point to line, far finer than a cell."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from services.mapping.grid import MEAN_X, MEAN_Y, RESOLUTION, SIDE, Indices, Tiles
from services.mapping.matching import BEFORE, occupied

Array = NDArray[np.float64]

_LINE = 0.15
"""share of the spread along a line that points may have across it"""


@njit("f8(f4[:,:,:,::1],i4[:,::1],f8,f8,f8,f8,f8,f8,i8,i8,f8[::1])", cache=True)
def _surface(
    cells: Tiles, index: Indices, x0: float, y0: float, ex: float, ey: float, bx: float, by: float,
    reach: int, fewest: int, normal: Array,
) -> float:  # fmt: skip
    """Return how far a beam's end is from the surface there, m, along its `normal`, (2,), which is set; else NaN.

    The surface is the line through the means of the occupied cells around, of those at least before one of which the
    beam comes through a free cell.

    Args:
        x0, y0: m, the map's corner. ex, ey: m, the end. bx, by: m, from the end to a place shortly before it.
        reach: cells to each side; fewest: cells that make a line.
    """
    i, j = int((ex - x0) / RESOLUTION), int((ey - y0) / RESOLUTION)
    bi, bj = int((ex + bx - x0) / RESOLUTION) - i, int((ey + by - y0) / RESOLUTION) - j
    count, x, y, xx, xy, yy, faced = 0, 0.0, 0.0, 0.0, 0.0, 0.0, False
    for dj in range(-reach, reach + 1):
        for di in range(-reach, reach + 1):
            tile = occupied(cells, index, i + di, j + dj)
            if tile < 0:
                continue
            cell = cells[tile, (j + dj) % SIDE, (i + di) % SIDE]
            mx, my = cell[MEAN_X] - ex, cell[MEAN_Y] - ey
            count, x, y, xx, xy, yy = count + 1, x + mx, y + my, xx + mx * mx, xy + mx * my, yy + my * my
            faced = faced or occupied(cells, index, i + di + bi, j + dj + bj) < 0
    if count < fewest or not faced:
        return np.nan
    x, y = x / count, y / count
    a, b, c = xx / count - x * x, xy / count - x * y, yy / count - y * y
    middle, half = 0.5 * (a + c), math.sqrt(0.25 * (a - c) * (a - c) + b * b)
    if middle - half > _LINE * (middle + half):
        return np.nan
    # The normal is the direction of the least spread.
    angle = 0.5 * math.atan2(2.0 * b, a - c) + 0.5 * math.pi
    normal[0], normal[1] = math.cos(angle), math.sin(angle)
    return x * normal[0] + y * normal[1]


@njit(
    "f8[:,::1](f4[:,:,:,::1],i4[:,::1],i8,i8,f8[::1],f8[:,::1],f8[::1],f8,f8,f8[::1],f8[:,::1],i8)",
    cache=True,
)
def settle(
    cells: Tiles, index: Indices, corner_x: int, corner_y: int, pose: Array, ends: Array, start: Array,
    sigma: float, weight: float, expected: Array, information: Array, rounds: int,
) -> Array:  # fmt: skip
    """Change `pose` to where ends of beams lie on the surfaces nearby best, and return the information there, (3, 3).

    Point to line (Censi 2008), by Gauss and Newton, with weights that fall off as Gaussians do: along a wall, the
    places where beams happened to end before mean nothing, and neither do steps of cells.

    Args:
        sigma: m, deviation of an end from a surface. weight: see `belief`; so are expected and information.
    """
    x0, y0 = corner_x * SIDE * RESOLUTION, corner_y * SIDE * RESOLUTION
    normal, J = np.empty(2), np.empty(3)
    whole = information.copy()
    each = weight / max(len(ends), 1) / (sigma * sigma)
    for _ in range(rounds):
        c, s = math.cos(pose[2]), math.sin(pose[2])
        ox, oy = pose[0] + c * start[0] - s * start[1], pose[1] + s * start[0] + c * start[1]
        whole[:] = information
        pull = np.empty(3)
        pull[0], pull[1] = expected[0] - pose[0], expected[1] - pose[1]
        pull[2] = (expected[2] - pose[2] + math.pi) % (2.0 * math.pi) - math.pi
        pull = information @ pull
        for k in range(len(ends)):
            ex = pose[0] + c * ends[k, 0] - s * ends[k, 1]
            ey = pose[1] + s * ends[k, 0] + c * ends[k, 1]
            dx, dy = ox - ex, oy - ey
            length = math.sqrt(dx * dx + dy * dy) + 1e-9
            off = _surface(cells, index, x0, y0, ex, ey, dx / length * BEFORE, dy / length * BEFORE, 1, 3, normal)
            if math.isnan(off):
                continue
            w = each * math.exp(-0.5 * off * off / (4.0 * sigma * sigma))
            J[0], J[1] = normal[0], normal[1]
            J[2] = normal[1] * (ex - pose[0]) - normal[0] * (ey - pose[1])
            for a in range(3):
                pull[a] += w * J[a] * off
                for b in range(3):
                    whole[a, b] += w * J[a] * J[b]
        step = np.linalg.solve(whole, pull)
        pose += step
        if abs(step[0]) + abs(step[1]) + abs(step[2]) < 1e-5:
            break
    return whole
