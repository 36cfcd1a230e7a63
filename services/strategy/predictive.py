"""The predictive strategy: plans pushes in a model of this object, instead of a rule for all."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from runtime.messages import PushGoal, PushPlan
from runtime.time import nanoseconds
from services.geometry.angles import difference
from services.geometry.corridor import CorridorGeometry
from services.geometry.wire import polyline
from services.predictive import plan
from services.predictive.candidates import (
    AHEAD,
    BIAS_OF,
    BODY_OF,
    LEAN_OF,
    SIDE_OF,
    SPEED_OF,
    STAND_OF,
    candidates,
    pairs,
    pushed,
    variants,
)
from services.predictive.estimate import Track
from services.predictive.law import MANOEUVRE, TARGET_X, TARGET_Y
from services.predictive.model import ANISOTROPY, RVX, RVY, VX, VY, YAW, X, Y
from services.predictive.situation import SPACING, Lane
from services.strategy.config import PredictiveConfig

Array = NDArray[np.float64]

_WHEELS = 0.8
"""anisotropy above which an object is taken to have wheels"""
_WITHIN = 0.6
"""share of a goal's precision that plans aim at"""
_COMMITTED, _DISAPPOINTED = 8.0, 15.0
"""s for which a plan that began with a walk is held, unless it costs so many s more than it promised"""
_BEGUN = 1.2
"""s after the walk in which it is"""
_TICK = 0.15
"""s that a plan ages at most from one to the next"""
_IDLE = 8.0
"""s for which nothing moves before others are tried"""
_WHIM, _WILDEST = 0.7, 10.0
"""s of whim for each s of that, and s at most"""
_WHIM_HELD, _LED_NOWHERE = 15.0, 15.0
"""s on top of all others while one is being tried, and on what stood and is near to it"""
_EVERY = 1.0
"""s between whims while the robot stands"""
_STANDING = 0.02
"""m/s of a robot that stands"""
_MOVED = 0.03
"""m that an object moves, where it does"""
_JUDGED = 1.5
"""s that the task is given to judge whether what lies within the precision is delivered"""
_PAIRS, _VARIANTS = 24, 36
_CANDIDATES = candidates()
_WAIT = _CANDIDATES[0]


@dataclass
class PlannerState:
    """What the planner goes on from.

    Attributes:
        track: where robot and object are.
        favourite: the candidate in force, (CANDIDATE,); empty for none.
        generator: draws candidates.
        walking: 1 while the robot walks around the object; pushing: it pushes.
        chosen: when the favourite was chosen, ns.
        promised: its cost then, s.
        planned: when the last plan was made, ns.
        anchor: where the object was when it moved last, m, m, rad; since: when, ns.
        tried: when a whim was followed last, ns.
        walked: when the robot last walked around the object, ns.
        arrived: when the object was first seen to lie within the precision since it moved last, ns; 0: not yet.
        rolls: the object was taken to have wheels in this push.
    """

    track: Track = field(default_factory=Track)
    favourite: list[float] = field(default_factory=list)
    generator: np.random.Generator = field(default_factory=lambda: np.random.Generator(np.random.PCG64(1)))
    walking: float = 0.0
    pushing: bool = False
    chosen: int = 0
    promised: float = 0.0
    planned: int = 0
    anchor: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    since: int = 0
    tried: int = 0
    walked: int = 0
    arrived: int = 0
    rolls: bool = False


def choose(
    state: PlannerState,
    config: PredictiveConfig,
    corridor: CorridorGeometry,
    lane: Lane,
    base: Array,
    contour: Array,
    response: Array,
    windows: int,
    goal: PushGoal,
    now: int,
) -> tuple[Array, PushPlan]:
    """Return the target t, (2,), and the plan that it belongs to.

    Args:
        state: is carried on.
        lane: of `corridor`.
        base, contour, response: see `services.predictive.model`.
        windows: how many observations of the response there are.
        now: ns, when the plan takes effect.
    """
    start = state.track.at(now, base, contour, response)
    settings = np.empty(plan.SETTINGS)
    # Slower while the object is a stranger, and with wheels, which roll on.
    state.rolls = state.rolls or bool(response[ANISOTROPY] > _WHEELS and windows >= config.acquainted)
    share = config.wheels if state.rolls else 1.0
    speed = config.speed * min(share, config.caution if windows < config.acquainted else 1.0)
    approach = config.approach * share**2
    settings[[plan.HORIZON, plan.SPEED_FULL, plan.APPROACH]] = config.horizon, speed, approach
    settings[[plan.SLOWEST, plan.MARGIN, plan.PRECISION]] = config.slowest, config.margin, _WITHIN * goal.precision
    settings[plan.SPEED_WALK] = config.speed
    settings[[plan.GOAL_YAW, plan.TURNED]] = 0.0, math.pi
    turned = goal.HasField("yaw")
    if turned:
        settings[[plan.GOAL_YAW, plan.TURNED]] = goal.yaw, _WITHIN * goal.yaw_precision
    index = lane.nearest(start[X], start[Y])
    where = corridor.field.grid
    _follow(state, start, contour, goal, now)
    # Who walks around and thinks better of it halfway, again and again, gets nowhere.
    begun = state.chosen < state.walked and now - state.walked < nanoseconds(_BEGUN)
    held = bool(state.favourite) and begun and now - state.chosen < nanoseconds(_COMMITTED)
    row = np.array(state.favourite or _CANDIDATES[0])

    def rolled(row: Array) -> tuple[float, Array]:
        trace = np.zeros((int(config.horizon / plan.STEP) + 1, 4))
        cost = plan.rollout(
            start, state.walking, row, base, contour, response, settings,
            lane.path, lane.width, SPACING, index, *where, trace, np.inf,
        )  # fmt: skip
        return cost, trace

    waits = _waits(state, start, goal, now)
    if waits:
        settings[[plan.PRECISION, plan.TURNED]] = goal.precision, goal.yaw_precision if turned else math.pi
        row = _WAIT
        cost, trace = rolled(row)
    elif held:
        cost, trace = rolled(row)
        held = cost < state.promised + _DISAPPOINTED
    if not held and not waits:
        near = variants(row, _VARIANTS, state.generator)
        rows = np.concatenate([_CANDIDATES, pairs(_PAIRS, state.generator), near, row[None]])
        favourite = len(rows) - 1 if state.favourite else -1
        whims = _whims(state, start, len(rows), now)
        best, _ = plan.choose(
            start, state.walking, rows, whims, base, contour, response, settings,
            lane.path, lane.width, SPACING, index, *where, favourite,
        )  # fmt: skip
        if int(best) != favourite:
            row = rows[int(best)]
            state.favourite, state.chosen = row.tolist(), now
        cost, trace = rolled(row)
        if state.chosen == now:
            state.promised = cost
    manoeuvre = np.empty(MANOEUVRE)
    plan.manoeuvre_of(lane.path, lane.width, SPACING, index, start, row, settings, manoeuvre)
    shown = trace[(trace != 0.0).any(axis=1)][:: plan.SHOWN]
    message = PushPlan(
        ahead=row[AHEAD],
        bias=row[BIAS_OF],
        speed=row[SPEED_OF],
        side=row[SIDE_OF],
        body=row[BODY_OF],
        stand=row[STAND_OF],
        lean=row[LEAN_OF],
        cost=cost,
        object_path=polyline(shown[:, :2]),
        robot_path=polyline(shown[:, 2:]),
        speed_full=speed,
        speed_walk=config.speed,
        approach=approach,
        slowest=config.slowest,
        margin=config.margin,
    )
    return manoeuvre[[TARGET_X, TARGET_Y]], message


def _follow(state: PlannerState, start: Array, contour: Array, goal: PushGoal, now: int) -> None:
    """Carry on with what has been done and seen since the plan before: walks, pushes, whether the object moves."""
    passed = now - state.planned
    if passed > nanoseconds(_TICK):
        # Nobody planned: the object was lost, or the base stood. That time is nobody's fault.
        state.since += passed - nanoseconds(_TICK)
        passed = nanoseconds(_TICK)
    state.planned = now
    if state.walking == 1.0:
        state.walked = now
    elif state.favourite and state.pushing:
        left = pushed(np.array(state.favourite), 1e-9 * passed)
        if state.favourite[BODY_OF] > 0.0 and left[BODY_OF] <= 0.0:
            state.chosen = now - nanoseconds(_COMMITTED)  # it has done what it was chosen for
        state.favourite = left.tolist()
    turn = 0.0
    if goal.HasField("yaw"):  # only then is the orientation surely seen
        turn = contour.mean() * difference(float(start[YAW]), state.anchor[2])
    if math.hypot(start[X] - state.anchor[0], start[Y] - state.anchor[1], turn) > _MOVED:
        state.anchor, state.since = [float(start[X]), float(start[Y]), float(start[YAW])], now


def _waits(state: PlannerState, start: Array, goal: PushGoal, now: int) -> bool:
    """Tell whether to wait for the task's judgement: who pushes on meanwhile pushes it out again.

    Plans aim at less than the precision, and noise keeps the task from judging at once.
    """
    gx, gy = goal.position.x - start[X], goal.position.y - start[Y]
    there = math.hypot(gx, gy) <= goal.precision and math.hypot(start[VX], start[VY]) < plan.AT_REST
    if goal.HasField("yaw"):
        there = there and abs(difference(float(start[YAW]), goal.yaw)) <= goal.yaw_precision
    if state.since > state.arrived:
        state.arrived = 0
    if not there:
        return False
    state.arrived = state.arrived or now
    return now - state.arrived < nanoseconds(_JUDGED)


def _whims(state: PlannerState, start: Array, count: int, now: int) -> Array:
    """Return what is on top of the costs of `count` candidates, (count,), s, the favourite last: nothing as a rule.

    Where the object has not moved for long, the plan has come to where all that the model promises is nothing, or is
    not true. Then one that is not much dearer is drawn, the longer the freer, and is given time before the next.
    """
    idle = 1e-9 * (now - state.since) - _IDLE
    if idle <= 0.0:
        return np.zeros(count)
    moving = math.hypot(start[RVX], start[RVY]) > _STANDING
    if (moving and now - state.chosen < nanoseconds(_COMMITTED)) or now - state.tried < nanoseconds(_EVERY):
        kept = np.full(count, _WHIM_HELD)
        kept[-1] = 0.0
        return kept
    state.chosen = state.tried = now
    drawn = min(_WHIM * idle, _WILDEST) * state.generator.uniform(size=count)
    # What is near to what has led nowhere leads there too.
    drawn[-1 - _VARIANTS :] += _LED_NOWHERE
    return drawn
