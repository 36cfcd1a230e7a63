"""Polylines in the plane: arc length, closest point, point at an arc length, resampling."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


class BadPath(ValueError):
    """A path is to have shape (N, 2) with N >= 2, finite, and its neighbouring points apart."""


@dataclass(frozen=True, slots=True)
class Closest:
    """The point of a path that is closest to another point."""

    index: int
    """of the segment's first point, 0..N-2"""
    fraction: float
    """of the segment, 0..1"""
    point: Array
    """(2,), m"""
    distance: float
    """m, from the other point"""
    arc: float
    """m along the path from its first point"""

    @classmethod
    def of(cls, found: tuple[int, float, float, float, float, float]) -> Closest:
        """Return what `closest_kernel` found."""
        index, fraction, x, y, distance, arc = found
        return cls(index, fraction, np.array((x, y)), distance, arc)


def check(path: Array) -> None:
    """Raise BadPath unless `path` is a usable polyline (N, 2), m."""
    if path.ndim != 2 or path.shape[1] != 2 or path.shape[0] < 2:
        raise BadPath(f"a path has shape (N, 2) with N >= 2, not {path.shape}")
    if not np.isfinite(path).all():
        raise BadPath("a path's points are to be finite")
    steps = np.hypot(*np.diff(path, axis=0).T)
    if (steps == 0.0).any():
        raise BadPath(f"points {int(np.argmin(steps))} and {int(np.argmin(steps)) + 1} of the path coincide")


def cumulative(path: Array) -> Array:
    """Return the arc length (N,), m, from the first point of `path` (N, 2) to each of its points."""
    arc = np.zeros(len(path))
    np.cumsum(np.hypot(*np.diff(path, axis=0).T), out=arc[1:])
    return arc


def closest(path: Array, point: Array, first: int = 0) -> Closest:
    """Return the point of `path[first:]` closest to `point` (2,). Of equals, the earliest."""
    anywhere = np.full(len(path), np.inf)
    return Closest.of(closest_kernel(path, anywhere, first, float(point[0]), float(point[1])))


def closest_in_sight(path: Array, reach: Array, point: Array, first: int = 0) -> Closest:
    """Return the point of `path[first:]` closest to `point` (2,), of those within their `reach` of it.

    With the clearances (N,), m, as reach no obstacle lies between: a wall between two branches of a path does
    not let the other branch come closer. Where none is within reach, the closest of all.
    """
    return Closest.of(closest_kernel(path, reach, first, float(point[0]), float(point[1])))


def at_arc(path: Array, arc: Array, length: float) -> Array:
    """Return the point (2,) of `path` at `length` m from its first point; the ends beyond them.

    Args:
        arc: cumulative(path), (N,), m.
    """
    x, y, _ = at_arc_kernel(path, arc, float(length))
    return np.array((x, y))


def resample(path: Array, spacing: float) -> Array:
    """Return `path` with points at equal arc distances of at most `spacing` m; first and last stay exact."""
    arc = cumulative(path)
    count = max(1, math.ceil(arc[-1] / spacing - 1e-9))
    lengths = np.linspace(0.0, arc[-1], count + 1)
    points = np.column_stack([np.interp(lengths, arc, path[:, k]) for k in range(2)])
    points[0], points[-1] = path[0], path[-1]
    return points


@njit("Tuple((i8,f8,f8,f8,f8,f8))(f8[:,::1],f8[::1],i8,f8,f8)", cache=True)
def closest_kernel(
    path: Array, reach: Array, first: int, x: float, y: float
) -> tuple[int, float, float, float, float, float]:
    """Return (index, fraction, x, y, distance, arc length from point 0) as `closest_in_sight` does."""
    first = min(first, len(path) - 2)
    best, best_seen = np.inf, False
    index, fraction, bx, by, barc = first, 0.0, path[first, 0], path[first, 1], 0.0
    arc = 0.0
    for i in range(len(path) - 1):
        ax, ay = path[i, 0], path[i, 1]
        ex, ey = path[i + 1, 0] - ax, path[i + 1, 1] - ay
        length = math.sqrt(ex * ex + ey * ey)
        if i >= first:
            t = 0.0
            if length > 0.0:
                t = ((x - ax) * ex + (y - ay) * ey) / (length * length)
            t = min(1.0, max(0.0, t))
            px, py = ax + t * ex, ay + t * ey
            d = math.sqrt((x - px) ** 2 + (y - py) ** 2)
            seen = d < max(reach[i], reach[i + 1])
            if (seen and not best_seen) or (seen == best_seen and d < best):
                best, best_seen = d, seen
                index, fraction, bx, by, barc = i, t, px, py, arc + t * length
        arc += length
    return index, fraction, bx, by, best, barc


@njit("Tuple((f8,f8,i8))(f8[:,::1],f8[::1],f8)", cache=True)
def at_arc_kernel(path: Array, arc: Array, length: float) -> tuple[float, float, int]:
    """Return (x, y, index of the point at or before it) of the point at arc length `length`."""
    n = len(arc)
    if length <= 0.0:
        return path[0, 0], path[0, 1], 0
    if length >= arc[n - 1]:
        return path[n - 1, 0], path[n - 1, 1], n - 1
    i = int(np.searchsorted(arc, length, side="right")) - 1
    t = (length - arc[i]) / (arc[i + 1] - arc[i])
    x = path[i, 0] + t * (path[i + 1, 0] - path[i, 0])
    y = path[i, 1] + t * (path[i + 1, 1] - path[i, 1])
    return x, y, i
