"""Centroid alignment, a controller to compare with (Hermans et al. 2013, in Sec. 6.3.3)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from services.geometry.angles import DegenerateDirection

Array = NDArray[np.float64]

GOAL_REACH = 0.2
"""m, greatest length of e_g."""


def command(
    r: Array, o: Array, t: Array, k_g: float = 0.2, k_c: float = 0.4, saturation: float = 0.2
) -> tuple[Array, bool]:
    """Return u = K_g e_g + K_c e_c (2,), m/s, map frame, and whether it was cut to `saturation` m/s.

    e_g leads from o to t, at most 0.2 m; e_c from r to its foot on the push-line, taken as an endless line.

    Args:
        r, o, t: (2,), m, map frame.
        k_g, k_c: 1/s.

    Raises:
        DegenerateDirection: o and t coincide.
    """
    line = t - o
    length = math.hypot(line[0], line[1])
    if length == 0.0:
        raise DegenerateDirection(f"no push-line from ({o[0]:g}, {o[1]:g}) to itself")
    unit = line / length
    e_g = unit * min(length, GOAL_REACH)
    offset = o - r
    e_c = offset - unit * float(offset @ unit)
    u = np.asarray(k_g * e_g + k_c * e_c)
    speed = math.hypot(u[0], u[1])
    if speed > saturation:
        return u * (saturation / speed), True
    return u, False
