"""Short-horizon planning: rolls candidates out in the forward model and takes the cheapest.

A candidate is a closed loop: where on the path the object is to be pushed next, the bias of the bearing, the speed, the
way around, or a place of the body to push at first. The object's and the robot's depth in the corridor are part of the
cost, so that what leaves the corridor never wins while something else does not.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from services.geometry.angles import wrapped
from services.geometry.field import lookup
from services.predictive.law import (
    BIAS,
    BODY,
    LEAN,
    MANOEUVRE,
    SIDE,
    SPEED,
    STAND,
    TARGET_X,
    TARGET_Y,
    WALK,
    inside,
    kept_margin,
    turning,
    wish,
)
from services.predictive.model import ACCELERATION, RVX, RVY, RX, RY, VX, VY, YAW, X, Y, step

Array = NDArray[np.float64]

STEP, COARSE, FINE = 0.05, 0.1, 1.0
"""s between the steps of a rollout, at first and later; s that they are fine for."""
SHOWN = 4
"""Every so-many-th step is in a PushPlan."""
AHEAD, BIAS_OF, SPEED_OF, SIDE_OF, BODY_OF, STAND_OF, LEAN_OF, AFTER, AFTER_STAND, AFTER_LEAN, CANDIDATE = range(11)
"""Places in a candidate: m along the path to its target, rad, share of the full speed, way around; s to push at a
place of the body first, its bearing, rad, object's frame, and the push's direction from the centre's, rad; the same of
a second such push."""

HORIZON, SPEED_FULL, APPROACH, SLOWEST, MARGIN, PRECISION, SPEED_WALK, GOAL_YAW, TURNED, SETTINGS = range(10)
"""Places in the settings: s; m/s; m/s^2 of the approach to the goal; m/s; m kept from the edge; m; m/s around
the object; rad, wanted orientation; rad, to within which, pi where any will do."""

_OUT = 60.0
_NEAR_EDGE = 40.0
_PROGRESS = 0.8
_ROOM = 0.04
_BODY = 0.8
_STILL = 0.04
_CHANGE = 0.1
_BLOCKED = 4.0
_NO_WAY = 15.0
_CAREFUL = 0.2
_RISK = 15.0
_PUSHED = 4.0
_LONGEST = 12.0
_ASIDE = 1.5
_SHORT = 30.0
_GAINED = 0.7
_ASKEW = 2.0
_TURN_FROM = 0.8
_AT_REST = 0.05
_IN_VAIN = 1000.0
_LOOK = 0.4
_WIDE = 0.4
_SLOW = 0.5


def candidates() -> Array:
    """Return the candidates, (N, CANDIDATE)."""
    rows: list[tuple[float, ...]] = [(0.1, 0.0, 0.0, 0.0)]  # wait: what is at the goal and still moves is to rest
    for ahead in (0.1, 0.3, 0.6, 1.0):
        rows += [(ahead, bias, 1.0, 0.0) for bias in (0.0, -0.25, 0.25, -0.55, 0.55)]
        rows.append((ahead, 0.0, 0.5, 0.0))
        for side in (-1.0, 1.0):
            rows.append((ahead, 0.0, 1.0, side))
            rows.append((ahead, 0.5 * side, 1.0, side))
    rows = [(*row, *[0.0] * 6) for row in rows]
    for stand in np.arange(12) * math.pi / 6:
        rows += [(0.3, 0.0, 0.7, 0.0, _BODY, float(stand), lean, *[0.0] * 3) for lean in (-0.5, 0.0, 0.5)]
    return np.array(rows)


def pairs(count: int, generator: np.random.Generator) -> Array:
    """Return `count` candidates, (count, CANDIDATE), of two pushes at places of the body, drawn evenly.

    Wheels are turned with the first, so that the second is along them: no single push does that.
    """
    rows = np.zeros((count, CANDIDATE))
    rows[:, [AHEAD, SPEED_OF]] = 0.3, 1.0
    rows[:, [STAND_OF, AFTER_STAND]] = generator.uniform(-math.pi, math.pi, (count, 2))
    rows[:, [LEAN_OF, AFTER_LEAN]] = generator.uniform(-0.6, 0.6, (count, 2))
    rows[:, [BODY_OF, AFTER]] = generator.uniform(0.4, 2.4, (count, 2))
    return rows


def pushed(candidate: Array, time: float) -> Array:
    """Return what is left of a candidate, (CANDIDATE,), after `time`, s, of pushing."""
    left = candidate.copy()
    left[BODY_OF] -= time
    if left[BODY_OF] <= 0.0:
        left[[BODY_OF, STAND_OF, LEAN_OF]] = left[[AFTER, AFTER_STAND, AFTER_LEAN]]
        left[[AFTER, AFTER_STAND, AFTER_LEAN]] = 0.0
    return left


def variants(candidate: Array, count: int, generator: np.random.Generator) -> Array:
    """Return `count` candidates, (count, CANDIDATE), that differ little from `candidate`, drawn normally."""
    rows = np.tile(candidate, (count, 1))
    draws = generator.standard_normal((count, 8))
    rows[:, AHEAD] = np.clip(rows[:, AHEAD] * np.exp(0.4 * draws[:, 0]), 0.05, 1.5)
    rows[:, BIAS_OF] = np.clip(rows[:, BIAS_OF] + 0.15 * draws[:, 1], -0.7, 0.7)
    if candidate[BODY_OF] > 0.0:
        rows[:, STAND_OF] += 0.15 * draws[:, 2]
        rows[:, LEAN_OF] = np.clip(rows[:, LEAN_OF] + 0.15 * draws[:, 3], -0.7, 0.7)
        rows[:, BODY_OF] = np.clip(rows[:, BODY_OF] + 0.3 * draws[:, 4], 0.1, 2.5)
    if candidate[AFTER] > 0.0:
        rows[:, AFTER_STAND] += 0.2 * draws[:, 5]
        rows[:, AFTER_LEAN] = np.clip(rows[:, AFTER_LEAN] + 0.2 * draws[:, 6], -0.7, 0.7)
        rows[:, AFTER] = np.clip(rows[:, AFTER] + 0.3 * draws[:, 7], 0.1, 2.5)
    return rows


@njit("i8(f8[:,::1],i8,f8,f8)", cache=True)
def advance(path: Array, index: int, x: float, y: float) -> int:
    """Return the index of the path's point closest to (x, y), searched from `index` both ways while it gets closer."""
    n = len(path)
    best = (path[index, 0] - x) ** 2 + (path[index, 1] - y) ** 2
    for way in (1, -1):
        i = index
        while 0 <= i + way < n:
            d = (path[i + way, 0] - x) ** 2 + (path[i + way, 1] - y) ** 2
            if d >= best:
                break
            i += way
            best = d
        if i != index:
            return i
    return index


@njit("void(f8[:,::1],f8[::1],f8,i8,f8[::1],f8[::1],f8[::1],f8[::1])", cache=True)
def manoeuvre_of(
    path: Array, width: Array, spacing: float, index: int,
    state: Array, candidate: Array, settings: Array, out: Array,
) -> None:  # fmt: skip
    """Write to `out` the manoeuvre of a candidate for the object's place."""
    last = len(path) - 1
    ahead = min(index + max(1, round(candidate[AHEAD] / spacing)), last)
    out[TARGET_X], out[TARGET_Y] = path[ahead, 0], path[ahead, 1]
    gx, gy = path[last, 0] - state[X], path[last, 1] - state[Y]
    left = math.sqrt(gx * gx + gy * gy)
    braked = math.sqrt(2.0 * settings[APPROACH] * left)
    out[BIAS] = candidate[BIAS_OF]
    # What goes wrong in a narrow place is over before it is seen, unless it goes slowly.
    room = min(width[index], width[min(index + int(_LOOK / spacing), last)])
    full = settings[SPEED_FULL] * min(1.0, max(_SLOW, room / _WIDE))
    out[SPEED] = max(settings[SLOWEST], min(candidate[SPEED_OF] * full, braked))
    out[SIDE] = candidate[SIDE_OF]
    out[WALK] = settings[SPEED_WALK]
    if candidate[SPEED_OF] == 0.0:
        out[SPEED] = out[WALK] = 0.0
    out[BODY], out[STAND], out[LEAN] = 1.0 if candidate[BODY_OF] > 0.0 else 0.0, candidate[STAND_OF], candidate[LEAN_OF]


@njit("f8(f8,f8,f8,f8)", cache=True)
def _danger(depth: float, own: float, needed: float, walking: float) -> float:
    """Return what each second costs in which the object is `depth` and the robot `own` inside the corridor, m.

    Args:
        needed: m, less than which costs: the robot must find room between the object and the edge, or nothing can
            bring the object back.
    """
    rate = 0.0
    if depth < needed:
        short = needed - depth
        rate += _NEAR_EDGE * short * (0.1 + short)
    if depth < 0.0:
        rate += _OUT
    if own < 0.0:
        rate += _OUT
    # Who pushes from farther inside pushes outward, and whether it turns before the edge is only thought.
    if own > depth and depth < _CAREFUL and walking == 0.0:
        rate += _RISK * (_CAREFUL - depth) * (own - depth)
    return rate


@njit("f8(f8[::1],f8[::1],f8,f8,f8[::1],f8)", cache=True)
def _rest(state: Array, manoeuvre: Array, left: float, reach: float, settings: Array, walking: float) -> float:
    """Return the s that it takes from `state` on, as if the object obeyed: to walk behind it, and to push it `left` m.

    Args:
        reach: m, mean distance of the centres in touch.
    """
    bearing = math.atan2(state[RY] - state[Y], state[RX] - state[X])
    behind = math.atan2(state[Y] - manoeuvre[TARGET_Y], state[X] - manoeuvre[TARGET_X])
    far = math.hypot(state[RX] - state[X], state[RY] - state[Y]) - reach
    walk = (abs(wrapped(bearing - behind)) * reach + max(far, 0.0)) / settings[SPEED_WALK]
    time = walk + left / (_PROGRESS * settings[SPEED_FULL])
    # Who stands still at the end has run into the corridor's edge: that is no place to wait.
    if state[RVX] * state[RVX] + state[RVY] * state[RVY] < _STILL * _STILL:
        time += _NO_WAY if walking == 1.0 else _BLOCKED
    return time


@njit(
    "f8(f8[::1],f8,f8[::1],f8[::1],f8[::1],f8[::1],f8[::1],f8[:,::1],f8[::1],f8,i8,f8[:,::1],f8,f8,f8,f8[:,::1],f8)",
    cache=True,
)
def rollout(
    start: Array, walking: float, candidate: Array, base: Array, contour: Array, response: Array, settings: Array,
    path: Array, width: Array, spacing: float, index: int,
    values: Array, x0: float, y0: float, resolution: float, trace: Array, bound: float,
) -> float:  # fmt: skip
    """Return the cost of a candidate; writes (object, robot) positions to `trace` (steps, 4), as far as it reaches.

    Args:
        bound: a candidate is given up, at infinite cost, when what is left of its rollout can hardly bring it below.
    """
    state = start.copy()
    manoeuvre = np.empty(MANOEUVRE)
    steps = int(FINE / STEP) + int((_LONGEST - FINE) / COARSE)
    last = len(path) - 1
    cost, left, depth, needed = 0.0, 0.0, 0.0, 0.0
    pushed, askew = 0.0, 0.0
    enough = max(_PUSHED, candidate[BODY_OF] + candidate[AFTER] + 1.0)
    reach = contour.mean()
    time, dt = 0.0, STEP
    for k in range(steps):
        # Who walks first is judged by pushing as well: else the best push would be one that is never begun.
        if time > settings[HORIZON] - 1e-6 and pushed > enough - 1e-6:
            break
        dt = STEP if time < FINE - 1e-6 else COARSE
        index = advance(path, index, state[X], state[Y])
        manoeuvre_of(path, width, spacing, index, state, candidate, settings, manoeuvre)
        if manoeuvre[BODY] == 1.0 and pushed >= candidate[BODY_OF]:
            if pushed < candidate[BODY_OF] + candidate[AFTER]:
                manoeuvre[STAND], manoeuvre[LEAN] = candidate[AFTER_STAND], candidate[AFTER_LEAN]
            else:
                manoeuvre[BODY] = 0.0
        ux, uy, walking = wish(state, contour, manoeuvre, walking)
        if walking == 0.0:
            pushed += dt
        kept = kept_margin(settings[MARGIN], width[index])
        ux, uy = inside(values, x0, y0, resolution, state, ux, uy, base[ACCELERATION], kept)
        step(state, ux, uy, turning(state, contour), dt, base, contour, response)
        time += dt
        qx, qy = state[X] - path[index, 0], state[Y] - path[index, 1]
        lateral = math.sqrt(qx * qx + qy * qy)
        left = (last - index) * spacing + _ASIDE * lateral
        if k < len(trace):
            trace[k, 0], trace[k, 1], trace[k, 2], trace[k, 3] = state[X], state[Y], state[RX], state[RY]
        gx, gy = state[X] - path[last, 0], state[Y] - path[last, 1]
        askew = max(0.0, abs(wrapped(state[YAW] - settings[GOAL_YAW])) - settings[TURNED])
        there = gx * gx + gy * gy < settings[PRECISION] * settings[PRECISION] and askew == 0.0
        if there and state[VX] * state[VX] + state[VY] * state[VY] < _AT_REST * _AT_REST:
            return cost
        depth = lookup(values, x0, y0, resolution, state[X], state[Y])
        own = lookup(values, x0, y0, resolution, state[RX], state[RY])
        needed = min(reach + _ROOM, 0.75 * max(width[index], 0.0))
        cost += dt * (1.0 + _danger(depth, own, needed, walking))
        ahead = max(settings[HORIZON] - time, enough - pushed)
        if cost + left / (_PROGRESS * settings[SPEED_FULL]) - _GAINED * ahead > bound:
            return np.inf
    if candidate[SPEED_OF] == 0.0:
        return cost + _IN_VAIN
    # What is still to be turned is like a way to be pushed; the nearer to the goal, the less is it left for later.
    left += _ASKEW * askew * _TURN_FROM / max(left, _TURN_FROM)
    # Near the edge the robot cannot stand where it would have to.
    return cost + _rest(state, manoeuvre, left, reach, settings, walking) + _SHORT * max(0.0, needed - depth)


@njit(
    "UniTuple(f8,2)(f8[::1],f8,f8[:,::1],f8[::1],f8[::1],f8[::1],f8[::1],f8[::1],f8[:,::1],f8[::1],f8,i8,f8[:,::1],"
    "f8,f8,f8,i8)",
    cache=True,
)
def choose(
    start: Array, walking: float, rows: Array, whims: Array,
    base: Array, contour: Array, response: Array, settings: Array,
    path: Array, width: Array, spacing: float, index: int,
    values: Array, x0: float, y0: float, resolution: float, favourite: int,
) -> tuple[float, float]:  # fmt: skip
    """Return the number of the cheapest of the candidates `rows`, and its cost, the whim included.

    Args:
        whims: (N,), s, on top of the costs of `rows`.
        favourite: the one in force, which has a small advantage; -1 for none. Its changes cost more than they bring.
    """
    best, cheapest = -1, np.inf
    nothing = np.empty((0, 4))
    for k in range(len(rows)):
        # From the last on: the favourite is there, and what it costs cuts the others short.
        i = len(rows) - 1 - k
        cost = rollout(
            start, walking, rows[i], base, contour, response, settings,
            path, width, spacing, index, values, x0, y0, resolution, nothing, cheapest - whims[i],
        ) + whims[i]  # fmt: skip
        if i == favourite:
            # On the way around, half-heartedness costs most: what is begun is finished unless much is to be gained.
            cost -= (2.0 if walking == 1.0 else 0.5) + _CHANGE
        if cost < cheapest:
            best, cheapest = i, cost
    return float(best), cheapest
