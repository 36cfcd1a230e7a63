"""Grid maps of many particles that share what is equal in them.

A map is a grid of references to tiles. Particles that come from one refer to the same tiles; a tile is copied when one
of them draws on it while others hold it (as GMapping does, Grisetti et al. 2007, Sec. V). A cell knows how often beams
ended in it and passed it, and the mean of where they ended, which is finer than the cell.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Tiles = NDArray[np.float32]
Indices = NDArray[np.int32]

RESOLUTION = 0.05
"""m"""
SIDE = 32
"""cells along each side of a tile"""
HITS, VISITS, MEAN_X, MEAN_Y, ENDS, CELL = range(6)
"""Places in a cell: scans that ended in it; scans that ended in it or passed it; mean of the ends of all their beams,
m, map frame, and how many these were."""
OCCUPIED = 0.25
"""Share of hits from which on a cell is occupied. Beams graze what stands: less than half of them end in it."""
FREE, PASSED, HIT = 0, 1, 2

_ENDS = 1e5
"""ends that a mean remembers: float32 counts no further"""
_GROWTH = 8
_AT_FIRST = 64


def off_cells(corner: Array) -> Array:
    """Return what a corner, (2,), m, is off whole cells from the origin, where maps count theirs from."""
    return np.asarray(corner - np.rint(corner / RESOLUTION) * RESOLUTION)


def hollow(shown: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the map, (H, W), with what is occupied unknown where no free cell is beside it."""
    near_free = cv2.dilate((shown == 0).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return np.where((shown == 100) & ~near_free, np.uint8(255), shown)


@dataclass
class Maps:
    """The maps of P particles.

    Attributes:
        cells: (T, SIDE, SIDE, CELL), the tiles.
        owners: (T,), how often each is referred to; 0: it can be had.
        index: (P, H, W), the tile at each place, row y first; -1: nothing is known there.
        corner: (2,), tiles from the map's origin to index[:, 0, 0], (x, y).
    """

    cells: Tiles = field(default_factory=lambda: np.zeros((_AT_FIRST, SIDE, SIDE, CELL), np.float32))
    owners: Indices = field(default_factory=lambda: np.zeros(_AT_FIRST, np.int32))
    index: Indices = field(default_factory=lambda: np.full((1, _GROWTH, _GROWTH), -1, np.int32))
    corner: list[int] = field(default_factory=lambda: [-_GROWTH // 2, -_GROWTH // 2])

    @classmethod
    def of(cls, particles: int) -> Maps:
        """Return empty maps of so many particles."""
        return cls(index=np.full((particles, _GROWTH, _GROWTH), -1, np.int32))

    @classmethod
    def known(cls, shown: NDArray[np.uint8], corner: Array, particles: int, surfaces: bool = False) -> Maps:
        """Return one map for all particles, which they share.

        Args:
            shown: (H, W), row y first, 0 free, 100 occupied, 255 unknown; corner: (2,), m, whole cells from the origin.
            surfaces: keep of what is occupied only what a beam can meet, as if it had been drawn by beams. Scans settle
                on lines of cells; on a thick wall they find none, and lie anywhere within it.
        """
        maps = cls.of(particles)
        shown = hollow(shown) if surfaces else shown
        low = np.floor(corner / RESOLUTION + 0.5).astype(int)
        first = np.floor_divide(low, SIDE)
        skip = low - first * SIDE
        h, w = (-(-(n + s) // SIDE) for n, s in zip(shown.shape, skip[::-1], strict=True))
        whole = np.full((h * SIDE, w * SIDE), 255, np.uint8)
        whole[skip[1] : skip[1] + shown.shape[0], skip[0] : skip[0] + shown.shape[1]] = shown
        seen, occupied = whole != 255, whole == 100
        cells = np.zeros((h * SIDE, w * SIDE, CELL), np.float32)
        cells[..., VISITS], cells[..., HITS], cells[..., ENDS] = seen, occupied, occupied
        middle = (np.arange(max(h, w) * SIDE) + 0.5) * RESOLUTION
        cells[..., MEAN_X] = middle[None, : w * SIDE] + first[0] * SIDE * RESOLUTION
        cells[..., MEAN_Y] = middle[: h * SIDE, None] + first[1] * SIDE * RESOLUTION
        tiles = cells.reshape(h, SIDE, w, SIDE, CELL).transpose(0, 2, 1, 3, 4).reshape(-1, SIDE, SIDE, CELL)
        maps.cells = np.ascontiguousarray(tiles)
        maps.index = np.tile(np.arange(h * w, dtype=np.int32).reshape(1, h, w), (particles, 1, 1))
        maps.owners = np.full(h * w, particles, np.int32)
        maps.corner = [int(first[0]), int(first[1])]
        return maps

    def cover(self, low: Array, high: Array) -> None:
        """Make sure that from `low` to `high`, (2,), m, there are places for tiles."""
        first = np.floor(low / (RESOLUTION * SIDE)).astype(int) - self.corner
        last = np.floor(high / (RESOLUTION * SIDE)).astype(int) - self.corner
        h, w = self.index.shape[1:]
        # (left, right) and (below, above), in steps: growing copies everything.
        pads = [
            [-(-max(0, -int(f)) // _GROWTH) * _GROWTH, -(-max(0, int(b) - n + 1) // _GROWTH) * _GROWTH]
            for f, b, n in ((first[0], last[0], w), (first[1], last[1], h))
        ]
        if any(map(any, pads)):
            self.index = np.pad(self.index, ((0, 0), tuple(pads[1]), tuple(pads[0])), constant_values=-1)
            self.corner = [self.corner[0] - pads[0][0], self.corner[1] - pads[1][0]]

    def draw(
        self, particle: int, pose: Array, ends: Array, returned: NDArray[np.bool_], start: Array, cap: float
    ) -> None:
        """Draw a scan on a particle's map.

        Args:
            pose: (3,), m and rad, of the base on the map.
            ends: (N, 2), m, base frame, of the beams; returned: (N,), whether something is there.
            start: (2,) or (N, 2), m, base frame: the sensor, or where each beam begins to be seen.
            cap: visits that a cell remembers at most: what came before fades.
        """
        if not len(ends):
            return
        c, s = np.cos(pose[2]), np.sin(pose[2])
        turned = np.array([[c, s], [-s, c]])
        there = ends @ turned + pose[:2]
        starts = np.array(np.broadcast_to(start @ turned + pose[:2], there.shape), order="C")
        low = np.minimum(there.min(axis=0), starts.min(axis=0)) - 2 * RESOLUTION
        high = np.maximum(there.max(axis=0), starts.max(axis=0)) + 2 * RESOLUTION
        self.cover(low, high)
        span = np.ceil((high - low) / (RESOLUTION * SIDE)).astype(int) + 1
        missing = int(span.prod()) - int((self.owners == 0).sum())
        if missing > 0:
            more = max(missing, len(self.owners) // 2)
            self.cells = np.concatenate([self.cells, np.zeros((more, SIDE, SIDE, CELL), np.float32)])
            self.owners = np.concatenate([self.owners, np.zeros(more, np.int32)])
        _draw(self.cells, self.owners, self.index[particle], *self.corner, there, returned, starts, cap)

    def wipe(self, particle: int, centre: Array, radius: float) -> None:
        """Forget what stands within `radius` m of `centre`, (2,), m, on the map of a particle that shares no tiles."""
        reach = np.arange(-radius, radius + RESOLUTION, RESOLUTION)
        x, y = (grid.ravel() for grid in np.meshgrid(centre[0] + reach, centre[1] + reach))
        i, j = (np.floor(one / RESOLUTION).astype(int) for one in (x, y))
        middle_x, middle_y = (i + 0.5) * RESOLUTION - centre[0], (j + 0.5) * RESOLUTION - centre[1]
        i, j = i - self.corner[0] * SIDE, j - self.corner[1] * SIDE
        h, w = self.index.shape[1:]
        inside = (np.hypot(middle_x, middle_y) <= radius) & (i >= 0) & (j >= 0) & (i < w * SIDE) & (j < h * SIDE)
        for u, v in zip(i[inside], j[inside], strict=True):
            tile = self.index[particle, v // SIDE, u // SIDE]
            if tile >= 0:
                self.cells[tile, v % SIDE, u % SIDE, [HITS, ENDS]] = 0.0

    def stands(self, particle: int, places: Array, within: int) -> NDArray[np.bool_]:
        """Return whether a cell at most `within` cells from each place, (N, 2), m, map frame, is occupied, (N,)."""
        at = np.floor(places / RESOLUTION).astype(np.int64) - np.array(self.corner) * SIDE
        return _stands(self.cells, self.index[particle], at, within)

    def take(self, chosen: NDArray[np.int64]) -> None:
        """Replace the particles' maps by those of the particles `chosen`, (P,)."""
        self.index = self.index[chosen]
        used = self.index[self.index >= 0]
        self.owners = np.bincount(used, minlength=len(self.owners)).astype(np.int32)

    def compact(self) -> None:
        """Leave out tiles that nobody refers to."""
        used = np.flatnonzero(self.owners > 0)
        places = np.full(len(self.owners) + 1, -1, np.int32)
        places[used] = np.arange(len(used), dtype=np.int32)
        self.cells, self.owners = np.ascontiguousarray(self.cells[used]), self.owners[used]
        self.index = places[self.index]

    def picture(
        self, particle: int, centre: Array | None = None, reach: float = 0.0
    ) -> tuple[NDArray[np.uint8], Array]:
        """Return a particle's map: (H, W), row y first, 0 free to 100 occupied, 255 unknown; its corner, (2,), m.

        Args:
            centre, reach: (2,) and m: only the tiles within `reach` of there; None: all.
        """
        index, corner = self.index[particle], np.array(self.corner)
        if centre is not None:
            size = np.array(index.shape[::-1])
            low, high = (np.floor((centre + sign * reach) / (RESOLUTION * SIDE)).astype(int) for sign in (-1, 1))
            first, last = np.clip(low - corner, 0, size - 1), np.clip(high - corner, 0, size - 1)
            index, corner = index[first[1] : last[1] + 1, first[0] : last[0] + 1], corner + first
        h, w = index.shape
        shown = np.full((h, SIDE, w, SIDE), 255, np.uint8)
        for v, u in zip(*np.nonzero(index >= 0), strict=True):
            cells = self.cells[index[v, u]]
            seen = cells[..., VISITS] > 0.0
            occupied = cells[..., HITS] >= OCCUPIED * cells[..., VISITS]
            shown[v, :, u, :] = np.where(seen, np.where(occupied, 100, 0), 255)
        return shown.reshape(h * SIDE, w * SIDE), corner * (SIDE * RESOLUTION)


@njit("b1[::1](f4[:,:,:,::1],i4[:,::1],i8[:,::1],i8)", cache=True)
def _stands(cells: Tiles, index: Indices, places: NDArray[np.int64], within: int) -> NDArray[np.bool_]:
    found = np.zeros(len(places), np.bool_)
    for k in range(len(places)):
        for j in range(max(places[k, 1] - within, 0), min(places[k, 1] + within + 1, len(index) * SIDE)):
            for i in range(max(places[k, 0] - within, 0), min(places[k, 0] + within + 1, len(index[0]) * SIDE)):
                tile = index[j // SIDE, i // SIDE]
                if tile >= 0:
                    cell = cells[tile, j % SIDE, i % SIDE]
                    found[k] |= cell[HITS] > 0.0 and cell[HITS] >= OCCUPIED * cell[VISITS]
    return found


@njit("i8(i4[::1],i8)", cache=True)
def _free(owners: Indices, first: int) -> int:
    while owners[first] != 0:
        first += 1
    return first


@njit("u1[:,::1](f8[:,::1],b1[::1],f8[:,::1],i8,i8,i8,i8)", cache=True)
def _touched(
    ends: Array, returned: NDArray[np.bool_], starts: Array, low_i: int, high_i: int, low_j: int, high_j: int
) -> NDArray[np.uint8]:
    """Return which cells beams touch, (high_j - low_j + 1, high_i - low_i + 1): FREE, PASSED or HIT.

    Args:
        ends, starts: (N, 2), in cells; within the bounds.
    """
    touched = np.zeros((high_j - low_j + 1, high_i - low_i + 1), np.uint8)
    for k in range(len(ends)):
        # From cell to cell along the beam (Amanatides and Woo 1987).
        sx, sy = starts[k, 0], starts[k, 1]
        i, j, last_i, last_j = int(sx), int(sy), int(ends[k, 0]), int(ends[k, 1])
        dx, dy = ends[k, 0] - sx, ends[k, 1] - sy
        step_i, step_j = 1 if dx > 0 else -1, 1 if dy > 0 else -1
        next_x = ((i + (dx > 0)) - sx) / dx if dx != 0.0 else np.inf
        next_y = ((j + (dy > 0)) - sy) / dy if dy != 0.0 else np.inf
        each_x, each_y = abs(1.0 / dx) if dx != 0.0 else np.inf, abs(1.0 / dy) if dy != 0.0 else np.inf
        while i != last_i or j != last_j:
            if touched[j - low_j, i - low_i] == FREE:
                touched[j - low_j, i - low_i] = PASSED
            # Rounding must not lead past the last row or column.
            if (next_x < next_y and i != last_i) or j == last_j:
                i += step_i
                next_x += each_x
            else:
                j += step_j
                next_y += each_y
        if returned[k]:
            touched[last_j - low_j, last_i - low_i] = HIT
        elif touched[last_j - low_j, last_i - low_i] == FREE:
            touched[last_j - low_j, last_i - low_i] = PASSED
    return touched


@njit("void(f4[:,:,:,::1],i4[::1],i4[:,::1],i8,i8,f8[:,::1],b1[::1],f8[:,::1],f8)", cache=True)
def _draw(
    cells: Tiles, owners: Indices, index: Indices, corner_x: int, corner_y: int,
    ends: Array, returned: NDArray[np.bool_], starts: Array, cap: float,
) -> None:  # fmt: skip
    """Draw beams, once for each cell that they touch; where some end and others pass, they end."""
    x0, y0 = corner_x * SIDE * RESOLUTION, corner_y * SIDE * RESOLUTION
    scaled, begun = np.empty_like(ends), np.empty_like(ends)
    for k in range(len(ends)):
        scaled[k, 0], scaled[k, 1] = (ends[k, 0] - x0) / RESOLUTION, (ends[k, 1] - y0) / RESOLUTION
        begun[k, 0], begun[k, 1] = (starts[k, 0] - x0) / RESOLUTION, (starts[k, 1] - y0) / RESOLUTION
    low_i = int(min(scaled[:, 0].min(), begun[:, 0].min()))
    high_i = int(max(scaled[:, 0].max(), begun[:, 0].max()))
    low_j = int(min(scaled[:, 1].min(), begun[:, 1].min()))
    high_j = int(max(scaled[:, 1].max(), begun[:, 1].max()))
    touched = _touched(scaled, returned, begun, low_i, high_i, low_j, high_j)
    free = 0
    for j in range(len(touched)):
        for i in range(len(touched[0])):
            if touched[j, i] == FREE:
                continue
            v, u = (j + low_j) // SIDE, (i + low_i) // SIDE
            tile = index[v, u]
            if tile < 0 or owners[tile] > 1:
                free = _free(owners, free)
                if tile < 0:
                    cells[free] = 0.0
                else:
                    cells[free] = cells[tile]
                    owners[tile] -= 1
                owners[free] = 1
                index[v, u] = tile = free
            cell = cells[tile, (j + low_j) % SIDE, (i + low_i) % SIDE]
            if cell[VISITS] >= cap:
                cell[HITS] *= (cap - 1.0) / cell[VISITS]
                cell[VISITS] = cap - 1.0
            cell[VISITS] += 1.0
            if touched[j, i] == HIT:
                cell[HITS] += 1.0
            elif cell[HITS] < OCCUPIED * cell[VISITS]:
                cell[ENDS] = 0.0  # what stood here is gone
    for k in range(len(ends)):
        if not returned[k]:
            continue
        i, j = int(scaled[k, 0]), int(scaled[k, 1])
        cell = cells[index[j // SIDE, i // SIDE], j % SIDE, i % SIDE]
        # The means do not fade: else the map would creep after the errors of the poses that it gave.
        cell[ENDS] = min(cell[ENDS], _ENDS) + 1.0
        share = 1.0 / cell[ENDS]
        cell[MEAN_X] += share * (ends[k, 0] - cell[MEAN_X])
        cell[MEAN_Y] += share * (ends[k, 1] - cell[MEAN_Y])
