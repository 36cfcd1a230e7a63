"""Learns contour and response of an object from how it moved beside the robot, from nothing, while pushing.

The contour is a Fourier series fitted by recursive least squares to distances at which robot and object were seen to
touch. The response is found by random search: whatever explains short windows of the past better than what is held,
with a prior, is held from then on. All in m, s, rad, map frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

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
    CONTOUR,
    FRICTION,
    LENGTH,
    OMEGA,
    ORDER,
    RESPONSE,
    RVX,
    RVY,
    RX,
    RY,
    STATE,
    VX,
    VY,
    YAW,
    X,
    Y,
    answer,
    prior_contour,
    prior_response,
    radius,
)

Array = NDArray[np.float64]

SAMPLES = 9
"""observations in a window, 0.05 s apart"""

_STEP = 0.05
_WINDOWS = 60
_EVERY = 4
_LONGEST_GAP = 0.16
_NEAR = 0.06
_LEAD = 4
_TRAIL = 2
_ROWS = _LEAD + SAMPLES + _TRAIL
_NOISE = 0.006
_ROBUST = 4.0
_PROPOSALS = 24
_TOUCH_NOISE = 0.008
_MOVED = 0.02


@dataclass
class Experience:
    """What is known of an object.

    Attributes:
        contour, spread: (CONTOUR,) and its covariance (CONTOUR, CONTOUR).
        response, prior: (RESPONSE,).
        rows: the newest observations, (stamp ns, robot x, y, object x, y, yaw).
        robots, starts, ends: windows: (W, SAMPLES, 2), (W, 6) pose and velocity, (W, 3) pose.
        touches, seen: how many observations of the contour and windows were taken.
        error, prior_error: m, median over the windows, of what is held and of the prior.
    """

    contour: Array
    spread: Array
    response: Array
    prior: Array
    generator: np.random.Generator
    rows: list[tuple[int, float, float, float, float, float]] = field(default_factory=list)
    robots: Array = field(default_factory=lambda: np.zeros((0, SAMPLES, 2)))
    starts: Array = field(default_factory=lambda: np.zeros((0, 6)))
    ends: Array = field(default_factory=lambda: np.zeros((0, 3)))
    touches: int = 0
    seen: int = 0
    since: int = 0
    error: float = 0.0
    prior_error: float = 0.0

    @classmethod
    def of(cls, robot_diameter: float, object_diameter: float, seed: int) -> Experience:
        """Return what is known of an object of that bounding circle before it was touched."""
        deviations = np.array([0.05 * object_diameter / 0.25] + [0.03 / k for k in range(1, ORDER + 1) for _ in "cs"])
        prior = prior_response(object_diameter)
        return cls(
            prior_contour(robot_diameter, object_diameter),
            np.diag(deviations**2),
            prior.copy(),
            prior,
            np.random.Generator(np.random.PCG64(seed)),
        )

    def observe(self, stamp: int, r: tuple[float, float], o: tuple[float, float], yaw: float, base: Array) -> None:
        """Take an observation of both at `stamp`, and think about the past."""
        self.rows = [*self.rows[-_ROWS + 1 :], (stamp, *r, *o, yaw)]
        self._touch()
        self.since += 1
        if len(self.rows) == _ROWS and self.since >= _EVERY:
            self._window(base)
        if len(self.starts):
            self._think(base)

    def _touch(self) -> None:
        """Learn the distance of the centres in touch."""
        if len(self.rows) < _LEAD + 1:
            return
        recent = np.array([row[1:] for row in self.rows[-_LEAD - 1 :]])
        away = recent[:, 0:2] - recent[:, 2:4]
        distances = np.hypot(away[:, 0], away[:, 1])
        moved = recent[-1, 2:4] - recent[0, 2:4]
        travel = math.hypot(*moved)
        mean = away.mean(axis=0)
        distance = float(distances.mean())
        bearing = math.atan2(mean[1], mean[0]) - float(recent[len(recent) // 2, 4])
        expected, _ = radius(self.contour, bearing)
        pushed = travel > _MOVED and float(moved @ mean) < -0.3 * travel * distance
        steady = float(np.ptp(distances)) < 0.03
        driven = math.hypot(*(recent[-1, 0:2] - recent[0, 0:2])) > 0.5 * travel
        touching = pushed and steady and driven and distance < expected + 0.12
        if not touching and distance > expected - 0.012:
            return
        basis = np.empty(CONTOUR)
        basis[0] = 1.0
        for k in range(1, ORDER + 1):
            basis[2 * k - 1], basis[2 * k] = math.cos(k * bearing), math.sin(k * bearing)
        spread = self.spread @ basis
        gain = spread / (float(basis @ spread) + _TOUCH_NOISE**2)
        self.contour = self.contour + gain * (distance - expected)
        self.spread = self.spread - np.outer(gain, spread)
        self.spread = 0.5 * (self.spread + self.spread.T) + np.diag(np.full(CONTOUR, 1e-8))
        self.touches += 1

    def _window(self, base: Array) -> None:
        """Keep the newest rows as a window if the object was near the robot, or moved."""
        stamps = np.array([row[0] - self.rows[-1][0] for row in self.rows]) * 1e-9
        seen = np.array([row[1:] for row in self.rows])
        if np.diff(stamps).max() > _LONGEST_GAP:
            return
        seen[:, 4] = np.unwrap(seen[:, 4])
        times = _STEP * np.arange(-_ROWS + 1, 1)
        rows = np.column_stack([np.interp(times, stamps, column) for column in seen.T])
        own = np.array([_line(rows[k - 1 : k + 2])[0] for k in range(_LEAD, _LEAD + SAMPLES)])
        pose, velocity = _line(rows[: 2 * _LEAD + 1])
        end, _ = _line(rows[-2 * _TRAIL - 1 :])
        gaps = np.hypot(*(own[:, 0:2] - own[:, 2:4]).T)
        travel = math.hypot(*(own[-1, 2:4] - own[0, 2:4]))
        if gaps.min() > self.contour[0] + _NEAR:
            return
        start = np.array([*pose[2:5], *velocity[2:5]])
        # What lay still and was to lie still teaches nothing, and would crowd out what does.
        expected = _carried(self.response, own[:, 0:2].copy(), start, base, self.contour)
        if travel < _MOVED and math.hypot(expected[0] - start[0], expected[1] - start[1]) < _MOVED:
            return
        self.robots = np.concatenate([self.robots[-_WINDOWS + 1 :], own[None, :, 0:2]])
        self.starts = np.concatenate([self.starts[-_WINDOWS + 1 :], start[None]])
        self.ends = np.concatenate([self.ends[-_WINDOWS + 1 :], end[None, 2:5]])
        self.seen += 1
        self.since = 0

    def _think(self, base: Array) -> None:
        """Try other responses, and hold the best."""
        draws = self.generator.standard_normal((_PROPOSALS, RESPONSE))
        scales = 10.0 ** self.generator.uniform(-1.7, 0.3, _PROPOSALS)
        anew = self.generator.uniform(size=_PROPOSALS) < 0.25
        best = _search(
            self.response, self.prior, draws, scales, anew,
            self.robots, self.starts, self.ends, base, self.contour,
        )  # fmt: skip
        self.response = best
        self.error = median_error(best, self.robots, self.starts, self.ends, base, self.contour)
        self.prior_error = median_error(self.prior, self.robots, self.starts, self.ends, base, self.contour)


def _line(rows: Array) -> tuple[Array, Array]:
    """Return value in the middle and rate, a s, of the straight lines that fit the columns of `rows` best."""
    times = _STEP * (np.arange(len(rows)) - 0.5 * (len(rows) - 1))
    return rows.mean(axis=0), times @ rows / float(times @ times)


def median_error(response: Array, robots: Array, starts: Array, ends: Array, base: Array, contour: Array) -> float:
    """Return the median distance, m, between where windows ended and where `response` says that they would."""
    misses = [_miss(response, robots[i], starts[i], ends[i], base, contour)[0] for i in range(len(ends))]
    return float(np.median(misses))


@njit("f8[::1](f8[::1],f8[:,::1],f8[::1],f8[::1],f8[::1])", cache=True)
def _carried(response: Array, robots: Array, start: Array, base: Array, contour: Array) -> Array:
    """Return the object's pose, (3,), at the end of a window as `response` has it."""
    state = np.zeros(STATE)
    state[X], state[Y], state[YAW] = start[0], start[1], start[2]
    state[VX], state[VY], state[OMEGA] = start[3], start[4], start[5]
    for k in range(1, len(robots)):
        state[RX], state[RY] = robots[k, 0], robots[k, 1]
        before = max(k - 2, 0)
        after = min(k + 1, len(robots) - 1)
        duration = (after - before) * _STEP
        state[RVX] = (robots[after, 0] - robots[before, 0]) / duration
        state[RVY] = (robots[after, 1] - robots[before, 1]) / duration
        answer(state, _STEP, base, contour, response)
    return state[:3].copy()


@njit("UniTuple(f8,2)(f8[::1],f8[:,::1],f8[::1],f8[::1],f8[::1],f8[::1])", cache=True)
def _miss(response: Array, robots: Array, start: Array, end: Array, base: Array, contour: Array) -> tuple[float, float]:
    """Return how far, m, and rad, the object is predicted off the end of a window."""
    pose = _carried(response, robots, start, base, contour)
    dx, dy = pose[0] - end[0], pose[1] - end[1]
    return math.sqrt(dx * dx + dy * dy), abs(wrapped(pose[2] - end[2]))


@njit("f8(f8[::1],f8[::1],f8[:,:,::1],f8[:,::1],f8[:,::1],f8[::1],f8[::1])", cache=True)
def _cost(
    response: Array, prior: Array, robots: Array, starts: Array, ends: Array, base: Array, contour: Array
) -> float:
    total = 0.0
    for i in range(len(ends)):
        away, turned = _miss(response, robots[i], starts[i], ends[i], base, contour)
        square = (away / _NOISE) ** 2 + (turned / 0.07) ** 2
        total += square / (1.0 + square / (_ROBUST * _ROBUST))
    a = response[ANISOTROPY]
    total += (a / 1.2) ** 2
    total += ((response[CENTRE_X] / 0.03) ** 2 + (response[CENTRE_Y] / 0.03) ** 2) * 1.0
    total += (math.log(response[LENGTH] / prior[LENGTH]) / 0.3) ** 2
    total += (math.log(response[FRICTION] / prior[FRICTION]) / 0.5) ** 2
    total += (math.log(response[COASTING] / prior[COASTING]) / 1.5) ** 2
    return total


@njit("f8[::1](f8[::1],f8[::1],f8[:,::1],f8[::1],b1[::1],f8[:,:,::1],f8[:,::1],f8[:,::1],f8[::1],f8[::1])", cache=True)
def _search(
    held: Array, prior: Array, draws: Array, scales: Array, anew: NDArray[np.bool_],
    robots: Array, starts: Array, ends: Array, base: Array, contour: Array,
) -> Array:  # fmt: skip
    best = held.copy()
    cheapest = _cost(best, prior, robots, starts, ends, base, contour)
    for i in range(len(draws)):
        trial = prior.copy() if anew[i] else best.copy()
        scale = 1.0 if anew[i] else scales[i]
        trial[ANISOTROPY] = min(max(trial[ANISOTROPY] + 1.2 * scale * draws[i, ANISOTROPY], -3.5), 3.5)
        trial[AXIS] += 0.8 * scale * draws[i, AXIS]
        trial[CENTRE_X] += 0.03 * scale * draws[i, CENTRE_X]
        trial[CENTRE_Y] += 0.03 * scale * draws[i, CENTRE_Y]
        trial[LENGTH] *= math.exp(0.3 * scale * draws[i, LENGTH])
        trial[FRICTION] *= math.exp(0.4 * scale * draws[i, FRICTION])
        trial[COASTING] *= math.exp(0.8 * scale * draws[i, COASTING])
        cost = _cost(trial, prior, robots, starts, ends, base, contour)
        if cost < cheapest:
            best, cheapest = trial, cost
    return best
