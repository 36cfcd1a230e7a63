"""The map as a plan needs it: it reaches everywhere it has to, and says what nobody has seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from runtime.messages import OccupancyGrid
from services.corridor.clearance import FREE, UNKNOWN, Cells
from services.geometry.wire import vector

Array = NDArray[np.float64]

BEYOND = 2.0
"""m that a map is to reach beyond every place of a plan where what is unknown may be driven through"""


@dataclass(frozen=True)
class Chart:
    """A map.

    Attributes:
        cells: (H, W), uint8, row y first; 0 free, 100 occupied, 255 unknown.
        doubtful: (H, W), whether a cell is free for all that is known, and no more; None: unknown cells stay so.
        resolution: m per cell. origin: (2,), m, map frame, the outer corner of cell (0, 0).
    """

    cells: Cells
    doubtful: NDArray[np.bool_] | None
    resolution: float
    origin: Array

    @classmethod
    def of(cls, grid: OccupancyGrid, within: Array, unknown_is_free: bool) -> Chart:
        """Return the chart of a map.

        Args:
            within: (N, 2), m, map frame: places of the plan.
        """
        cells = np.frombuffer(grid.cells, np.uint8).reshape(grid.height, grid.width)
        origin = vector(grid.origin)
        if not unknown_is_free:
            return cls(cells, None, grid.resolution, origin)
        end = origin + grid.resolution * np.array((grid.width, grid.height))
        below = np.ceil(np.maximum(origin - within.min(axis=0) + BEYOND, 0.0) / grid.resolution).astype(int)
        above = np.ceil(np.maximum(within.max(axis=0) + BEYOND - end, 0.0) / grid.resolution).astype(int)
        whole = np.pad(cells, ((below[1], above[1]), (below[0], above[0])), constant_values=UNKNOWN)
        doubtful = whole == UNKNOWN
        whole[doubtful] = FREE
        return cls(whole, doubtful, grid.resolution, origin - grid.resolution * below)

    def doubts(self, path: Array) -> bool:
        """Return whether a path, (N, 2), m, map frame, leads through what nobody has seen."""
        if self.doubtful is None:
            return False
        at = np.floor((path - self.origin) / self.resolution).astype(int)
        inside = (at >= 0).all(axis=1) & (at[:, 0] < self.cells.shape[1]) & (at[:, 1] < self.cells.shape[0])
        return bool(self.doubtful[at[inside, 1], at[inside, 0]].any())


def apart(path: Array, other: Array) -> float:
    """Return how far the points of a path, (N, 2), are from those of another, (M, 2), m, at most."""
    off = np.hypot(path[:, None, 0] - other[None, :, 0], path[:, None, 1] - other[None, :, 1])
    return float(off.min(axis=1).max())
