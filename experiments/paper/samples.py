"""Single pushes run again for the plots: their trajectories, and what the learner knew during them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from drivers.sapien.scene import Scene
from experiments.paper.cells import Task
from experiments.paper.trial import session_of
from experiments.scoring import Judge, Score
from experiments.session import run
from runtime import topics
from runtime.config.layers import Layer
from runtime.messages import Corridor, Polyline, PushBehaviour, Truth
from runtime.sample import Sample

Array = NDArray[np.float64]


@dataclass
class Push:
    """A push to be drawn: truth (N, 2), m, map frame; edges as polylines; (time s, mu, kappa) of the learner."""

    task: Task
    scene: Scene
    score: Score
    robot: Array
    object: Array
    path: Array
    edges: list[Array]
    learned: Array


@dataclass
class _Follower:
    robot: list[tuple[float, float]] = field(default_factory=list)
    object: list[tuple[float, float]] = field(default_factory=list)
    corridor: Corridor = field(default_factory=Corridor)
    learned: list[tuple[float, float, float]] = field(default_factory=list)

    def __call__(self, sample: Sample) -> None:
        if sample.topic == topics.TRUTH.name:
            truth = Truth.FromString(sample.payload)
            self.robot.append((truth.robot.x, truth.robot.y))
            self.object.append((truth.object.x, truth.object.y))
        elif sample.topic == topics.CORRIDOR.name:
            self.corridor = Corridor.FromString(sample.payload)
        elif sample.topic == topics.PUSH_BEHAVIOUR.name:
            known = PushBehaviour.FromString(sample.payload)
            self.learned.append((known.stamp * 1e-9, known.mu, known.kappa))


def follow(task: Task, layers: Sequence[Layer]) -> Push:
    """Run `task` and return what there is to draw."""
    session, judge, follower = session_of(task, layers), Judge(), _Follower()
    score = judge.score(session, run(session, sinks=[judge, follower]))
    scene = session.world.scene
    return Push(
        task=task,
        scene=scene,
        score=score,
        robot=np.array(follower.robot).reshape(-1, 2),
        object=np.array(follower.object).reshape(-1, 2),
        path=points(follower.corridor.path),
        edges=[points(edge) for edge in follower.corridor.edge_push],
        learned=np.array(follower.learned).reshape(-1, 3),
    )


def points(line: Polyline) -> Array:
    """Return the points of a polyline message, (N, 2), m."""
    return np.column_stack([np.asarray(line.x, np.float64), np.asarray(line.y, np.float64)])
