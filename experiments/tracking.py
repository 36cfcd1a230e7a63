"""How well mapping and tracker know where things are: pushes from sensors, with every message beside the truth."""

from __future__ import annotations

import math
import multiprocessing
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from experiments.beyond.cases import SENSES
from experiments.paper.cells import HOUSEHOLD, SHAPES
from experiments.paper.tables import Table
from experiments.session import prepare, run
from runtime.config.layers import Layer
from runtime.messages import ObjectState, RobotPose, Truth, Visibility
from runtime.sample import Sample
from services.geometry.pose import between

Array = NDArray[np.float64]

NEAREST, FARTHEST = 0.5, 2.5
"""m from the base to the object at the starts of the first and of the last run; from there the base comes to it"""
LIMIT = 25.0
"""s of a run"""
SCENES = ("living-room", "2A", "childrens-room", "1A")
BINS = ((0.0, 0.6), (0.6, 1.2), (1.2, 1.8), (1.8, 2.6))
"""m from the base's centre to the object's"""
_CHI2 = 5.99
"""that the squared normalised error of two numbers exceeds once in twenty"""


@dataclass
class Watched:
    """A sink that sets what is said of robot and object beside the truth of the same time.

    Attributes:
        robot: (x, y, theta) off, m and rad.
        object: distance, error on the map and as seen from the base, m, squared normalised error, for each state.
        said: how often the object was visible, predicted, lost.
    """

    robot: list[tuple[float, float, float]] = field(default_factory=list)
    object: list[tuple[float, float, float, float]] = field(default_factory=list)
    said: dict[int, int] = field(default_factory=dict)
    _truth: dict[int, Truth] = field(default_factory=dict)
    _poses: dict[int, Array] = field(default_factory=dict)

    def __call__(self, sample: Sample) -> None:
        """Take note of truth, robot and object."""
        if sample.topic == "truth":
            truth = Truth.FromString(sample.payload)
            self._truth[truth.stamp] = truth
        elif sample.topic == "robot/pose":
            self._localised(RobotPose.FromString(sample.payload))
        elif sample.topic == "object/state":
            self._seen(ObjectState.FromString(sample.payload))

    def _localised(self, said: RobotPose) -> None:
        truth = self._truth.get(said.stamp)
        if truth is None:
            return
        self._poses[said.stamp] = np.array((said.pose.x, said.pose.y, said.pose.theta))
        off = self._poses[said.stamp] - (truth.robot.x, truth.robot.y, truth.robot.theta)
        self.robot.append((off[0], off[1], math.remainder(off[2], math.tau)))

    def _seen(self, said: ObjectState) -> None:
        self.said[said.visibility] = self.said.get(said.visibility, 0) + 1
        truth, pose = self._truth.get(said.stamp), self._poses.get(said.stamp)
        if truth is None or pose is None or said.visibility == Visibility.LOST:
            return
        robot, there = (np.array((one.x, one.y, 0.0)) for one in (truth.robot, truth.object))
        robot[2] = truth.robot.theta
        place = np.array((said.position.x, said.position.y, 0.0))
        off, seen_off = (place - there)[:2], (between(pose, place) - between(robot, there))[:2]
        squared = float(off @ np.linalg.solve(np.array(said.covariance).reshape(2, 2), off))
        distance = float(np.hypot(*(there - robot)[:2]))
        self.object.append((distance, float(np.hypot(*off)), float(np.hypot(*seen_off)), squared))


def watch(job: tuple[str, int, int, int, list[Layer]]) -> Watched:
    """Carry out one run; `job` is the way of seeing, the number of the run, of how many, the seed, and layers."""
    sense, k, runs, seed, layers = job
    things = (*HOUSEHOLD, *SHAPES)
    values = {
        "scene": SCENES[k % len(SCENES)],
        "object": things[k % len(things)],
        "seed": seed + k,
        "distance": round(NEAREST + (FARTHEST - NEAREST) * k / max(runs - 1, 1), 3),
        "time_limit": LIMIT,
        "strategy": "predictive",
        "controller": "predictive",
    }
    watched = Watched()
    own = [Layer("experiment tracking", {"sim": values}), Layer(sense, SENSES[sense])]
    run(prepare([*layers, *own]), sinks=[watched])
    return watched


def carried_out(
    senses: Sequence[str], runs: int, seed: int, jobs: int, layers: list[Layer]
) -> Iterator[tuple[str, Watched]]:
    """Yield what was watched, run by run."""
    wanted = [(sense, k, runs, seed, layers) for k in range(runs) for sense in senses]
    # Fresh processes: SAPIEN and numba have threads, which a fork would not take along.
    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        yield from zip((one[0] for one in wanted), pool.map(watch, wanted), strict=True)


def table(found: dict[str, list[Watched]]) -> Table:
    """Return the errors of each way of seeing, over all its runs and by distance."""
    rows = []
    for sense, runs in found.items():
        seen = np.array([row for one in runs for row in one.object]).reshape(-1, 4)
        robot = np.array([row for one in runs for row in one.robot]).reshape(-1, 3)
        said = {kind: sum(one.said.get(kind, 0) for one in runs) for kind in Visibility.values()}
        total = max(sum(said.values()), 1)
        shares = [f"{100 * said[kind] / total:.1f} %" for kind in (Visibility.PREDICTED, Visibility.LOST)]
        off = np.hypot(robot[:, 0], robot[:, 1])
        for low, high in ((0.0, math.inf), *BINS):
            some = seen[(seen[:, 0] >= low) & (seen[:, 0] < high)]
            if not len(some):
                continue
            whole = high == math.inf
            rows.append(
                (
                    sense, "all" if whole else f"{low:g} to {high:g}", str(len(some)), *_told(some[:, 2]),
                    *_told(some[:, 1]), f"{100 * np.mean(some[:, 3] > _CHI2):.0f} %",
                    *(shares if whole else ["", ""]), *(_told(off) if whole else ["", ""]),
                    f"{math.degrees(float(np.abs(robot[:, 2]).mean())):.2f}" if whole else "",
                )
            )  # fmt: skip
    headings = (
        "seen by", "distance (m)", "states", "from the base: mean (mm)", "95 % (mm)", "on the map: mean (mm)",
        "95 % (mm)", "beyond its 95 % ellipse", "predicted", "lost", "robot: mean (mm)", "95 % (mm)", "turn (degrees)",
    )  # fmt: skip
    return Table("Where things are said to be, off the truth", headings, tuple(rows))


def _told(errors: Array) -> tuple[str, str]:
    return f"{1000 * errors.mean():.0f}", f"{1000 * np.quantile(errors, 0.95):.0f}"
