"""How the object moves when pushed: alpha, gamma, and which alphas were good (Sec. 5, 5.2, 5.3).

gamma needs a window: at 20 Hz the object moves less between two observations than they are off. The executed
direction is that of the displacement since the newest observation at least `window` m away, none when there
is no such observation within `memory` s. So a reading also means that the object is moving.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from services.geometry.angles import difference, direction

Array = NDArray[np.float64]


class Accept(StrEnum):
    """Which alphas count as good."""

    DECREASING = "decreasing"
    """|gamma| is less than at the observation before. The paper's |d gamma/dt| < 0, which cannot hold as it
    is printed, is read as d|gamma|/dt < 0."""
    SMALL = "small"
    """|gamma| is below a limit"""


@dataclass(slots=True)
class MovementState:
    """What `observe` remembers."""

    times: Array = field(default_factory=lambda: np.empty(0))
    """(n,), s, of the observations within the memory, oldest first"""
    positions: Array = field(default_factory=lambda: np.empty((0, 2)))
    """(n, 2), m, map frame"""
    gamma: float = 0.0
    """rad, newest reading"""
    moving: bool = False
    """the last observation gave a reading"""
    readings: int = 0
    """|Gamma_k|"""
    mean_gamma: float = 0.0
    """rad, mu_gamma, over all readings"""


@dataclass(frozen=True, slots=True)
class Reading:
    """What one observation says."""

    moving: bool
    """gamma is fresh"""
    gamma: float
    """rad in (-pi, pi], the newest reading; 0 before the first"""
    mean_gamma: float
    """rad, mu_gamma"""
    good: bool
    """the present alpha is a sample for the learner"""


class TimeOrder(ValueError):
    """An observation is not newer than the one before."""


def alpha(r: Array, o: Array, t: Array) -> float:
    """Return the orientation of the push-line o-t in the push frame, whose x axis is r-o (rad, (-pi, pi]).

    Args:
        r, o, t: (2,), m, one frame.

    Raises:
        services.geometry.angles.DegenerateDirection: o coincides with r or t.
    """
    return difference(direction(o, t), direction(r, o))


def observe(
    state: MovementState, time: float, o: Array, theta_desired: float, *,
    window: float = 0.03, memory: float = 1.0, accept: Accept = Accept.DECREASING, small: float = 0.3,
) -> Reading:  # fmt: skip
    """Take the object's position into `state` and return gamma = theta_desired - theta_executed, if it moved.

    Args:
        state: is changed.
        time: s, of the observation, later than the one before.
        o: (2,), m, map frame.
        theta_desired: rad, map frame, orientation of the present push-line.
        window: m of travel that make a direction.
        memory: s within which that travel is to happen.
        accept: which alphas are good.
        small: rad, the limit for Accept.SMALL.

    Raises:
        TimeOrder: `time` is not later than that of the last observation.
    """
    if len(state.times) and time <= state.times[-1]:
        raise TimeOrder(f"observation at {time:g} s after one at {state.times[-1]:g} s")
    recent = state.times >= time - memory
    offsets = np.asarray(o) - state.positions
    far = np.flatnonzero(recent & (np.hypot(offsets[:, 0], offsets[:, 1]) >= window))
    state.times = np.append(state.times[recent], time)
    state.positions = np.vstack([state.positions[recent], o])
    if len(far) == 0:
        state.moving = False
        return Reading(False, state.gamma, state.mean_gamma, False)
    dx, dy = offsets[far[-1]]
    gamma = difference(theta_desired, math.atan2(dy, dx))
    decreasing = state.moving and abs(gamma) < abs(state.gamma)
    good = decreasing if accept == Accept.DECREASING else abs(gamma) < small
    state.gamma, state.moving = gamma, True
    state.readings += 1
    state.mean_gamma += (gamma - state.mean_gamma) / state.readings
    return Reading(True, gamma, state.mean_gamma, good)
