"""Drives a mapping service through the room of `rooms`, with a laser and an odometry that errs."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp

from runtime.messages import (
    LaserScan,
    Log,
    ObjectState,
    OccupancyGrid,
    Odometry,
    Pose2,
    RobotPose,
    RobotStatus,
    Vector2,
    Visibility,
)
from runtime.service import Publication
from runtime.time import SECOND, Time
from services.geometry.pose import between, compose
from services.mapping.config import MappingConfig
from services.mapping.service import MappingService
from tests.services.mapping.rooms import ANGLES, MOUNT, ROUND, WALLS, Array, ranges_at

START = np.array([0.8, 0.8, 0.0])
PERIOD = SECOND // 20
OBJECT = np.array([1.6, 0.9])
DIAMETER = 0.3


def square(x: float, y: float, side: float) -> Array:
    """Return the walls of a square thing."""
    h = side / 2
    corners = [(x - h, y - h), (x + h, y - h), (x + h, y + h), (x - h, y + h)]
    return np.array([[corners[k], corners[(k + 1) % 4]] for k in range(4)])


def path() -> list[Array]:
    """Return poses 0.05 s apart, at 0.3 m/s along the round, looking ahead."""
    poses = [START] * 20
    for (x0, y0), (x1, y1) in zip(ROUND[:-1], ROUND[1:], strict=True):
        length, heading = math.hypot(x1 - x0, y1 - y0), math.atan2(y1 - y0, x1 - x0)
        turn = math.remainder(heading - poses[-1][2], math.tau)
        steps = math.ceil(abs(turn) / 0.05)
        first = poses[-1][2]
        poses += [np.array([x0, y0, first + turn * k / steps]) for k in range(1, steps + 1)]
        count = math.ceil(length / 0.015)
        poses += [
            np.array([x0 + (x1 - x0) * k / count, y0 + (y1 - y0) * k / count, heading]) for k in range(1, count + 1)
        ]
    return poses


@dataclass
class Drive:
    """A mapping service on a robot whose odometry errs by a share of every step; scans come at every second step."""

    service: MappingService
    walls: Array = field(default_factory=lambda: WALLS)
    object: Array | None = None
    seen: Visibility.ValueType = Visibility.VISIBLE
    blind: bool = False
    now: Time = SECOND
    odometry: Array = field(default_factory=lambda: np.zeros(3))
    last: Array | None = None
    generator: np.random.Generator = field(default_factory=lambda: np.random.Generator(np.random.PCG64(3)))
    poses: list[RobotPose] = field(default_factory=list)
    maps: list[OccupancyGrid] = field(default_factory=list)
    logs: list[str] = field(default_factory=list)
    sequence: int = 0

    def give(self, topic: str, message: Message) -> None:
        """Give the service a message, and keep what it publishes."""
        self.service.latest[topic] = message
        handler = self.service.contract.handlers.get(topic)
        if handler is None:
            return
        for one in getattr(self.service, handler)(message, self.now) or ():
            assert isinstance(one, Publication)
            if isinstance(one.message, RobotPose):
                self.poses.append(one.message)
            if isinstance(one.message, OccupancyGrid):
                self.maps.append(one.message)
            if isinstance(one.message, Log):
                self.logs.append(one.message.message)

    def to(self, pose: Array) -> None:
        """Let 0.05 s pass, in which the robot comes to `pose`."""
        self.now += PERIOD
        self.sequence += 1
        if self.last is not None:
            step = between(self.last, pose)
            way = math.hypot(step[0], step[1])
            error = self.generator.standard_normal(3) * (0.1 * way, 0.1 * way, 0.05 * abs(step[2]) + 0.04 * way)
            self.odometry = compose(self.odometry, step + error)
        self.last = pose
        x, y, theta = self.odometry
        self.give(
            "odometry", Odometry(stamp=self.now, pose=Pose2(x=x, y=y, theta=theta), driver_sequence=self.sequence)
        )
        if self.object is not None:
            spot = Vector2(x=self.object[0], y=self.object[1])
            self.give(
                "object/state",
                ObjectState(stamp=self.now, position=spot, diameter=DIAMETER, visibility=self.seen),
            )
        if self.sequence % 2 and not self.blind:
            walls = self.walls
            if self.object is not None:
                walls = np.concatenate([walls, square(*self.object, DIAMETER / math.sqrt(2.0))])
            self.give("scan", self.scan(pose, walls))

    def scan(self, pose: Array, walls: Array) -> LaserScan:
        """Return what the laser says at `pose`, with 1 cm of noise."""
        ranges = ranges_at(pose, walls) + 0.01 * self.generator.standard_normal(len(ANGLES))
        scan = LaserScan(
            timestamp=Timestamp(seconds=self.now // SECOND, nanos=self.now % SECOND),
            start_angle=ANGLES[0],
            end_angle=ANGLES[-1],
            ranges=np.minimum(ranges, 10.0).tolist(),
        )
        scan.pose.position.x = MOUNT[0]
        scan.pose.orientation.w = 1.0
        return scan


def drive(**values: object) -> Drive:
    service = MappingService(MappingConfig(start=tuple(START), particles=8, **values))  # type: ignore[arg-type]
    found = Drive(service)
    found.give("status", RobotStatus(diameter=0.45))
    return found


def cell(grid: OccupancyGrid, x: float, y: float) -> int:
    """Return what the map says of a place."""
    i = math.floor((x - grid.origin.x) / grid.resolution)
    j = math.floor((y - grid.origin.y) / grid.resolution)
    if not (0 <= i < grid.width and 0 <= j < grid.height):
        return 255
    return grid.cells[j * grid.width + i]


def occupied_near(grid: OccupancyGrid, place: Array, radius: float) -> bool:
    steps = np.arange(-radius, radius + 1e-9, grid.resolution / 2)
    return any(
        cell(grid, place[0] + dx, place[1] + dy) == 100 for dx in steps for dy in steps if math.hypot(dx, dy) < radius
    )
