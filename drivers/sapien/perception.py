"""Perception by truth: stands in for mapping and tracker, with noise and delay like theirs."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from drivers.angles import wrap
from drivers.sapien.config import TruthPerceptionConfig
from drivers.sapien.occupancy import rasterise
from runtime import topics
from runtime.messages import ObjectState, OccupancyGrid, Pose2, RobotPose, Truth, Vector2, Visibility
from runtime.service import Effects, Input, Output, Service, Timer, on
from runtime.time import Time, nanoseconds, seconds

_PERIOD = 0.01


@dataclass
class PerceptionState:
    """What is on its way: positions with their noise, each with the time at which it is to be published."""

    generator: np.random.Generator
    mapped: bool = False
    robots: list[tuple[Time, RobotPose]] = field(default_factory=list)
    objects: list[tuple[Time, ObjectState]] = field(default_factory=list)


@dataclass
class BlindState(PerceptionState):
    """The state where the scene has blind spells.

    Attributes:
        began: ns, when the first truth came.
        seen: the object as it was seen last.
    """

    began: Time = 0
    seen: ObjectState | None = None


@dataclass
class ChangingState(BlindState):
    """The state where obstacles of the scene come and go.

    Attributes:
        version: of the map that was published last.
    """

    version: int = 0


class TruthPerception(Service):
    """Publishes robot/pose, map and object/state from the simulation's truth."""

    name = "perception"
    sees_truth = True
    Config = TruthPerceptionConfig

    truth = Input(topics.TRUTH)
    robot = Output(topics.ROBOT_POSE)
    map = Output(topics.MAP)
    object = Output(topics.OBJECT_STATE)
    tick = Timer(_PERIOD)

    config: TruthPerceptionConfig
    state: PerceptionState

    def __init__(self, config: TruthPerceptionConfig) -> None:
        super().__init__(config)
        kind = BlindState if config.scene.blind else PerceptionState
        if config.scene.changes():
            kind = ChangingState
        self.state = kind(np.random.Generator(np.random.PCG64(config.seed)))

    @on(truth)
    def observe(self, truth: Truth, now: Time) -> Effects:
        """Blur what is true, and keep it until its delay has passed."""
        config, generator = self.config, self.state.generator
        draws = [float(draw) for draw in generator.standard_normal(6)]
        delays = generator.uniform(config.latency_low, config.latency_high, 2)
        robot = Pose2(
            x=truth.robot.x + config.robot_noise * draws[0],
            y=truth.robot.y + config.robot_noise * draws[1],
            theta=wrap(truth.robot.theta + config.robot_yaw_noise * draws[2]),
        )
        position, heading = config.robot_noise**2, config.robot_yaw_noise**2
        self.state.robots.append(
            (
                now + nanoseconds(float(delays[0])),
                RobotPose(
                    stamp=truth.stamp,
                    pose=robot,
                    covariance=[position, 0, 0, 0, position, 0, 0, 0, heading],
                    driver_sequence=truth.driver_sequence,
                ),
            )
        )
        spot = Vector2(
            x=truth.object.x + config.object_noise * draws[3],
            y=truth.object.y + config.object_noise * draws[4],
        )
        seen = ObjectState(
            stamp=truth.stamp,
            position=spot,
            diameter=config.object_diameter,
            covariance=[config.object_noise**2, 0, 0, config.object_noise**2],
            visibility=Visibility.VISIBLE,
        )
        if config.yaw:
            seen.yaw = wrap(truth.object.theta + config.object_yaw_noise * draws[5])
            seen.yaw_variance = config.object_yaw_noise**2
        if isinstance(self.state, BlindState):
            seen = self._tracked(self.state, seen, now)
        self.state.objects.append((now + nanoseconds(float(delays[1])), seen))
        if not self.state.mapped:
            self.state.mapped = True
            yield self.map(self._grid(now, 1, 0.0))
        if isinstance(self.state, ChangingState):
            since = seconds(now - self.state.began)
            version = 1 + sum(moment <= since for moment in config.scene.changes())
            if version > max(1, self.state.version):
                self.state.version = version
                yield self.map(self._grid(now, version, since))

    @on(tick)
    def publish(self, now: Time) -> Effects:
        """Publish what is due, in the order in which it was seen."""
        while self.state.robots and self.state.robots[0][0] <= now:
            yield self.robot(self.state.robots.pop(0)[1])
        while self.state.objects and self.state.objects[0][0] <= now:
            yield self.object(self.state.objects.pop(0)[1])

    def _tracked(self, state: BlindState, there: ObjectState, now: Time) -> ObjectState:
        """Return what a tracker says of the object: in a blind spell that it is lost, and where it was seen last."""
        if not state.mapped:
            state.began = now
        since = seconds(now - state.began)
        if not any(spell.begin <= since < spell.end for spell in self.config.scene.blind):
            state.seen = there
            return there
        lost = ObjectState(diameter=there.diameter)
        if state.seen is not None:
            lost.CopyFrom(state.seen)
        lost.stamp, lost.visibility = there.stamp, Visibility.LOST
        return lost

    def _grid(self, now: Time, version: int, since: float) -> OccupancyGrid:
        grid = rasterise(self.config.scene, self.config.map_resolution, since)
        height, width = grid.cells.shape
        return OccupancyGrid(
            stamp=now,
            version=version,
            resolution=grid.resolution,
            width=width,
            height=height,
            origin=Vector2(x=grid.origin[0], y=grid.origin[1]),
            cells=grid.cells.tobytes(),
        )
