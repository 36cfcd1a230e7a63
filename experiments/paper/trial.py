"""Runs one trial of the experiments and says what came of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from experiments.paper.cells import Task
from experiments.scoring import Judge
from experiments.session import Session, prepare, run
from runtime import topics
from runtime.config.layers import Layer
from runtime.local import GoalRefused
from runtime.messages import Corridor, PushTarget, Truth
from runtime.sample import Sample
from services.geometry.corridor import CorridorGeometry
from services.geometry.wire import geometry

Array = NDArray[np.float64]

STEEP = math.radians(45.0)
"""rad between push-lines within REACH for a turn of the push direction to be steep."""

REACH = 0.5
"""m of the object's way that is looked back on"""

REFUSED = "refused"
"""Cause of a trial whose goal was not taken."""


class Outcome(Task, frozen=True, kw_only=True):
    """What came of a trial; for lengths and times see `experiments.scoring.Score`.

    Attributes:
        robot_depth, object_depth: m; None without a corridor.
        distance: m, true, left at the end; None if nothing was seen.
        to_go: m along Q from the object to the goal where the corridor was violated first, or at the end.
        turn: rad, most that the push direction differs there from one while the object was within REACH of there.
        steep: share of the push's targets at which that is STEEP or more: what chance would give.
        turned: rad, true, from the wanted orientation at the end; None if none was wanted.
    """

    success: bool
    cause: str
    distance: float | None
    robot_length: float
    object_length: float
    time: float
    robot_depth: float | None
    object_depth: float | None
    hits: int
    to_go: float | None
    turn: float | None
    steep: float | None
    turned: float | None = None


class Whereabouts:
    """A sink that keeps where the object was when the corridor was violated first, or else where it was last."""

    def __init__(self) -> None:
        self._corridor: CorridorGeometry | None = None
        self._at: tuple[float, float] | None = None
        self._violated = False
        self._lines: list[tuple[float, float, float]] = []

    def __call__(self, sample: Sample) -> None:
        """Take note of truth, corridor and target."""
        if sample.topic == topics.CORRIDOR.name:
            corridor = Corridor.FromString(sample.payload)
            self._corridor = geometry(corridor) if corridor.found else self._corridor
        elif self._corridor is None or self._violated:
            return
        elif sample.topic == topics.TRUTH.name:
            truth = Truth.FromString(sample.payload)
            self._at = truth.object.x, truth.object.y
            depth = self._corridor.field
            self._violated = min(depth.value(truth.robot.x, truth.robot.y), depth.value(*self._at)) < 0.0
        elif sample.topic == topics.PUSH_TARGET.name:
            line = PushTarget.FromString(sample.payload)
            o, t = line.object, line.target
            self._lines.append((o.x, o.y, math.atan2(t.y - o.y, t.x - o.x)))

    def place(self) -> tuple[float, float, float] | None:
        """Return to_go, turn and steep of `Outcome`; None if there was no corridor or no target."""
        if self._corridor is None or self._at is None or not self._lines:
            return None
        turns = turning(np.array(self._lines))
        to_go = self._corridor.distance_to_go(np.array(self._at))
        return to_go, float(turns[-1]), float(np.mean(turns >= STEEP))


def turning(lines: Array, reach: float = REACH) -> Array:
    """Return for each push-line the most that its direction differs from an earlier one's, (N,), rad.

    Args:
        lines: (N, 3), the object's x and y, m, and the direction of the push-line, rad, in the order of time.
        reach: m; looked back on is what came after the object was last farther than that from where it is.
    """
    found = np.zeros(len(lines))
    for k, (x, y, direction) in enumerate(lines):
        far = np.hypot(lines[:k, 0] - x, lines[:k, 1] - y) > reach
        first = int(np.flatnonzero(far)[-1]) + 1 if far.any() else 0
        swing = np.abs((lines[first : k + 1, 2] - direction + math.pi) % math.tau - math.pi)
        found[k] = swing.max()
    return found


def session_of(task: Task, layers: Sequence[Layer]) -> Session:
    """Return the session of `task` under the user's `layers`.

    Raises:
        ConfigError, CannotScale, NoRoomToStart: see there.
    """
    names = ("scene", "object", "strategy", "controller", "precision", "seed", "start")
    own = [Layer("experiment", msgspec.json.decode(task.settings))] if task.settings else []
    return prepare([*layers, *own, Layer("experiment", {"sim": {name: getattr(task, name) for name in names}})])


def attempt(task: Task, layers: Sequence[Layer]) -> Outcome:
    """Run `task`."""
    session, judge, where = session_of(task, layers), Judge(), Whereabouts()
    facts = msgspec.structs.asdict(task)
    try:
        score = judge.score(session, run(session, sinks=[judge, where]))
    except GoalRefused:
        return Outcome(
            **facts, success=False, cause=REFUSED, distance=None, robot_length=0.0, object_length=0.0, time=0.0,
            robot_depth=None, object_depth=None, hits=0, to_go=None, turn=None, steep=None,
        )  # fmt: skip
    place = where.place()
    return Outcome(
        **facts,
        success=score.success,
        cause=score.cause,
        distance=_finite(score.distance),
        robot_length=score.robot_length,
        object_length=score.object_length,
        time=score.time,
        robot_depth=_finite(score.robot_depth),
        object_depth=_finite(score.object_depth),
        hits=score.hits,
        to_go=place[0] if place else None,
        turn=place[1] if place else None,
        steep=place[2] if place else None,
        turned=score.turned,
    )


def record(task: Task, layers: Sequence[Layer], file: Path) -> None:
    """Run `task` once more, recording it: the same seed gives the same push.

    Raises:
        CannotRecord: see there.
    """
    part = file.with_suffix(".part")
    run(session_of(task, layers), part, overwrite=True)
    part.replace(file)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
