"""A velocity barrier that keeps the robot's centre inside the pushing corridor. Not in the paper.

The paper's law bounds the object and the push-line, not the robot's way around the object; on that way the
robot left the corridor in most failures of a prototype. The barrier bounds the rate at which depth is lost.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from services.geometry.field import Field

Array = NDArray[np.float64]

_RIDGE = 0.2


def guard(field: Field, r: Array, u: Array, gain: float, margin: float, room: float = math.inf) -> tuple[Array, bool]:
    """Return `u`, changed as little as keeps its outward speed at most gain * (depth - margin), and whether
    it was changed.

    Where the depth is below the margin the outward speed is negative: the robot is driven inward, with at most
    |u|, which adds to what u has along the edge. On the ridge of the depth no direction is outward and u passes.

    Args:
        field: the depth of the pushing corridor.
        r: (2,), m, map frame.
        u: (2,), m/s, map frame.
        gain: 1/s.
        margin: m kept from the edge.
        room: m, half width of the corridor where the robot is. The margin is at most half of it: otherwise
            the robot could not pass where the corridor is narrower than its margins.
    """
    gx, gy = field.gradient(r[0], r[1])
    norm = math.hypot(gx, gy)
    if norm < _RIDGE:
        return u, False
    nx, ny = gx / norm, gy / norm
    outward = -(float(u[0]) * nx + float(u[1]) * ny)
    speed = math.hypot(u[0], u[1])
    kept = min(margin, 0.5 * max(room, 0.0))
    allowed = max(gain * (field.value(r[0], r[1]) - kept), -speed)
    if outward <= allowed:
        return u, False
    excess = outward - allowed
    return u + excess * np.array((nx, ny)), True
