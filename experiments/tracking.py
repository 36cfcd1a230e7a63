"""How well mapping and tracker know where things are: pushes from sensors, with every message beside the truth."""

from __future__ import annotations

import math
import multiprocessing
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.sapien.occupancy import OCCUPIED, rasterise
from drivers.sapien.scene import Scene
from experiments.beyond.cases import SENSES
from experiments.paper.cells import HOUSEHOLD, SHAPES
from experiments.paper.tables import Table
from experiments.session import prepare, run
from runtime.config.layers import Layer
from runtime.messages import ObjectState, OccupancyGrid, RobotPose, Truth, Visibility
from runtime.sample import Sample
from services.geometry.pose import between
from services.mapping.grid import hollow

Array = NDArray[np.float64]

NEAREST, FARTHEST = 0.5, 2.5
"""m from the base to the object at the starts of the first and of the last run; from there the base comes to it"""
LIMIT = 25.0
"""s of a run"""
SCENES = ("living-room", "2A", "childrens-room", "1A")
BINS = ((0.0, 0.6), (0.6, 1.2), (1.2, 1.8), (1.8, 2.6))
"""m from the base's centre to the object's"""
NOT_SEEN = -1
"""beside the kinds of visibility: before the object is found"""
_CHI2 = 5.99
"""that the squared normalised error of two numbers exceeds once in twenty"""
_FINE = 0.005
"""m, cells of the truth that maps are held against"""


@dataclass
class Watched:
    """A sink that sets what is said of robot and object beside the truth of the same time.

    Attributes:
        robot: (x, y, theta) off, m and rad, and squared normalised error.
        object: distance, error on the map and as seen from the base, m, squared normalised error, for each state.
        times: how long the object was visible, predicted, lost or, NOT_SEEN, not found yet, in truths.
        map: as published last.
    """

    robot: list[tuple[float, float, float, float]] = field(default_factory=list)
    object: list[tuple[float, float, float, float]] = field(default_factory=list)
    times: dict[int, int] = field(default_factory=dict)
    map: bytes = b""
    _now: int = NOT_SEEN
    _truth: dict[int, Truth] = field(default_factory=dict)
    _poses: dict[int, Array] = field(default_factory=dict)

    def __call__(self, sample: Sample) -> None:
        """Take note of truth, robot and object."""
        if sample.topic == "truth":
            truth = Truth.FromString(sample.payload)
            self._truth[truth.stamp] = truth
            self.times[self._now] = self.times.get(self._now, 0) + 1
        elif sample.topic == "robot/pose":
            self._localised(RobotPose.FromString(sample.payload))
        elif sample.topic == "object/state":
            self._seen(ObjectState.FromString(sample.payload))
        elif sample.topic == "map":
            self.map = sample.payload

    def _localised(self, said: RobotPose) -> None:
        truth = self._truth.get(said.stamp)
        if truth is None:
            return
        self._poses[said.stamp] = np.array((said.pose.x, said.pose.y, said.pose.theta))
        off = self._poses[said.stamp] - (truth.robot.x, truth.robot.y, truth.robot.theta)
        off[2] = math.remainder(off[2], math.tau)
        squared = float(off @ np.linalg.solve(np.array(said.covariance).reshape(3, 3), off))
        self.robot.append((off[0], off[1], off[2], squared))

    def _seen(self, said: ObjectState) -> None:
        self._now = said.visibility
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


@dataclass(frozen=True)
class Run:
    """What came of one run.

    Attributes:
        robot: (N, 4), object: (M, 4), times: see `Watched`.
        surfaces: (K,), m, what is occupied on the map at the end is off the nearest true surface.
    """

    robot: Array
    object: Array
    times: dict[int, int]
    surfaces: Array


def off_surfaces(drawn: OccupancyGrid, room: Scene) -> Array:
    """Return how far the middles of occupied cells are from the nearest surface of `room`, (K,), m.

    Only of those beside free ones: the inside of a plan's walls is no surface.
    """
    truth = rasterise(room, _FINE)
    taken = (truth.cells > 0).astype(np.uint8)
    outside = cv2.distanceTransform(1 - taken, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    inside = cv2.distanceTransform(taken, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    off = (np.maximum(outside, inside) - 0.5) * _FINE
    cells = np.frombuffer(drawn.cells, np.uint8).reshape(drawn.height, drawn.width)
    rows, columns = np.nonzero(hollow(cells) == OCCUPIED)
    places = np.column_stack([columns, rows]) + 0.5
    at = (np.array((drawn.origin.x, drawn.origin.y)) + drawn.resolution * places - truth.origin) / _FINE
    i, j = np.clip(np.floor(at).astype(int), 0, (taken.shape[1] - 1, taken.shape[0] - 1)).T
    return np.asarray(off[j, i], np.float64)


def watch(job: tuple[str, int, int, int, list[Layer]]) -> Run:
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
    session = prepare([*layers, *own])
    run(session, sinks=[watched])
    surfaces = np.empty(0)
    if watched.map:
        surfaces = off_surfaces(OccupancyGrid.FromString(watched.map), session.world.scene)
    robot, object = (np.array(one).reshape(-1, 4) for one in (watched.robot, watched.object))
    return Run(robot, object, watched.times, surfaces)


def carried_out(
    senses: Sequence[str], runs: int, seed: int, jobs: int, layers: list[Layer]
) -> Iterator[tuple[str, Run]]:
    """Yield what was watched, run by run."""
    wanted = [(sense, k, runs, seed, layers) for k in range(runs) for sense in senses]
    # Fresh processes: SAPIEN and numba have threads, which a fork would not take along.
    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        yield from zip((one[0] for one in wanted), pool.map(watch, wanted), strict=True)


def tables(found: dict[str, list[Run]]) -> list[Table]:
    """Return the errors of each way of seeing: of the object, over all runs and by distance, and of robot and map."""
    objects, others = [], []
    for sense, runs in found.items():
        seen = np.concatenate([one.object for one in runs])
        time = {kind: sum(one.times.get(kind, 0) for one in runs) for kind in (NOT_SEEN, *Visibility.values())}
        total = max(sum(time.values()), 1)
        shares = [f"{100 * time[kind] / total:.1f} %" for kind in (Visibility.PREDICTED, Visibility.LOST, NOT_SEEN)]
        for low, high in ((0.0, math.inf), *BINS):
            some = seen[(seen[:, 0] >= low) & (seen[:, 0] < high)]
            if not len(some):
                continue
            whole = high == math.inf
            of_runs = [float(one.object[:, 3].mean()) for one in runs if len(one.object)]
            objects.append(
                (
                    sense, "all" if whole else f"{low:g} to {high:g}", str(len(some)), *_told(some[:, 2]),
                    *_told(some[:, 1]), f"{some[:, 3].mean():.2f}", _spread(of_runs) if whole else "",
                    f"{100 * np.mean(some[:, 3] > _CHI2):.0f} %", *(shares if whole else ["", "", ""]),
                )
            )  # fmt: skip
        robot, surfaces = np.concatenate([one.robot for one in runs]), np.concatenate([one.surfaces for one in runs])
        turned = f"{math.degrees(float(np.abs(robot[:, 2]).mean())):.2f}" if len(robot) else "-"
        others.append(
            (
                sense, str(len(robot)), *_told(np.hypot(robot[:, 0], robot[:, 1])), turned,
                f"{robot[:, 3].mean():.2f}" if len(robot) else "-",
                _spread([float(one.robot[:, 3].mean()) for one in runs if len(one.robot)]),
                str(len(surfaces)), *_told(surfaces),
            )
        )  # fmt: skip
    of_object = (
        "seen by", "distance (m)", "states", "from the base: mean (mm)", "95 % (mm)", "on the map: mean (mm)",
        "95 % (mm)", "normalised, squared (2)", "runs: least, median, most", "beyond its 95 % ellipse", "predicted",
        "lost", "not found yet",
    )  # fmt: skip
    of_others = (
        "seen by", "poses", "robot: mean (mm)", "95 % (mm)", "turn: mean (degrees)", "normalised, squared (3)",
        "runs: least, median, most", "occupied cells", "off the nearest surface: mean (mm)", "95 % (mm)",
    )  # fmt: skip
    return [
        Table("The object: what is said of it, off the truth", of_object, tuple(objects)),
        Table("Robot and map, off the truth", of_others, tuple(others)),
    ]


def _told(errors: Array) -> tuple[str, str]:
    if not len(errors):
        return "-", "-"
    return f"{1000 * errors.mean():.0f}", f"{1000 * np.quantile(errors, 0.95):.0f}"


def _spread(means: list[float]) -> str:
    return " ".join(f"{one:.2f}" for one in np.quantile(means, (0.0, 0.5, 1.0))) if means else "-"
