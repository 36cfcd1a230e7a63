"""The simulated world as the board of a Robotino sees it: `drivers.robotino.plant.Plant`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import msgspec
import numpy as np

from drivers.robotino.kinematics import Twist
from drivers.robotino.plant import LaserReading, Plant
from drivers.sapien.config import SapienConfig
from drivers.sapien.odometry import DriftingOdometry, OdometryState
from drivers.sapien.rays import Outlines, Rooms
from drivers.sapien.sensors import laser_scan, ring_ranges
from drivers.sapien.world import SUBSTEP, World, WorldState
from runtime.time import Time, nanoseconds

_SUBSTEP: Time = nanoseconds(SUBSTEP)
_SLICE = 2
"""substeps between two looks at what the board wants"""
# The board ramps; the world's base is only as slow behind it as its wheels' grip and their loop make it.
_RAMP, _TURN_RAMP, _LAG = 3.0, 30.0, 0.04


@dataclass
class PlantState:
    """What a plant goes on from.

    Attributes:
        origin: ns, when the first event came. world, odometry: theirs, set when a snapshot is given.
    """

    generator: np.random.Generator = field(default_factory=lambda: np.random.Generator(np.random.PCG64(0)))
    origin: Time | None = None
    world: WorldState | None = None
    odometry: OdometryState | None = None


class Board(Protocol):
    """The double of what drives a base."""

    def advance(self, now: float, plant: Plant) -> None:
        """Let time pass up to `now`, s, and tell the plant how its wheels are to turn from now on."""


class SapienPlant:
    """A world with a base whose wheels a board turns; its odometry drifts as that of the direct driver."""

    def __init__(self, config: SapienConfig) -> None:
        self._config = config
        base = config.base
        self._base = msgspec.structs.replace(base, acceleration=_RAMP, angular_acceleration=_TURN_RAMP, lag=_LAG)
        self.world = World(config.scene, config.body, self._base)
        self._rooms = Rooms(config.scene)
        self._odometry = DriftingOdometry.of(self._config.scene.noise, self.world.robot_pose)
        self.state = PlantState(np.random.Generator(np.random.PCG64(config.seed)))

    def freeze(self) -> None:
        """Take the world's state; this rebuilds the world."""
        self.state.world, self.state.odometry = self.world.state(), self._odometry.state

    def thaw(self, state: PlantState) -> None:
        """Go on from a state."""
        assert state.world is not None and state.odometry is not None
        self.state = state
        self.world = World(self._config.scene, self._config.body, self._base)
        self.world.restore(state.world)
        self._odometry = DriftingOdometry.of(self._config.scene.noise, self.world.robot_pose)
        self._odometry.state = state.odometry

    def advance(self, now: Time, board: Board) -> None:
        """Let the world come up to `now`, and the board in short steps with it."""
        if self.state.origin is None:
            self.state.origin = now
        due = (now - self.state.origin) // _SUBSTEP - self.world.substeps
        while due > 0:
            count = min(_SLICE, due)
            self.world.step(count)
            self._odometry.read(self.world.robot_pose, self.state.generator)
            board.advance(self.world.substeps * SUBSTEP, self)
            due -= count

    def drive(self, twist: Twist) -> None:
        """Let the wheels aim at this motion."""
        self.world.command(*twist)

    @property
    def pose(self) -> Twist:
        """Return where the wheels say the base is, from where it began."""
        return self._odometry.state.reading

    @property
    def twist(self) -> Twist:
        """Return how the base moves, base frame."""
        return self.world.robot_twist_base

    @property
    def outlines(self) -> Outlines:
        """Return what sensors can see."""
        return self._rooms.around(self.world.seconds, self._config.body.parts, self.world.object_pose)

    @property
    def distances(self) -> tuple[float, ...]:
        """Return what the infra-red sensors see, with their noise."""
        noise, generator = self._config.scene.noise.ranges, self.state.generator
        found = ring_ranges(self._config.ring, self.world.robot_pose, self.outlines, noise, generator)
        return tuple(float(one) for one in found)

    @property
    def bumper(self) -> bool:
        """Return whether the base touches walls or furniture. What it pushes does not press hard enough."""
        return self.world.robot_hit

    @property
    def scan(self) -> LaserReading | None:
        """Return what the laser sees; 0 where nothing came back."""
        laser, noise = self._config.laser, self._config.scene.noise.scan
        ranges = laser_scan(laser, self.world.robot_pose, self.outlines, noise, self.state.generator)
        shown = np.where(ranges < laser.maximum, ranges, 0.0)
        return LaserReading(-laser.field / 2, laser.field / 2, tuple(float(one) for one in shown))
