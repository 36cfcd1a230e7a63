"""What a picture shows standing on the floor, before it is known what it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Region:
    """The circle around one thing's footprint.

    Attributes:
        centre: (2,), m, base frame (or the plane's own).
        diameter: m, of the smallest circle around the footprint.
        covariance: (2, 2), m^2, of the centre.
        nearest: m, from the point below the camera to what is nearest of it.
        outermost: m, from there to the floor behind it that is seen last, past its top; 0: not known.
        height: m above the floor; 0: not known.
        count: pixels.
        cut: the picture's border or the robot's own body hides part of it, so that the circle may be too small.
    """

    centre: Array
    diameter: float
    covariance: Array
    nearest: float
    outermost: float
    height: float
    count: int
    cut: bool


def along_and_across(towards: Array, along: float, across: float) -> Array:
    """Return the covariance, (2, 2), of what is seen in the direction `towards`, (2,), with such deviations, m."""
    e = towards / max(float(np.hypot(*towards)), 1e-9)
    n = np.array([-e[1], e[0]])
    return np.asarray(along**2 * np.outer(e, e) + across**2 * np.outer(n, n))
