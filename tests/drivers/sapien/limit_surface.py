"""Exact limit surfaces of uniform pressure, from the power that friction takes; nothing here is the code under test.

A body that turns about a point at distance d from its middle loses mu N omega D(d), with D the mean distance of its
area from that point. Friction is normal to the limit surface, so force and torque follow by differentiation:
f = mu N D'(d), torque = mu N (D(d) - d D'(d)).
"""

from __future__ import annotations

from itertools import pairwise
from math import cos, hypot, log, pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import dblquad, quad
from scipy.special import ellipe


def disc_distance(radius: float, d: float) -> float:
    """Mean distance of a disc's area from a point d from its centre: rings by an elliptic integral."""

    def ring(r: float) -> float:
        return float(2 / pi * (d + r) * ellipe(4 * d * r / (d + r) ** 2)) if d + r > 0 else 0.0

    inside = [d] if 0 < d < radius else None
    return float(quad(lambda r: 2 * r / radius**2 * ring(r), 0, radius, points=inside, epsabs=1e-12)[0])


def box_distance(length: float, width: float, d: float, direction: float) -> float:
    """Mean distance of a rectangle's area from a point at distance d and bearing `direction` from its centre."""
    px, py = d * cos(direction), d * sin(direction)
    total = 0.0
    xs = sorted({-length / 2, min(max(px, -length / 2), length / 2), length / 2})
    ys = sorted({-width / 2, min(max(py, -width / 2), width / 2), width / 2})
    for x0, x1 in pairwise(xs):
        for y0, y1 in pairwise(ys):
            total += dblquad(lambda y, x: hypot(x - px, y - py), x0, x1, y0, y1, epsabs=1e-9, epsrel=1e-8)[0]
    return total / (length * width)


def box_spin(length: float, width: float) -> float:
    """Pure-spin torque over mu N of a rectangle, closed form, m."""
    a, b = length / 2, width / 2
    d = sqrt(a * a + b * b)
    return d / 3 + a * a / (6 * b) * log((b + d) / a) + b * b / (6 * a) * log((a + d) / b)


def disc_spin(radius: float) -> float:
    """Pure-spin torque over mu N of a disc, closed form, m."""
    return 2 / 3 * radius


def disc_curve(radius: float, ratios: NDArray[np.float64]) -> NDArray[np.float64]:
    """(K, 2) force / (mu N) and torque / (2/3 R mu N) for turning about a point ratio * R away."""
    rows = []
    for d in ratios * radius:
        h = 1e-5 * radius
        slope = (disc_distance(radius, d + h) - disc_distance(radius, abs(d - h))) / (2 * h) if d > h else 0.0
        rows.append((slope, (disc_distance(radius, d) - d * slope) / disc_spin(radius)))
    return np.array(rows)
