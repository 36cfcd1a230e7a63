"""Judges a push by the simulation's truth, with the paper's definition of success (Sec. 6.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.stats import binomtest

from experiments.session import Session
from runtime import topics
from runtime.local import PushResult
from runtime.messages import Corridor, FailureCause, PushOutcome, Truth
from runtime.sample import Sample
from services.geometry.angles import difference
from services.geometry.corridor import CorridorGeometry
from services.geometry.wire import geometry


@dataclass(frozen=True)
class Score:
    """What a push was worth.

    Attributes:
        success: the true distance to the goal is within the precision, in time, and neither centre ever left the
            pushing corridor by more than `TOLERANCE`; where an orientation is asked for, the true one is within its
            precision.
        cause: of a failure, in words; empty for a success.
        distance: m, true, at the end.
        robot_length, object_length: L_Qr and L_Qo, m, true.
        time: s, from goal to end.
        robot_depth, object_depth: m, least depth of the true centres in the pushing corridor.
        hits: ticks in which robot or object touched walls or furniture.
        turned: rad, true, of the object's orientation from the wanted one at the end; None if none was wanted.
    """

    success: bool
    cause: str
    distance: float
    robot_length: float
    object_length: float
    time: float
    robot_depth: float
    object_depth: float
    hits: int
    turned: float | None = None


TOLERANCE = 0.0
"""m that a true centre may be outside the corridor."""


class Judge:
    """A sink that follows the truth of one push."""

    def __init__(self) -> None:
        self._corridor: CorridorGeometry | None = None
        self._robot: list[tuple[float, float]] = []
        self._object: list[tuple[float, float]] = []
        self._depth = (math.inf, math.inf)
        self._yaw = 0.0
        self._hits = 0
        self._active = True

    def __call__(self, sample: Sample) -> None:
        """Take note of truth and corridor."""
        if sample.topic == topics.CORRIDOR.name:
            self._corridor = geometry(Corridor.FromString(sample.payload))
        elif sample.topic == topics.TRUTH.name and self._corridor is not None:
            self._follow(Truth.FromString(sample.payload), self._corridor)

    def score(self, session: Session, result: PushResult) -> Score:
        """Return what the push of `session` was worth."""
        goal = np.array((session.goal.position.x, session.goal.position.y))
        distance = math.dist(self._object[-1], goal) if self._object else math.inf
        precision = session.goal.precision or session.effective.sections["task"].precision  # type: ignore[attr-defined]
        robot_depth, object_depth = self._depth
        status = result.status
        cause = ""
        if robot_depth < -TOLERANCE:
            cause = "robot out"
        elif object_depth < -TOLERANCE:
            cause = "object out"
        elif status.outcome != PushOutcome.DELIVERED:
            cause = FailureCause.Name(status.cause).lower().replace("_", " ")
        elif distance > precision:
            cause = "not within precision"
        turned = None
        if session.goal.HasField("yaw"):
            task = session.effective.sections["task"]
            turned = abs(difference(self._yaw, session.goal.yaw))
            if not cause and turned > (session.goal.yaw_precision or task.yaw_precision):  # type: ignore[attr-defined]
                cause = "not turned"
        return Score(
            success=not cause,
            cause=cause,
            distance=distance,
            robot_length=_length(self._robot),
            object_length=_length(self._object),
            time=status.elapsed,
            robot_depth=robot_depth,
            object_depth=object_depth,
            hits=self._hits,
            turned=turned,
        )

    def _follow(self, truth: Truth, corridor: CorridorGeometry) -> None:
        self._robot.append((truth.robot.x, truth.robot.y))
        self._object.append((truth.object.x, truth.object.y))
        self._yaw = truth.object.theta
        self._depth = (
            min(self._depth[0], corridor.field.value(truth.robot.x, truth.robot.y)),
            min(self._depth[1], corridor.field.value(truth.object.x, truth.object.y)),
        )
        self._hits += truth.robot_hit or truth.object_hit


def wilson(successes: int, trials: int) -> tuple[float, float]:
    """Return the Wilson 95 % interval of a success rate."""
    interval = binomtest(successes, trials).proportion_ci(confidence_level=0.95, method="wilson")
    return float(interval.low), float(interval.high)


def _length(points: list[tuple[float, float]]) -> float:
    return sum(math.dist(a, b) for a, b in pairwise(points))
