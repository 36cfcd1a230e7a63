"""Turns the robot towards the object, so that the camera keeps it in view: a PD controller (Sec. 6.1)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.geometry.angles import difference, direction

Array = NDArray[np.float64]

_LEGS = (0.25 * math.pi, 0.25 * math.pi, 0.5 * math.pi, 0.5 * math.pi)
"""rad to either side, one after the other"""
STALE = 0.5
"""s after which the error before says nothing about its rate."""


@dataclass(slots=True)
class HeadingState:
    """The error before, for its rate."""

    time: float = 0.0
    """s"""
    error: float = 0.0
    """rad"""
    known: bool = False


def turn(
    state: HeadingState, time: float, r: Array, theta: float, o: Array, p: float, d: float, limit: float
) -> tuple[float, bool]:
    """Return omega, rad/s, and whether it was cut to `limit`.

    Args:
        state: is changed.
        time: s.
        r, o: (2,), m, map frame.
        theta: rad, map frame, the robot's orientation.
        p: 1/s.
        d: gain on the error's rate. The error falls by what the robot turns, so `d` acts on the last omega:
            stable for d < 1 only.
        limit: rad/s.

    Raises:
        services.geometry.angles.DegenerateDirection: r and o coincide.
    """
    error = difference(direction(r, o), theta)
    elapsed = time - state.time
    rate = 0.0
    if state.known and 0.0 < elapsed <= STALE:
        rate = difference(error, state.error) / elapsed
    state.time, state.error, state.known = time, error, True
    omega = p * error + d * rate
    if abs(omega) > limit:
        return (limit if omega > 0.0 else -limit), True
    return omega, False


def sweep(time: float, rate: float) -> float:
    """Return how far to look aside, rad, after `time` s of looking for something: to both sides, ever farther.

    Triangles whose legs are run through at `rate`, rad/s; after a quarter turn to each side, all around.
    """
    way, side = rate * time, 1.0
    for leg in (*_LEGS, math.inf):
        if way <= leg:
            return side * way
        if way <= 2.0 * leg:
            return side * (2.0 * leg - way)
        way -= 2.0 * leg
        side = -side
    return 0.0
