"""A room as an occupancy grid."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, cos, sin

import numpy as np
from numpy.typing import NDArray

from drivers.sapien.scene import WALL, Scene
from drivers.sapien.shapes import Box, Disc, Shape

RESOLUTION = 0.05
"""Size of a cell, m (Sec. 6.1)."""

FREE, OCCUPIED = 0, 100
# Walls often stand exactly on cell borders; without slack rounding would decide whether a cell touches.
_SLACK = 1e-6


@dataclass(frozen=True)
class Grid:
    """A map of cells, row y first.

    cells: (H, W) uint8, 0 free, 100 occupied. origin: x, y of the outer corner of cell (0, 0), m.
    resolution: m a cell.
    """

    cells: NDArray[np.uint8]
    origin: tuple[float, float]
    resolution: float


def rasterise(scene: Scene, resolution: float = RESOLUTION, time: float = 0.0) -> Grid:
    """Return the grid of `scene`'s walls and furniture at `time`, s, without the object; it spans the outer walls.

    Conservative: a cell that an obstacle overlaps at all is occupied. A shared edge alone is no overlap.
    """
    bounds = scene.bounds
    margin = ceil(WALL / resolution - _SLACK) * resolution
    origin = (bounds.min_x - margin, bounds.min_y - margin)
    width = ceil((bounds.max_x + margin - origin[0]) / resolution - _SLACK)
    height = ceil((bounds.max_y + margin - origin[1]) / resolution - _SLACK)
    x = origin[0] + (np.arange(width, dtype=np.float64) + 0.5) * resolution
    y = origin[1] + (np.arange(height, dtype=np.float64) + 0.5) * resolution
    taken = np.zeros((height, width), dtype=np.bool_)
    for shape in scene.obstacles(time):
        taken |= _overlaps(shape, x[np.newaxis, :] - shape.x, y[:, np.newaxis] - shape.y, resolution / 2)
    return Grid(np.where(taken, np.uint8(OCCUPIED), np.uint8(FREE)), origin, resolution)


def _overlaps(shape: Shape, x: NDArray[np.float64], y: NDArray[np.float64], half: float) -> NDArray[np.bool_]:
    """Return whether cells with centre (x, y) from the shape's centre and half size `half` overlap `shape`."""
    if isinstance(shape, Disc):
        near_x, near_y = np.maximum(np.abs(x) - half, 0.0), np.maximum(np.abs(y) - half, 0.0)
        return np.asarray(near_x**2 + near_y**2 < (shape.radius - _SLACK) ** 2)
    return _overlaps_box(shape, x, y, half - _SLACK)


def _overlaps_box(box: Box, x: NDArray[np.float64], y: NDArray[np.float64], half: float) -> NDArray[np.bool_]:
    """Separating axes: two of the grid, two of the box."""
    c, s = cos(box.yaw), sin(box.yaw)
    a, b = box.length / 2, box.width / 2
    reach = half * (abs(c) + abs(s))
    return np.asarray(
        (np.abs(x) < half + a * abs(c) + b * abs(s))
        & (np.abs(y) < half + a * abs(s) + b * abs(c))
        & (np.abs(c * x + s * y) < a + reach)
        & (np.abs(c * y - s * x) < b + reach)
    )
