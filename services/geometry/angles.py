"""Angles in radians, counter-clockwise, wrapped to (-pi, pi]. The skill wraps angles here and nowhere else."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray


class DegenerateDirection(ValueError):
    """Two points coincide, so that no direction leads from one to the other."""


def wrap(angle: float) -> float:
    """Return `angle` (rad, finite) wrapped to (-pi, pi]."""
    # The IEEE remainder is exact and lies in [-pi, pi].
    wrapped = math.remainder(angle, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


@njit("f8(f8)", cache=True)
def wrapped(angle: float) -> float:
    """Return `angle` (rad, finite) wrapped to [-pi, pi): `wrap` for kernels, for which there is no exact remainder."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def difference(a: float, b: float) -> float:
    """Return a - b (rad), wrapped to (-pi, pi]: the turn that leads from `b` to `a`."""
    return wrap(a - b)


def direction(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Return the orientation of the vector from `a` to `b` ((2,), m), rad in (-pi, pi].

    Raises:
        DegenerateDirection: `a` and `b` coincide.
    """
    dx, dy = float(b[0] - a[0]), float(b[1] - a[1])
    if dx == 0.0 and dy == 0.0:
        raise DegenerateDirection(f"no direction from ({a[0]:g}, {a[1]:g}) to itself")
    return wrap(math.atan2(dy, dx))
