"""The corridor's signed depth (Definition 1): how far inside the union of its discs a point is.

    depth(x) = max over the points q of Q of W(q) - |x - q|

It is positive inside the corridor, 0 on its edge E, negative outside, and 1-Lipschitz: a point of depth D has
no edge within D. With W_p for W the object corridor E_o is where depth = (d_r + d_o)/2 (Definition 2).

Between the given points q_i the path is straight and W linear. With the discs at the q_i alone, 0.05 m apart,
the depth on the path would ripple by 0.025 m, which is as much as narrow passages have to spare; the edge
itself moves by less than 1 mm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from services.geometry.path import BadPath, check

Array = NDArray[np.float64]

RESOLUTION = 0.025
"""m, of the grid. Bilinear lookup is at most 13 mm below the depth on a ridge, within 2 mm beside it."""

_TILE = 8
_BLOCK = 32


@dataclass(frozen=True, slots=True)
class Field:
    """A grid of the depth with bilinear lookup.

    Beyond the grid the value is that of the grid's nearest point less the distance to it: a lower bound.
    """

    origin: Array
    """(2,), m, map frame, of values[0, 0]"""
    resolution: float
    """m"""
    values: Array
    """(H, W), m, row y first"""

    @classmethod
    def build(cls, path: Array, width: Array, resolution: float = RESOLUTION, margin: float = 0.5) -> Field:
        """Return the field of the corridor (`path` (N, 2), `width` (N,), m) with `margin` m around it.

        Raises:
            BadPath: the path or the widths cannot be used.
        """
        check(path)
        check_width(path, width)
        reach = np.maximum(width, 0.0)[:, None]
        low = (path - reach).min(axis=0) - margin
        high = (path + reach).max(axis=0) + margin
        nx, ny = (int(n) + 1 for n in np.ceil((high - low) / resolution))
        values = _fill(_segments(path, width), low[0], low[1], resolution, ny, nx)
        return cls(low, resolution, values)

    @property
    def grid(self) -> tuple[Array, float, float, float]:
        """Return the grid as kernels take it: values, x and y of values[0, 0], resolution."""
        return self.values, float(self.origin[0]), float(self.origin[1]), self.resolution

    def value(self, x: float, y: float) -> float:
        """Return the depth at (x, y), m."""
        return lookup(*self.grid, x, y)

    def gradient(self, x: float, y: float) -> tuple[float, float]:
        """Return the depth's gradient at (x, y), by central differences over one cell to each side.

        It points inward, has a norm of 1 beside the path where the widths are equal, and near 0 on the path.
        """
        return slope(*self.grid, x, y)

    def minimum_along(self, a: Array, b: Array) -> float:
        """Return the least depth on the segment from `a` to `b` ((2,), m), sampled at most a cell apart."""
        return minimum(*self.grid, a[0], a[1], b[0], b[1], -np.inf)


def depth(x: float, y: float, path: Array, width: Array) -> float:
    """Return the depth at (x, y) in the corridor (`path` (N, 2), `width` (N,), m), exact.

    Raises:
        BadPath: the path or the widths cannot be used.
    """
    check(path)
    check_width(path, width)
    return _deepest(_segments(path, width), x, y)


def check_width(path: Array, width: Array) -> None:
    """Raise BadPath unless `width` has one finite value for each point of `path`."""
    if width.shape != (len(path),) or not np.isfinite(width).all():
        raise BadPath(f"widths are to be {len(path)} finite values, one a point, not of shape {width.shape}")


@njit("f8[:,::1](f8[:,::1],f8[::1])", cache=True)
def _segments(path: Array, width: Array) -> Array:
    """Return (N - 1, 8): start, unit vector, length, width at the start, its slope, and the lead (below)."""
    n = len(path) - 1
    out = np.empty((n, 8))
    for i in range(n):
        ex, ey = path[i + 1, 0] - path[i, 0], path[i + 1, 1] - path[i, 1]
        length = math.sqrt(ex * ex + ey * ey)
        m = (width[i + 1] - width[i]) / length
        # A point at lateral distance d is deepest in the disc that lies d * lead ahead of its foot; where
        # the width changes faster than the path advances that is always the disc at one end.
        lead = m / math.sqrt(1.0 - m * m) if abs(m) < 1.0 else math.copysign(1e12, m)
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = path[i, 0], path[i, 1], ex / length, ey / length
        out[i, 4], out[i, 5], out[i, 6], out[i, 7] = length, width[i], m, lead
    return out


@njit("f8(f8[:,::1],i8,f8,f8)", cache=True)
def _depth_in(segments: Array, i: int, x: float, y: float) -> float:
    """Return the depth at (x, y) in the discs of segment `i`."""
    dx, dy = x - segments[i, 0], y - segments[i, 1]
    foot = dx * segments[i, 2] + dy * segments[i, 3]
    lateral = abs(dx * segments[i, 3] - dy * segments[i, 2])
    s = min(segments[i, 4], max(0.0, foot + lateral * segments[i, 7]))
    along = s - foot
    return segments[i, 5] + segments[i, 6] * s - math.sqrt(lateral * lateral + along * along)


@njit("f8(f8[:,::1],f8,f8)", cache=True)
def _deepest(segments: Array, x: float, y: float) -> float:
    best = -np.inf
    for i in range(len(segments)):
        best = max(best, _depth_in(segments, i, x, y))
    return best


@njit("i8(f8[:,::1],i8[::1],i8,f8,f8,f8,i8[::1])", cache=True)
def _candidates(
    segments: Array, known: NDArray[np.int64], count: int, x: float, y: float, radius: float,
    out: NDArray[np.int64],
) -> int:  # fmt: skip
    """Write to `out` those of known[:count] that can be deepest somewhere within `radius` of (x, y)."""
    values = np.empty(count)
    best = -np.inf
    for k in range(count):
        values[k] = _depth_in(segments, known[k], x, y)
        best = max(best, values[k])
    kept = 0
    for k in range(count):
        # Every segment's depth is 1-Lipschitz: a gap of more than 2 radius cannot close within radius.
        if values[k] >= best - 2.0 * radius:
            out[kept] = known[k]
            kept += 1
    return kept


@njit("void(f8[:,::1],f8[::1],f8,f8,f8,i8,i8,b1)", cache=True)
def _raise_tile(
    values: Array, segment: Array, x0: float, y0: float, resolution: float, j0: int, i0: int, fresh: bool
) -> None:
    """Raise the values of a tile to the depth in the discs of `segment`, or set them where `fresh`.

    The same arithmetic as `_depth_in`, with the segment in the outer loop: the inner one is vectorised.
    """
    ax, ay, ux, uy = segment[0], segment[1], segment[2], segment[3]
    length, width, m, lead = segment[4], segment[5], segment[6], segment[7]
    ny, nx = values.shape
    for j in range(j0, min(j0 + _TILE, ny)):
        dy = y0 + j * resolution - ay
        row = values[j, i0 : min(i0 + _TILE, nx)]
        for i in range(len(row)):
            dx = x0 + (i0 + i) * resolution - ax
            foot = dx * ux + dy * uy
            lateral = abs(dx * uy - dy * ux)
            s = min(length, max(0.0, foot + lateral * lead))
            along = s - foot
            d = width + m * s - math.sqrt(lateral * lateral + along * along)
            row[i] = d if fresh else max(row[i], d)


@njit("f8[:,::1](f8[:,::1],f8,f8,f8,i8,i8)", cache=True)
def _fill(segments: Array, x0: float, y0: float, resolution: float, ny: int, nx: int) -> Array:
    values = np.empty((ny, nx))
    n = len(segments)
    everything = np.arange(n)
    block, tile = np.empty(n, np.int64), np.empty(n, np.int64)
    half_block = 0.5 * (_BLOCK - 1) * resolution
    half_tile = 0.5 * (_TILE - 1) * resolution
    root2 = math.sqrt(2.0)
    for jb in range(0, ny, _BLOCK):
        for ib in range(0, nx, _BLOCK):
            bx, by = x0 + ib * resolution + half_block, y0 + jb * resolution + half_block
            in_block = _candidates(segments, everything, n, bx, by, half_block * root2, block)
            for jt in range(jb, min(jb + _BLOCK, ny), _TILE):
                for it in range(ib, min(ib + _BLOCK, nx), _TILE):
                    tx, ty = x0 + it * resolution + half_tile, y0 + jt * resolution + half_tile
                    in_tile = _candidates(segments, block, in_block, tx, ty, half_tile * root2, tile)
                    for k in range(in_tile):
                        _raise_tile(values, segments[tile[k]], x0, y0, resolution, jt, it, k == 0)
    return values


@njit("f8(f8[:,::1],f8,f8,f8,f8,f8)", cache=True)
def lookup(values: Array, x0: float, y0: float, resolution: float, x: float, y: float) -> float:
    """Return the value at (x, y), as `Field.value` does."""
    ny, nx = values.shape
    u, v = (x - x0) / resolution, (y - y0) / resolution
    uc, vc = min(max(u, 0.0), nx - 1.0), min(max(v, 0.0), ny - 1.0)
    i, j = min(int(uc), nx - 2), min(int(vc), ny - 2)
    a, b = uc - i, vc - j
    low = values[j, i] * (1.0 - a) + values[j, i + 1] * a
    high = values[j + 1, i] * (1.0 - a) + values[j + 1, i + 1] * a
    outside = math.sqrt((u - uc) ** 2 + (v - vc) ** 2) * resolution
    return low * (1.0 - b) + high * b - outside


@njit("UniTuple(f8,2)(f8[:,::1],f8,f8,f8,f8,f8)", cache=True)
def slope(values: Array, x0: float, y0: float, resolution: float, x: float, y: float) -> tuple[float, float]:
    """Return the gradient at (x, y), as `Field.gradient` does."""
    h = resolution
    gx = lookup(values, x0, y0, h, x + h, y) - lookup(values, x0, y0, h, x - h, y)
    gy = lookup(values, x0, y0, h, x, y + h) - lookup(values, x0, y0, h, x, y - h)
    return gx / (2.0 * h), gy / (2.0 * h)


@njit("f8(f8[:,::1],f8,f8,f8,f8,f8,f8,f8,f8)", cache=True)
def minimum(
    values: Array, x0: float, y0: float, resolution: float,
    ax: float, ay: float, bx: float, by: float, enough: float,
) -> float:  # fmt: skip
    """Return the least value on the segment, or the first found that is not above `enough`."""
    length = math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
    steps = max(1, math.ceil(length / resolution))
    least = np.inf
    for k in range(steps + 1):
        t = k / steps
        least = min(least, lookup(values, x0, y0, resolution, ax + t * (bx - ax), ay + t * (by - ay)))
        if least <= enough:
            break
    return least
