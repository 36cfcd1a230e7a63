"""The smallest circle around points, whose diameter is the paper's d_o."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SLACK = 1e-12


@njit("b1(f8,f8,f8,f8[:,::1],i8)", cache=True)
def _holds(x: float, y: float, radius: float, points: Array, count: int) -> bool:
    for k in range(count):  # noqa: SIM110 - numba has no generators here
        if math.hypot(points[k, 0] - x, points[k, 1] - y) > radius * (1.0 + 1e-9) + _SLACK:
            return False
    return True


@njit("f8(f8[:,::1],i8,f8[::1],f8[:,::1])", cache=True)
def _around_few(few: Array, count: int, circle: Array, support: Array) -> float:
    """Return the radius of the smallest circle around the first `count` of `few`, at most 4.

    It rests on two or three of them, so all such circles are tried. `circle`, (4,), gets its centre, its radius and
    how many points it rests on; `support`, (3, 2), gets these.
    """
    best = np.inf
    for i in range(count):
        for j in range(i + 1, count):
            x, y = (few[i, 0] + few[j, 0]) / 2.0, (few[i, 1] + few[j, 1]) / 2.0
            radius = math.hypot(few[i, 0] - x, few[i, 1] - y)
            if radius < best and _holds(x, y, radius, few, count):
                best = radius
                circle[0], circle[1], circle[2], circle[3] = x, y, radius, 2.0
                support[0], support[1] = few[i], few[j]
    for i in range(count):
        for j in range(i + 1, count):
            for k in range(j + 1, count):
                bx, by = few[j, 0] - few[i, 0], few[j, 1] - few[i, 1]
                cx, cy = few[k, 0] - few[i, 0], few[k, 1] - few[i, 1]
                area = 2.0 * (bx * cy - by * cx)
                if area == 0.0:
                    continue
                b, c = bx * bx + by * by, cx * cx + cy * cy
                ux, uy = (cy * b - by * c) / area, (bx * c - cx * b) / area
                x, y, radius = few[i, 0] + ux, few[i, 1] + uy, math.hypot(ux, uy)
                if radius < best and _holds(x, y, radius, few, count):
                    best = radius
                    circle[0], circle[1], circle[2], circle[3] = x, y, radius, 3.0
                    support[0], support[1], support[2] = few[i], few[j], few[k]
    return best


@njit("f8[::1](f8[:,::1])", cache=True)
def _smallest(points: Array) -> Array:
    circle = np.zeros(4)
    circle[0], circle[1], circle[2], circle[3] = points[0, 0], points[0, 1], 0.0, 1.0
    few, support = np.zeros((4, 2)), np.zeros((3, 2))
    support[0] = points[0]
    trial = np.zeros(4)
    while True:
        farthest, most = 0, -1.0
        for k in range(len(points)):
            far = math.hypot(points[k, 0] - circle[0], points[k, 1] - circle[1])
            if far > most:
                farthest, most = k, far
        if most <= circle[2] * (1.0 + 1e-12) + _SLACK:
            return circle
        count = int(circle[3])
        few[:count] = support[:count]
        few[count] = points[farthest]
        # Rounding could go in rounds with the same few points for ever, or leave no circle: the radius has to grow.
        radius = _around_few(few, count + 1, trial, support)
        if not circle[2] < radius < np.inf:
            circle[2] = most
            return circle
        circle[:] = trial


def smallest_circle(points: Array) -> tuple[Array, float]:
    """Return centre, (2,), and diameter of the smallest circle around points, (N, 2), N >= 1, m.

    The farthest point is taken in until none is outside: each circle is the smallest around at most four points and
    larger than the one before. OpenCV's minEnclosingCircle works with float32 and a slack: for 50 points over half a
    metre its centre was up to 2.7 mm off.

    Raises:
        ValueError: there are no points.
    """
    if not len(points):
        raise ValueError("no points to put a circle around")
    circle = _smallest(np.ascontiguousarray(points, np.float64))
    return circle[:2].copy(), float(2.0 * circle[2])
