"""The dipole field, a controller to compare with (Igarashi et al. 2010, in Sec. 6.3.3)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from services.geometry.angles import direction

Array = NDArray[np.float64]


def command(r: Array, o: Array, alpha: float, speed: float) -> Array:
    """Return u (2,), m/s, map frame: V (cos alpha, -sin alpha) in the push frame, whose x axis is r-o.

    Args:
        r, o: (2,), m, map frame.
        alpha: rad, orientation of the push-line in the push frame.
        speed: V, m/s.

    Raises:
        services.geometry.angles.DegenerateDirection: r and o coincide.
    """
    theta = direction(r, o) - alpha
    return speed * np.array((math.cos(theta), math.sin(theta)))
