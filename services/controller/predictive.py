"""The predictive controller: follows the plan of the predictive strategy with the law that the plan was made with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from runtime.messages import PushPlan
from services.geometry.corridor import CorridorGeometry
from services.predictive import candidates
from services.predictive import plan as planning
from services.predictive.law import MANOEUVRE, inside, kept_margin, sparing, turning, wish
from services.predictive.model import ACCELERATION, X, Y
from services.predictive.situation import SPACING, Lane

Array = NDArray[np.float64]


def command(
    state: Array, plan: PushPlan, walking: float, corridor: CorridorGeometry, lane: Lane, base: Array, contour: Array
) -> tuple[Array, float, float]:
    """Return what to send: velocity, (2,), m/s, map frame, and turn, rad/s; and whether the robot walks around (1.0).

    Args:
        state: where robot and object will be when the command takes effect.
        walking: what was returned last.
    """
    settings = np.zeros(planning.SETTINGS)
    settings[planning.SPEED_FULL], settings[planning.APPROACH] = plan.speed_full, plan.approach
    settings[planning.SLOWEST], settings[planning.SPEED_WALK] = plan.slowest, plan.speed_walk
    row = np.zeros(candidates.CANDIDATE)
    row[[candidates.AHEAD, candidates.BIAS_OF, candidates.SPEED_OF]] = plan.ahead, plan.bias, plan.speed
    row[candidates.SIDE_OF] = plan.side
    row[[candidates.BODY_OF, candidates.STAND_OF, candidates.LEAN_OF]] = plan.body, plan.stand, plan.lean
    index = lane.nearest(state[X], state[Y])
    manoeuvre = np.empty(MANOEUVRE)
    planning.manoeuvre_of(lane.path, lane.width, SPACING, index, state, row, settings, manoeuvre)
    ux, uy, walking = wish(state, contour, manoeuvre, walking)
    if walking == 0.0:
        ux, uy = sparing(*corridor.field.grid, state, ux, uy, base[ACCELERATION], lane.width[index])
    u = inside(*corridor.field.grid, state, ux, uy, base[ACCELERATION], kept_margin(plan.margin, lane.width[index]))
    return np.array(u), turning(state, contour), walking
