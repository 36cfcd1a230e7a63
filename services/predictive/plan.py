"""Short-horizon planning: rolls candidates out in the forward model and takes the cheapest.

A candidate (`candidates`) is a closed loop: where on the path the object is to be pushed next, the bias of the bearing,
the speed, the way around, or a place of the body to push at first. The object's and the robot's depth in the corridor
are part of the cost, so that what leaves the corridor never wins while something else does not.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from services.geometry.angles import wrapped
from services.geometry.field import lookup
from services.predictive.candidates import (
    AFTER,
    AFTER_LEAN,
    AFTER_STAND,
    AHEAD,
    BIAS_OF,
    BODY_OF,
    LEAN_OF,
    SIDE_OF,
    SPEED_OF,
    STAND_OF,
)
from services.predictive.law import (
    BIAS,
    BODY,
    LEAN,
    MANOEUVRE,
    OBJECT_NEAR,
    SIDE,
    SPEED,
    STAND,
    TARGET_X,
    TARGET_Y,
    WALK,
    inside,
    kept_margin,
    sparing,
    turning,
    wish,
)
from services.predictive.model import ACCELERATION, OMEGA, RVX, RVY, RX, RY, VX, VY, YAW, X, Y, step

Array = NDArray[np.float64]

STEP, COARSE, FINE = 0.05, 0.1, 1.0
"""s between the steps of a rollout, at first and later; s that they are fine for."""
SHOWN = 4
"""Every so-many-th step is in a PushPlan."""

HORIZON, SPEED_FULL, APPROACH, SLOWEST, MARGIN, PRECISION, SPEED_WALK, GOAL_YAW, TURNED, SETTINGS = range(10)
"""Places in the settings: s; m/s; m/s^2 of the approach to the goal; m/s; m kept from the edge; m; m/s around
the object; rad, wanted orientation; rad, to within which, pi where any will do."""

_OUT = 60.0
"""what a second outside costs, s"""
_NEAR_EDGE = 40.0
"""what a second near the edge costs, s/m^2"""
_CAREFUL, _RISK = 0.2, 15.0
"""m from the edge, and s/m^2: what it costs to push outward there"""
_ROOM = 0.04
"""m between object, robot and edge that the robot needs to come around"""
_SHORT = 30.0
"""s/m of that room lacking at the end"""
_PROGRESS = 0.8
"""share of the full speed that pushes make good"""
_GAINED = 0.7
"""s that a second of a rollout can save at most, nearly"""
_PUSHED = 4.0
"""s of pushing that a rollout goes on for at least"""
_LONGEST = 12.0
"""s"""
_ASIDE = 1.5
"""m to push for each m beside the path"""
_STILL = 0.04
"""m/s of a robot that stands"""
_BLOCKED, _NO_WAY = 4.0, 15.0
"""s: where the robot stands at the end, pushing and walking"""
_CHANGE = 0.1
"""s that a change of the plan costs"""
_TIRED, _ON_THE_WAY = 0.5, 2.0
"""s more that it costs, pushing and walking"""
_ASKEW, _TURN_FROM = 2.0, 0.8
"""m to push for each rad to turn, and m before the goal from which that grows"""
AT_REST, _UNTURNED = 0.04, 0.2
"""m/s and rad/s below which an object is at rest"""
_IN_VAIN = 1000.0
"""s: to wait where nothing comes of it"""
_LOOK, _WIDE, _SLOW = 0.4, 0.4, 0.5
"""m of the path ahead that are looked at; m, half width below which it goes slower; the least share of the speed"""


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
    room = width[index]
    for i in range(index, min(index + int(_LOOK / spacing), last) + 1):
        room = min(room, width[i])
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
    time = 0.0
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
            if depth < OBJECT_NEAR:
                ux, uy = sparing(values, x0, y0, resolution, state, ux, uy, base[ACCELERATION], width[index])
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
        there = there and (settings[TURNED] >= math.pi or abs(state[OMEGA]) < _UNTURNED)
        if there and state[VX] * state[VX] + state[VY] * state[VY] < AT_REST * AT_REST:
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
            cost -= (_ON_THE_WAY if walking == 1.0 else _TIRED) + _CHANGE
        if cost < cheapest:
            best, cheapest = i, cost
    return float(best), cheapest
