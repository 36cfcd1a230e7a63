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
from services.predictive.model import ACCELERATION, RVX, RVY, RX, RY, X, Y, step

Array = NDArray[np.float64]

STEP, COARSE, FINE = 0.05, 0.1, 2.0
"""s between the steps of a rollout, at first and later; s that they are fine for."""
SHOWN = 4
"""Every so-many-th step is in a PushPlan."""
AHEAD, BIAS_OF, SPEED_OF, SIDE_OF, BODY_OF, STAND_OF, LEAN_OF, AFTER, AFTER_STAND, AFTER_LEAN, CANDIDATE = range(11)
"""Places in a candidate: m along the path to its target, rad, share of the full speed, way around; s to push at a
place of the body first, its bearing, rad, object's frame, and the push's direction from the centre's, rad; the same of
a second such push."""

HORIZON, SPEED_FULL, APPROACH, SLOWEST, MARGIN, PRECISION, SPEED_WALK, SETTINGS = range(8)
"""Places in the settings: s; m/s; m/s^2 of the approach to the goal; m/s; m kept from the edge; m; m/s around
the object."""

_OUT = 60.0
_NEAR_EDGE = 40.0
_PROGRESS = 0.8
_ROOM = 0.04
_BODY = 0.8
_STILL = 0.04
_CHANGE = 0.1
_BLOCKED = 10.0
_CAREFUL = 0.2
_RISK = 15.0
_PUSHED = 2.5
_LONGEST = 12.0
_ASIDE = 1.5
_SHORT = 30.0


def candidates() -> Array:
    """Return the candidates, (N, CANDIDATE)."""
    rows: list[tuple[float, ...]] = []
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
    rows[:, [AHEAD, SPEED_OF]] = 0.3, 0.7
    rows[:, [STAND_OF, AFTER_STAND]] = generator.uniform(-math.pi, math.pi, (count, 2))
    rows[:, [LEAN_OF, AFTER_LEAN]] = generator.uniform(-0.6, 0.6, (count, 2))
    rows[:, [BODY_OF, AFTER]] = generator.uniform(0.5, 2.0, (count, 2))
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


@njit("void(f8[:,::1],f8,i8,f8[::1],f8[::1],f8[::1],f8[::1])", cache=True)
def manoeuvre_of(
    path: Array, spacing: float, index: int, state: Array, candidate: Array, settings: Array, out: Array
) -> None:
    """Write to `out` the manoeuvre of a candidate for the object's place."""
    last = len(path) - 1
    ahead = min(index + max(1, round(candidate[AHEAD] / spacing)), last)
    out[TARGET_X], out[TARGET_Y] = path[ahead, 0], path[ahead, 1]
    gx, gy = path[last, 0] - state[X], path[last, 1] - state[Y]
    left = math.sqrt(gx * gx + gy * gy)
    braked = math.sqrt(2.0 * settings[APPROACH] * left)
    out[BIAS] = candidate[BIAS_OF]
    out[SPEED] = max(settings[SLOWEST], min(candidate[SPEED_OF] * settings[SPEED_FULL], braked))
    out[SIDE] = candidate[SIDE_OF]
    out[WALK] = settings[SPEED_WALK]
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


@njit("f8(f8[::1],f8[::1],f8,f8,f8[::1])", cache=True)
def _rest(state: Array, manoeuvre: Array, left: float, reach: float, settings: Array) -> float:
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
        time += _BLOCKED
    return time


@njit(
    "f8(f8[::1],f8,f8[::1],f8[::1],f8[::1],f8[::1],f8[::1],f8[:,::1],f8[::1],f8,i8,f8[:,::1],f8,f8,f8,f8[:,::1])",
    cache=True,
)
def rollout(
    start: Array, walking: float, candidate: Array, base: Array, contour: Array, response: Array, settings: Array,
    path: Array, width: Array, spacing: float, index: int,
    values: Array, x0: float, y0: float, resolution: float, trace: Array,
) -> float:  # fmt: skip
    """Return the cost of a candidate; writes (object, robot) positions to `trace` (steps, 4), as far as it reaches."""
    state = start.copy()
    manoeuvre = np.empty(MANOEUVRE)
    steps = int(FINE / STEP) + int((_LONGEST - FINE) / COARSE)
    last = len(path) - 1
    cost, left, depth, needed = 0.0, 0.0, 0.0, 0.0
    pushed = 0.0
    enough = max(_PUSHED, candidate[BODY_OF] + candidate[AFTER] + 1.0)
    reach = contour.mean()
    time, dt = 0.0, STEP
    for k in range(steps):
        # Who walks first is judged by pushing as well: else the best push would be one that is never begun.
        if time > settings[HORIZON] - 1e-6 and pushed > enough - 1e-6:
            break
        dt = STEP if time < FINE - 1e-6 else COARSE
        index = advance(path, index, state[X], state[Y])
        manoeuvre_of(path, spacing, index, state, candidate, settings, manoeuvre)
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
        if gx * gx + gy * gy < settings[PRECISION] * settings[PRECISION]:
            left = 0.0
            break
        depth = lookup(values, x0, y0, resolution, state[X], state[Y])
        own = lookup(values, x0, y0, resolution, state[RX], state[RY])
        needed = min(reach + _ROOM, 0.75 * max(width[index], 0.0))
        cost += dt * (1.0 + _danger(depth, own, needed, walking))
    if left > 0.0:
        # Near the edge the robot cannot stand where it would have to.
        cost += _rest(state, manoeuvre, left, reach, settings) + _SHORT * max(0.0, needed - depth)
    return cost


@njit(
    "UniTuple(f8,2)(f8[::1],f8,f8[:,::1],f8[::1],f8[::1],f8[::1],f8[::1],f8[:,::1],f8[::1],f8,i8,f8[:,::1],f8,f8,f8,i8)",
    cache=True,
)
def choose(
    start: Array, walking: float, rows: Array, base: Array, contour: Array, response: Array, settings: Array,
    path: Array, width: Array, spacing: float, index: int,
    values: Array, x0: float, y0: float, resolution: float, favourite: int,
) -> tuple[float, float]:  # fmt: skip
    """Return the number of the cheapest of the candidates `rows`, and its cost.

    Args:
        favourite: the one in force, which has a small advantage; -1 for none. Its changes cost more than they bring.
    """
    best, cheapest = -1, np.inf
    nothing = np.empty((0, 4))
    for i in range(len(rows)):
        cost = rollout(
            start, walking, rows[i], base, contour, response, settings,
            path, width, spacing, index, values, x0, y0, resolution, nothing,
        )  # fmt: skip
        if i == favourite:
            # On the way around, half-heartedness costs most: what is begun is finished unless much is to be gained.
            cost -= (2.0 if walking == 1.0 else 0.5) + _CHANGE
        if cost < cheapest:
            best, cheapest = i, cost
    return float(best), cheapest
