"""The mapping service in the room of `rooms`: where it says the robot is, what its map holds, and that it goes on."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp

from runtime.messages import (
    LaserScan,
    ObjectState,
    OccupancyGrid,
    Odometry,
    Pose2,
    RobotPose,
    RobotStatus,
    SeenFloor,
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


@pytest.fixture(scope="module")
def driven() -> tuple[Drive, list[Array]]:
    """Returns a round through the room behind an object that is pushed along, and where the robot was."""
    found, there = drive(), path()
    for pose in there:
        # Pushed straight ahead until the first corner; there it stays behind.
        ahead = pose[:2] + 0.45 * np.array([math.cos(pose[2]), math.sin(pose[2])])
        if pose[0] < 3.0 and pose[1] < 1.0 and pose[2] == 0.0:
            found.object = ahead
        found.to(pose)
    return found, there


def test_the_robot_is_where_it_says(driven: tuple[Drive, list[Array]]) -> None:
    found, there = driven
    off = [math.hypot(one.pose.x - p[0], one.pose.y - p[1]) for one, p in zip(found.poses, there, strict=True)]
    turned = [abs(math.remainder(one.pose.theta - p[2], math.tau)) for one, p in zip(found.poses, there, strict=True)]
    raw = between(compose(START, found.odometry), there[-1])
    assert math.hypot(raw[0], raw[1]) > 0.1, "the odometry is too good to show anything"
    assert np.mean(off) < 0.012 and max(off) < 0.04
    assert np.mean(turned) < 0.006
    assert all(one.driver_sequence == k for k, one in enumerate(found.poses, 1))


def test_its_covariance_covers_its_errors(driven: tuple[Drive, list[Array]]) -> None:
    found, there = driven
    nees = []
    for one, p in zip(found.poses, there, strict=True):
        off = np.array((one.pose.x - p[0], one.pose.y - p[1], math.remainder(one.pose.theta - p[2], math.tau)))
        nees.append(off @ np.linalg.solve(np.array(one.covariance).reshape(3, 3), off))
    # Chi-squared with three numbers: 7.8 is exceeded once in twenty. Errors of a map stay, so some more.
    assert np.mean(np.array(nees) > 7.8) < 0.15


def test_the_map_is_of_the_room_and_the_object_never_in_it(driven: tuple[Drive, list[Array]]) -> None:
    found, _ = driven
    last = found.maps[-1]
    for wall in WALLS:
        for share in np.linspace(0.1, 0.9, 9):
            assert occupied_near(last, wall[0] + share * (wall[1] - wall[0]), 0.12)
    assert cell(last, 3.4, 1.4) == 0 and cell(last, 5.2, 2.0) == 0
    assert cell(last, 1.0, 3.5) == 255
    assert [one.version for one in found.maps] == list(range(1, len(found.maps) + 1))
    for x in np.arange(1.2, 3.3, 0.1):  # the way it was pushed along, and its end
        assert not any(occupied_near(one, np.array([x, 0.8]), 0.12) for one in found.maps)


def test_what_comes_and_goes_is_on_the_map_within_two_seconds() -> None:
    found = drive()
    found.object = OBJECT
    for _ in range(60):
        found.to(START)
    thing = np.array([2.6, 1.6])
    assert cell(found.maps[-1], 2.6, 1.45) == 0
    found.walls = np.concatenate([WALLS, square(*thing, 0.3)])
    for _ in range(40):
        found.to(START)
    assert occupied_near(found.maps[-1], thing, 0.25)
    found.walls = WALLS
    for _ in range(40):
        found.to(START)
    assert not occupied_near(found.maps[-1], thing, 0.25)


def look_down(found: Drive, *stretches: tuple[float, float, float, bool]) -> None:
    """Give the service what the camera, 0.12 m ahead of the base's middle, sees of the floor now."""
    bearing, first, last, met = zip(*stretches, strict=True)
    place = Vector2(x=0.12)
    found.give("floor", SeenFloor(stamp=found.now, position=place, bearing=bearing, first=first, last=last, met=met))


def test_what_the_camera_sees_behind_the_object_is_on_the_map_and_goes_from_it() -> None:
    """The base stands at (0.8, 0.8), heading along x; the object stands ahead, and something where no beam comes."""
    object, thing = np.array([1.3, 0.8]), np.array([2.42, 0.8])
    bearings = np.arange(-0.1, 0.11, 0.02)
    # Of the object its foot is met, and its top, 1.4 times as far; then the floor is seen as far as the thing.
    own = [(b, 0.2, 0.3, True) for b in bearings] + [(b, 0.7, 0.75, True) for b in bearings]
    found = drive()
    found.object = object
    for _ in range(40):
        found.to(START)
        if not found.sequence % 4:
            look_down(found, *own, *[(b, 0.95, 1.42, True) for b in bearings])
    assert occupied_near(found.maps[-1], thing, 0.1)
    assert not occupied_near(found.maps[-1], object, 0.2)
    assert not any(occupied_near(found.maps[-1], np.array([x, 0.8]), 0.1) for x in np.arange(1.4, 2.15, 0.1))
    for _ in range(40):
        found.to(START)
    assert occupied_near(found.maps[-1], thing, 0.1)  # no beam has passed there since
    for _ in range(40):
        found.to(START)
        if not found.sequence % 4:
            look_down(found, *own, *[(b, 0.95, 2.0, False) for b in bearings])
    assert not occupied_near(found.maps[-1], thing, 0.1)


def test_where_a_wall_is_known_the_camera_adds_none_before_it() -> None:
    found = drive()
    found.object = OBJECT
    for _ in range(40):
        found.to(START)
    for off in (0.0, 0.04, 0.08):
        for _ in range(20):
            found.to(START)
            # The wall below the robot, seen a little too near.
            look_down(found, *[(b, 0.3, (0.8 - off) / -math.sin(b), True) for b in np.arange(-1.9, -1.2, 0.02)])
    before = [np.array([x, y]) for x in np.arange(0.5, 1.4, 0.05) for y in (0.1, 0.15)]
    assert not any(occupied_near(found.maps[-1], place, 0.04) for place in before)


def test_floor_that_makes_no_sense_or_is_of_another_time_harms_nothing() -> None:
    found = drive()
    found.object = OBJECT
    look_down(found, (0.0, 0.2, 1.0, True))
    for _ in range(40):
        found.to(START)
    before, now = found.service.snapshot(), found.now
    found.now = SECOND // 100
    look_down(found, (0.0, 0.2, 1.0, True))
    found.now = now + SECOND  # the odometry has stopped: nobody knows from where this was seen
    look_down(found, (0.0, 0.2, 1.0, True))
    found.now = now
    assert found.service.snapshot() == before
    columns = SeenFloor(stamp=found.now, bearing=[0.0], first=[0.1, 0.2], last=[1.0], met=[True])
    (said,) = found.service.looked_down(columns, found.now)  # type: ignore[misc]
    assert "[1, 2, 1, 1]" in said.message.message
    assert found.service.snapshot() == before


def test_an_object_that_was_taken_for_the_room_leaves_the_map_when_it_is_seen() -> None:
    """The tracker is late, or the object was carried while it was lost: until it is seen, it is an obstacle."""
    found = drive(wait=1.0)
    found.walls = np.concatenate([WALLS, square(*OBJECT, DIAMETER / math.sqrt(2.0))])
    for _ in range(60):
        found.to(START)
    assert occupied_near(found.maps[-1], OBJECT, 0.25)
    found.walls, found.object = WALLS, OBJECT
    for _ in range(20):
        found.to(START)
    assert not occupied_near(found.maps[-1], OBJECT, 0.25)
    elsewhere = OBJECT + np.array([0.7, 0.3])
    found.seen, found.walls = Visibility.LOST, np.concatenate([WALLS, square(*elsewhere, DIAMETER / math.sqrt(2.0))])
    for _ in range(40):
        found.to(START)
    assert occupied_near(found.maps[-1], elsewhere, 0.25)
    found.seen, found.walls, found.object = Visibility.VISIBLE, WALLS, elsewhere
    for _ in range(20):
        found.to(START)
    assert not occupied_near(found.maps[-1], elsewhere, 0.25)


def test_what_stands_where_a_lost_object_was_is_an_obstacle() -> None:
    found = drive()
    found.object = OBJECT
    for _ in range(20):
        found.to(START)
    found.seen = Visibility.LOST
    for _ in range(40):
        found.to(START)
    assert occupied_near(found.maps[-1], OBJECT, 0.25)


def test_without_scans_the_robot_says_that_it_knows_less() -> None:
    """Its odometry errs by a tenth of every step here, and by 0.04 rad a metre."""
    found = drive()
    found.object = OBJECT
    for _ in range(20):
        found.to(START)
    found.blind = True
    for k in range(1, 200):
        found.to(START + np.array([0.01 * k, 0.0, 0.0]))
    first, last = (np.array(found.poses[k].covariance).reshape(3, 3) for k in (19, -1))
    assert last[0, 0] > 25 * first[0, 0] and last[1, 1] > 25 * first[1, 1] and last[2, 2] > 25 * first[2, 2]
    assert np.allclose(last, last.T) and np.linalg.eigvalsh(last).min() > 0.0


def test_odometry_that_begins_anew_does_not_move_the_robot() -> None:
    found = drive()
    found.object = OBJECT
    there = path()[:120]
    for pose in there:
        found.to(pose)
    assert found.odometry[0] > 0.35, "far enough to show"
    found.odometry = np.zeros(3)
    for _ in range(40):
        found.to(there[-1])
        last = found.poses[-1].pose
        assert math.hypot(last.x - there[-1][0], last.y - there[-1][1]) < 0.04


def test_nothing_is_drawn_before_the_object_is_known_or_for_so_long() -> None:
    found = drive(wait=1.0)
    for _ in range(18):
        found.to(START)
    assert not found.maps
    for _ in range(6):
        found.to(START)
    assert found.maps
    assert len(found.poses) == 24, "where the robot is has to be said all the same"


def test_a_restored_service_goes_on_alike_to_the_byte() -> None:
    found = drive()
    found.object = OBJECT
    poses = path()[:200]
    for pose in poses[:120]:
        found.to(pose)
    other = drive()
    other.service.restore(found.service.snapshot(), dict(found.service.latest))
    other.object, other.now, other.odometry, other.last = OBJECT, found.now, found.odometry.copy(), found.last
    other.generator = np.random.Generator(np.random.PCG64(9))
    found.generator = np.random.Generator(np.random.PCG64(9))
    other.sequence = found.sequence
    first, maps = len(found.poses), len(found.maps)
    for pose in poses[120:]:
        found.to(pose)
        other.to(pose)
    assert [one.SerializeToString() for one in found.poses[first:]] == [one.SerializeToString() for one in other.poses]
    assert [one.SerializeToString() for one in found.maps[maps:]] == [one.SerializeToString() for one in other.maps]
    assert len(other.maps) > 1
    assert found.service.snapshot() == other.service.snapshot()


def test_scans_that_come_before_their_odometry_or_far_too_late_harm_nothing() -> None:
    found = drive()
    found.object = OBJECT
    for _ in range(20):
        found.to(START)
    count = len(found.maps)
    late = found.scan(START, WALLS)
    late.timestamp.seconds = 0
    found.give("scan", late)
    found.now += PERIOD
    found.give("scan", found.scan(START, WALLS))  # of now, and no odometry of now yet
    found.now -= PERIOD
    found.to(START)
    assert len(found.maps) >= count
    assert math.hypot(found.poses[-1].pose.x - START[0], found.poses[-1].pose.y - START[1]) < 0.03
