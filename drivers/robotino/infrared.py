"""The nine infra-red distance sensors: where they look, and the manufacturer's table from volts to metres."""

from __future__ import annotations

from math import pi

import numpy as np

COUNT = 9
NEAREST, FARTHEST = 0.04, 0.41
"""m from the sensor; the last stands for nothing seen"""
RING_RADIUS = 0.225
"""m (reference 3.4)"""

# Reference 3.4: DistanceSensorImpl of the manufacturer's host library, linear between the points.
_VOLTS = (0.30, 0.39, 0.41, 0.50, 0.75, 0.80, 0.95, 1.05, 1.30, 1.40, 1.55, 1.80, 2.35, 2.55)
_METRES = (0.41, 0.35, 0.30, 0.25, 0.18, 0.16, 0.14, 0.12, 0.10, 0.09, 0.08, 0.07, 0.05, 0.04)


def bearings() -> list[float]:
    """Return where the sensors look, rad in (-pi, pi], base frame: the first ahead, then counter-clockwise."""
    angles = [2.0 * pi * index / COUNT for index in range(COUNT)]
    return [angle - 2.0 * pi if angle > pi else angle for angle in angles]


def metres(volts: float) -> float:
    """Return the distance, m, that a sensor means by so many volts."""
    return float(np.interp(volts, _VOLTS, _METRES))


def volts(distance: float) -> float:
    """Return what a sensor gives at so many metres; the inverse of `metres` in its range."""
    return float(np.interp(distance, _METRES[::-1], _VOLTS[::-1]))
