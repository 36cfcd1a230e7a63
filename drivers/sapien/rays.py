"""Straight rays against boxes and discs in the plane."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from drivers.sapien.scene import Scene
from drivers.sapien.shapes import Disc, Shape, moved


@dataclass(frozen=True)
class Outlines:
    """Shapes as arrays, float64, C-contiguous, map frame.

    boxes: (N, 6) rows x, y, cos(yaw), sin(yaw), half length, half width. discs: (M, 3) rows x, y, radius. All m.
    """

    boxes: NDArray[np.float64]
    discs: NDArray[np.float64]

    def joined(self, other: Outlines) -> Outlines:
        """Return both together."""
        return Outlines(np.concatenate([self.boxes, other.boxes]), np.concatenate([self.discs, other.discs]))


def outlines(shapes: tuple[Shape, ...], pose: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Outlines:
    """Return `shapes`, given in a frame with `pose` (x, y, theta) in the map, in the map frame."""
    placed = [moved(shape, *pose) for shape in shapes]
    discs = [(one.x, one.y, one.radius) for one in placed if isinstance(one, Disc)]
    boxes = [
        (one.x, one.y, np.cos(one.yaw), np.sin(one.yaw), one.length / 2, one.width / 2)
        for one in placed
        if not isinstance(one, Disc)
    ]
    return Outlines(np.array(boxes, dtype=np.float64).reshape(-1, 6), np.array(discs, dtype=np.float64).reshape(-1, 3))


class Rooms:
    """The outlines of what stands in a scene, between its changes."""

    def __init__(self, scene: Scene) -> None:
        self._moments = scene.changes()
        self._outlines = [outlines(scene.obstacles(moment)) for moment in (0.0, *self._moments)]

    def at(self, time: float) -> Outlines:
        """Return what stands there at `time`, s since the world began."""
        return self._outlines[bisect_right(self._moments, time)]

    def around(self, time: float, parts: tuple[Shape, ...], pose: NDArray[np.float64]) -> Outlines:
        """Return what a sensor can meet: what stands there, and an object of these parts at `pose`, (3,), map frame."""
        x, y, theta = (float(number) for number in pose)
        return self.at(time).joined(outlines(parts, (x, y, theta)))


@njit("f8[::1](f8[:, ::1], f8[::1], f8, f8[:, ::1], f8[:, ::1])", cache=True)
def cast(
    origin: NDArray[np.float64],
    bearing: NDArray[np.float64],
    maximum: float,
    boxes: NDArray[np.float64],
    discs: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return how far each ray gets, (K,) m; `maximum` where it meets nothing nearer.

    origin: (K, 2), m; bearing: (K,), rad, both map frame. boxes, discs: of `Outlines`. A ray that starts
    inside a shape gets 0 m far.
    """
    found = np.empty(bearing.shape[0])
    for k in range(bearing.shape[0]):
        ox, oy = origin[k, 0], origin[k, 1]
        dx, dy = np.cos(bearing[k]), np.sin(bearing[k])
        best = maximum
        for i in range(discs.shape[0]):
            rx, ry, radius = ox - discs[i, 0], oy - discs[i, 1], discs[i, 2]
            b, c = rx * dx + ry * dy, rx * rx + ry * ry - radius * radius
            if c <= 0.0:
                best = 0.0
            elif b < 0.0 and b * b >= c:
                best = min(best, -b - np.sqrt(b * b - c))
        for i in range(boxes.shape[0]):
            rx, ry = ox - boxes[i, 0], oy - boxes[i, 1]
            c, s = boxes[i, 2], boxes[i, 3]
            near, far = 0.0, best
            for j in range(2):
                start = c * rx + s * ry if j == 0 else c * ry - s * rx
                slope = c * dx + s * dy if j == 0 else c * dy - s * dx
                half = boxes[i, 4 + j]
                if abs(slope) < 1e-15:
                    if abs(start) > half:
                        near = np.inf
                else:
                    one, two = (-half - start) / slope, (half - start) / slope
                    near, far = max(near, min(one, two)), min(far, max(one, two))
            if near <= far:
                best = min(best, near)
        found[k] = best
    return found
