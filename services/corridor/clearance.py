"""The clearance map: metres from a point to the nearest obstacle of an occupancy grid (C in Sec. 3).

Convention: an occupied cell is a full square, and an unknown cell, or anything beyond the grid, counts as
occupied. At the lattice points (cell corners, edge midpoints and centres) the clearance is the exact distance
to the nearest such square, 0 inside it. Between them it is bilinear: with cells of 0.05 m at most 0.5 mm too
much at clearances above 0.2 m, and up to 13 mm too little midway between obstacles.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from services.geometry.field import lookup

Array = NDArray[np.float64]
Cells = NDArray[np.uint8]

FREE, OCCUPIED, UNKNOWN = 0, 100, 255


class BadGrid(ValueError):
    """The occupancy grid has another shape, resolution or cell values than it may have."""


@dataclass(frozen=True, slots=True)
class Clearance:
    """Clearances on a lattice of half the grid's resolution."""

    origin: Array
    """(2,), m, map frame, of values[0, 0]: the outer corner of cell (0, 0)"""
    spacing: float
    """m between lattice points, half a cell"""
    values: Array
    """(2 H + 1, 2 W + 1), m, row y first"""

    def at(self, x: float, y: float) -> float:
        """Return the clearance at (x, y), m; negative by the distance to the map beyond the map."""
        return lookup(self.values, self.origin[0], self.origin[1], self.spacing, x, y)

    def along(self, path: Array) -> Array:
        """Return the clearances (N,), m, at the points of `path` (N, 2)."""
        return _at_points(self.values, self.origin[0], self.origin[1], self.spacing, path)


def measure(cells: Cells, resolution: float, origin: Array, discs: Array) -> Clearance:
    """Return the clearance map of an occupancy grid.

    Args:
        cells: (H, W) uint8, row y first; 0 free, 100 occupied, 255 unknown.
        resolution: m per cell.
        origin: (2,), m, map frame, the outer corner of cell (0, 0).
        discs: (K, 3) x, y, radius in m: cells with their centre inside one are not obstacles (the pushed
            object and the robot itself). A wall that reaches into a disc is cut there too.

    Raises:
        BadGrid: see the message.
    """
    if cells.ndim != 2 or cells.dtype != np.uint8 or cells.size == 0:
        raise BadGrid(f"a grid is a (H, W) array of uint8, not {cells.shape} of {cells.dtype}")
    if not (np.isfinite(resolution) and resolution > 0.0):
        raise BadGrid(f"a grid's resolution is to be positive, not {resolution:g} m")
    known = (cells == FREE) | (cells == OCCUPIED) | (cells == UNKNOWN)
    if not known.all():
        raise BadGrid(f"cells are 0, 100 or 255; found {int(cells[~known][0])}")
    occupied = cells != FREE
    _clear(occupied, resolution, origin, discs)
    ny, nx = occupied.shape
    # The nearest point of a square to a lattice point is itself a lattice point. So the distance
    # transform over the lattice, with every point of every occupied square marked, is exact.
    free = np.ones((2 * ny + 1, 2 * nx + 1), np.uint8)
    free[0, :] = free[-1, :] = free[:, 0] = free[:, -1] = 0
    taken = ~occupied
    for j in range(3):
        for i in range(3):
            free[j : j + 2 * ny - 1 : 2, i : i + 2 * nx - 1 : 2] &= taken
    # OpenCV's result is the correctly rounded float32 of the root of an integer: round back to it.
    squares = np.rint(np.square(cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE), dtype=np.float64))
    return Clearance(np.asarray(origin, np.float64), 0.5 * resolution, np.sqrt(squares) * (0.5 * resolution))


def _clear(occupied: NDArray[np.bool_], resolution: float, origin: Array, discs: Array) -> None:
    """Mark the cells with their centre in one of `discs` as free."""
    ny, nx = occupied.shape
    for x, y, radius in discs:
        i0 = max(0, int(np.floor((x - radius - origin[0]) / resolution)))
        j0 = max(0, int(np.floor((y - radius - origin[1]) / resolution)))
        i1 = min(nx, int(np.ceil((x + radius - origin[0]) / resolution)) + 1)
        j1 = min(ny, int(np.ceil((y + radius - origin[1]) / resolution)) + 1)
        if i0 >= i1 or j0 >= j1:
            continue
        cx = origin[0] + (np.arange(i0, i1) + 0.5) * resolution - x
        cy = origin[1] + (np.arange(j0, j1) + 0.5) * resolution - y
        occupied[j0:j1, i0:i1] &= cx[None, :] ** 2 + cy[:, None] ** 2 > radius * radius


@njit("f8[::1](f8[:,::1],f8,f8,f8,f8[:,::1])", cache=True)
def _at_points(values: Array, x0: float, y0: float, spacing: float, points: Array) -> Array:
    out = np.empty(len(points))
    for k in range(len(points)):
        out[k] = lookup(values, x0, y0, spacing, points[k, 0], points[k, 1])
    return out
