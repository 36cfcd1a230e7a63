"""Fits a response to windows of the past: what the model makes of them, and a search for what explains them best.

All in m, s, rad; windows as in `experience`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from services.geometry.angles import wrapped
from services.predictive.model import (
    ANISOTROPY,
    AXIS,
    CENTRE_X,
    CENTRE_Y,
    COASTING,
    FRICTION,
    LENGTH,
    OMEGA,
    RVX,
    RVY,
    RX,
    RY,
    STATE,
    TURN,
    VX,
    VY,
    YAW,
    X,
    Y,
    answer,
)

Array = NDArray[np.float64]

STEP = 0.05
"""s between the observations of a window"""
OFF_CONTOUR = 0.05
"""m that the contour may be off where they touch"""

_NOISE = 0.006
_ROBUST = 4.0
_SEEN, _THOUGHT = 0.07, 0.2
"""rad, deviations of a yaw that was seen, and of one that was not"""
_TOGETHER = 20
"""windows through which a response that was not seen to turn anything is followed from one to the next"""


@njit("UniTuple(f8,3)(f8[::1],f8[:,::1],f8[::1],f8,f8,f8[::1],f8[::1],f8[:])", cache=True)
def carry(
    response: Array, robots: Array, start: Array, yaw: float, beyond: float, base: Array, contour: Array, yaws: Array
) -> tuple[float, float, float]:
    """Return the object's pose at the end of a window that begins with `yaw`.

    Args:
        beyond: m, how far beyond the contour they touched.
        yaws: (SAMPLES,), where yaw at each observation is written to; (0,): it is not wanted.
    """
    state = np.zeros(STATE)
    state[X], state[Y], state[YAW] = start[0], start[1], yaw
    state[VX], state[VY], state[OMEGA] = start[3], start[4], start[5]
    contour = contour.copy()
    contour += beyond
    if len(yaws):
        yaws[0] = yaw
    for k in range(1, len(robots)):
        state[RX], state[RY] = robots[k, 0], robots[k, 1]
        before = max(k - 2, 0)
        after = min(k + 1, len(robots) - 1)
        duration = (after - before) * STEP
        state[RVX] = (robots[after, 0] - robots[before, 0]) / duration
        state[RVY] = (robots[after, 1] - robots[before, 1]) / duration
        state[TURN] = robots[k, 2]
        answer(state, STEP, base, contour, response)
        if len(yaws):
            yaws[k] = state[YAW]
    return state[X], state[Y], state[YAW]


@njit("f8[::1](f8[::1],f8[:,::1],f8[::1],f8[::1],f8[::1])", cache=True)
def carried(response: Array, robots: Array, start: Array, base: Array, contour: Array) -> Array:
    """Return the object's pose, (3,), at the end of a window as `response` has it."""
    x, y, yaw = carry(response, robots, start, start[2], start[6], base, contour, np.empty(0))
    return np.array([x, y, yaw])


@njit("UniTuple(f8,2)(f8[::1],f8[:,::1],f8[::1],f8[::1],f8[::1],f8[::1])", cache=True)
def _miss(response: Array, robots: Array, start: Array, end: Array, base: Array, contour: Array) -> tuple[float, float]:
    """Return how far, m, and rad, the object is predicted off the end of a window."""
    pose = carried(response, robots, start, base, contour)
    dx, dy = pose[0] - end[0], pose[1] - end[1]
    return math.sqrt(dx * dx + dy * dy), abs(wrapped(pose[2] - end[2]))


@njit("f8(f8[::1],f8[:,:,::1],f8[:,::1],f8[:,::1],f8[::1],f8[::1])", cache=True)
def median_error(response: Array, robots: Array, starts: Array, ends: Array, base: Array, contour: Array) -> float:
    """Return the median distance, m, between where windows ended and where `response` says that they would."""
    misses = np.empty(len(ends))
    for i in range(len(ends)):
        misses[i] = _miss(response, robots[i], starts[i], ends[i], base, contour)[0]
    return float(np.median(misses))


@njit("f8(f8[::1],f8[::1],f8)", cache=True)
def _unlikely(response: Array, prior: Array, trust: float) -> float:
    """Return what a response costs before anything is seen."""
    # Anisotropy and twice its axis are a vector's length and angle.
    a, b = response[ANISOTROPY] / 1.2, prior[ANISOTROPY] / 1.2
    total = trust * (a * a + b * b - 2.0 * a * b * math.cos(2.0 * (response[AXIS] - prior[AXIS])))
    x, y = (response[CENTRE_X] - prior[CENTRE_X]) / 0.03, (response[CENTRE_Y] - prior[CENTRE_Y]) / 0.03
    total += trust * (x * x + y * y)
    total += trust * (math.log(response[LENGTH] / prior[LENGTH]) / 0.3) ** 2
    total += trust * (math.log(response[FRICTION] / prior[FRICTION]) / 0.5) ** 2
    return total + trust * (math.log(response[COASTING] / prior[COASTING]) / 1.5) ** 2


@njit("f8(f8,f8)", cache=True)
def _penalty(away: float, turned: float) -> float:
    """Return what it costs to be so many deviations off."""
    square = away * away + turned * turned
    return square / (1.0 + square / (_ROBUST * _ROBUST))


@njit("f8(f8[::1],f8,f8[:,:,::1],f8[:,::1],f8[:,::1],i8[::1],f8[::1],f8[::1],f8)", cache=True)
def _cost_unseen(
    response: Array, total: float, robots: Array, starts: Array, ends: Array,
    lags: NDArray[np.int64], base: Array, contour: Array, bound: float,
) -> float:  # fmt: skip
    """Return the cost of a response where yaw is not seen, `total` being what it costs before.

    What is thought of yaw came from the response that was held then, and speaks for it. So half of the cost is that of
    a response that says itself how the object has turned, from one window to the next.
    """
    last, yaws = len(ends), np.empty(robots.shape[1])
    while last > 0 and total <= bound:
        first = max(last - _TOGETHER, 0)
        yaw = starts[first, 2]
        for i in range(first, last):
            x, y, _ = carry(response, robots[i], starts[i], yaw, starts[i, 6], base, contour, yaws)
            yaw = yaws[lags[i]]
            total += 0.5 * _penalty(math.hypot(x - ends[i, 0], y - ends[i, 1]) / _NOISE, 0.0)
            away, turned = _miss(response, robots[i], starts[i], ends[i], base, contour)
            total += 0.5 * _penalty(away / _NOISE, turned / _THOUGHT)
        last = first
    return total


@njit("f8(f8[::1],f8[::1],f8,f8[:,:,::1],f8[:,::1],f8[:,::1],i8[::1],f8[::1],f8[::1],f8)", cache=True)
def _cost(
    response: Array, prior: Array, trust: float, robots: Array, starts: Array, ends: Array,
    lags: NDArray[np.int64], base: Array, contour: Array, bound: float,
) -> float:  # fmt: skip
    """Return the cost of a response; of one that costs more than `bound`, only that much.

    Args:
        lags: (W,), at which of its observations each window is followed by the next; (0,) where yaw is seen.
    """
    total = _unlikely(response, prior, trust)
    if len(lags):
        return _cost_unseen(response, total, robots, starts, ends, lags, base, contour, bound)
    # The newest first: what fails there need not be followed further back.
    for i in range(len(ends) - 1, -1, -1):
        away, turned = _miss(response, robots[i], starts[i], ends[i], base, contour)
        total += _penalty(away / _NOISE, turned / _SEEN)
        if total > bound:
            break
    return total


@njit(
    "f8[::1](f8[::1],f8[::1],f8,f8[:,::1],f8[::1],b1[::1],f8[:,:,::1],f8[:,::1],f8[:,::1],i8[::1],f8[::1],f8[::1])",
    cache=True,
)
def search(
    held: Array, prior: Array, trust: float, draws: Array, scales: Array, anew: NDArray[np.bool_],
    robots: Array, starts: Array, ends: Array, lags: NDArray[np.int64], base: Array, contour: Array,
) -> Array:  # fmt: skip
    best = held.copy()
    cheapest = _cost(best, prior, trust, robots, starts, ends, lags, base, contour, np.inf)
    for i in range(len(draws)):
        trial = prior.copy() if anew[i] else best.copy()
        scale = 1.0 if anew[i] else scales[i]
        trial[ANISOTROPY] = min(abs(trial[ANISOTROPY] + 1.2 * scale * draws[i, ANISOTROPY]), 3.5)
        # Nothing is known of the axis at first, and of an object without wheels never.
        trial[AXIS] += (3.0 if anew[i] and prior[ANISOTROPY] == 0.0 else 0.8 * scale) * draws[i, AXIS]
        trial[CENTRE_X] += 0.03 * scale * draws[i, CENTRE_X]
        trial[CENTRE_Y] += 0.03 * scale * draws[i, CENTRE_Y]
        trial[LENGTH] *= math.exp(0.3 * scale * draws[i, LENGTH])
        trial[FRICTION] *= math.exp(0.4 * scale * draws[i, FRICTION])
        trial[COASTING] *= math.exp(0.8 * scale * draws[i, COASTING])
        cost = _cost(trial, prior, trust, robots, starts, ends, lags, base, contour, cheapest)
        if cost < cheapest:
            best, cheapest = trial, cost
    return best
