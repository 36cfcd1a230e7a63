"""The tracker's service: what it says of an object in pictures whose truth is known, and when there are none."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import cv2
import numpy as np
import pytest
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp
from scipy.stats import chi2

from runtime.messages import (
    CameraCalibration,
    CompressedImage,
    FrameTransform,
    ImageAnnotations,
    LaserScan,
    Log,
    ObjectState,
    Odometry,
    Pose2,
    RobotPose,
    RobotStatus,
    Visibility,
)
from runtime.service import Publication
from runtime.time import SECOND, Time
from services.geometry.pose import between
from services.tracker.config import TrackerConfig
from services.tracker.service import TrackerService
from services.vision.camera import Mount
from tests.services.tracker.pictures import picture as marker
from tests.services.tracker.scenes import Thing, calibration_of, camera, cast, mount, picture, transform_of

EYE, ON = camera(), mount()
ROBOT = (1.0, 2.0, 0.5)
STEP = SECOND // 10
AHEAD = Thing(0.9, 0.1, 0.3, height=0.2)


@dataclass
class Fed:
    """A tracker on a robot that stands still."""

    service: TrackerService
    now: Time = 0
    states: list[ObjectState] = field(default_factory=list)
    outlines: list[ImageAnnotations] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    origin: np.ndarray = field(default_factory=lambda: np.array((0.3, -0.2, 0.4)))
    off: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def take(self, effects: object) -> None:
        """Keep what was published."""
        for one in effects or ():  # type: ignore[attr-defined]
            assert isinstance(one, Publication)
            if isinstance(one.message, ObjectState):
                self.states.append(one.message)
            elif isinstance(one.message, ImageAnnotations):
                self.outlines.append(one.message)
            elif isinstance(one.message, Log):
                self.said.append(one.message.message)

    def give(self, topic: str, message: Message) -> None:
        """Give the service a message."""
        self.service.latest[topic] = message
        handler = self.service.contract.handlers.get(topic)
        if handler is not None:
            self.take(getattr(self.service, handler)(message, self.now))

    def look(self, image: np.ndarray | None, things: list[Thing], robot: tuple[float, float, float] = ROBOT) -> None:
        """Let 0.1 s pass, then come pose, scan and picture of now; None: no picture.

        The odometry's frame has its origin elsewhere on the map, and mapping is off by `off`.
        """
        self.now += STEP
        x, y, theta = robot
        driven = between(self.origin, np.array(robot))
        x, y, theta = x + self.off[0], y + self.off[1], theta + self.off[2]
        covariance = [1e-4, 0, 0, 0, 1e-4, 0, 0, 0, 1e-4]
        odometry = Pose2(x=driven[0], y=driven[1], theta=driven[2])
        self.give("odometry", Odometry(stamp=self.now, pose=odometry))
        self.give("robot/pose", RobotPose(stamp=self.now, pose=Pose2(x=x, y=y, theta=theta), covariance=covariance))
        self.give("scan", scan(things, self.now))
        if image is not None:
            ok, data = cv2.imencode(".jpg" if image.dtype == np.uint8 else ".png", image)
            assert ok
            topic = "image" if image.dtype == np.uint8 else "depth"
            self.give(topic, CompressedImage(timestamp=stamp(self.now), data=data.tobytes(), format="jpeg"))
        self.take(self.service.go_on(self.now))


def stamp(time: Time) -> Timestamp:
    return Timestamp(seconds=time // SECOND, nanos=time % SECOND)


def scan(things: list[Thing], now: Time) -> LaserScan:
    """Return a scan in which round things stand in the way of the beams, (121,), 1 degree apart."""
    bearing = np.radians(np.arange(-60, 61))
    ranges = np.full(121, 4.0)
    for thing in things:
        off, at = math.hypot(thing.x, thing.y), math.atan2(thing.y, thing.x)
        wide = math.asin(thing.diameter / 2 / off)
        ranges[np.abs(bearing - at) < wide] = off - thing.diameter / 2
    found = LaserScan(timestamp=stamp(now), start_angle=bearing[0], end_angle=bearing[-1], ranges=ranges.tolist())
    found.pose.orientation.w = 1.0
    return found


def tracker(**values: object) -> Fed:
    found = Fed(TrackerService(TrackerConfig(**values)))  # type: ignore[arg-type]
    found.give("status", RobotStatus(diameter=0.45))
    found.give("calibration", calibration_of(EYE))
    found.give("camera/mount", transform_of(ON))
    return found


def on_map(x: float, y: float, robot: tuple[float, float, float] = ROBOT) -> tuple[float, float]:
    c, s = math.cos(robot[2]), math.sin(robot[2])
    return robot[0] + c * x - s * y, robot[1] + s * x + c * y


def shown(things: list[Thing], seed: int = 0) -> np.ndarray:
    """Return a picture as a JPEG has it, blue first."""
    return np.ascontiguousarray(picture(EYE, ON, things, seed)[..., ::-1])


def deep(things: list[Thing]) -> np.ndarray:
    return np.rint(1000.0 * cast(EYE, ON, things)[0]).astype(np.uint16)


def test_an_object_that_looks_other_than_the_floor_is_where_it_stands() -> None:
    found = tracker(finds="appearance")
    for seed in range(5):
        found.look(shown([AHEAD], seed), [AHEAD])
    last, true = found.states[-1], on_map(AHEAD.x, AHEAD.y)
    assert math.dist((last.position.x, last.position.y), true) < 0.03
    assert last.diameter == pytest.approx(0.3, abs=0.03)
    assert last.visibility == Visibility.VISIBLE and not last.HasField("yaw")
    assert last.stamp == found.now
    assert found.outlines[-1].points, "nothing is drawn around it"


def test_an_object_in_a_picture_of_depths_is_where_it_stands() -> None:
    box = Thing(1.1, -0.2, 0.3, 0.2, 0.4)
    found = tracker(finds="depth")
    for _ in range(3):
        found.look(deep([box]), [box])
    last = found.states[-1]
    assert math.dist((last.position.x, last.position.y), on_map(1.1, -0.2)) < 0.01
    assert last.diameter == pytest.approx(math.hypot(0.3, 0.2), abs=0.015)


HEIGHT = 0.2
"""m, of an object below its cube of tags"""


def top(x: float, y: float, yaw: float, on: Mount = ON) -> np.ndarray:
    """Return a picture of the marker on top of a cube whose middle is at (x, y), base frame."""
    place = np.array([x, y, HEIGHT + 0.14])
    c, s = math.cos(yaw), math.sin(yaw)
    # The tag's right is the object's -y, its upper side x.
    turned = np.column_stack([(s, -c, 0.0), (c, s, 0.0), (0.0, 0.0, 1.0)])
    return marker(EYE, on.rotation.T @ turned, on.to_camera(place[None])[0], 0.105, id=0)


def test_a_cube_that_stands_aside_is_told_of() -> None:
    x, y, turned = 0.08, -0.05, 0.4
    found = tracker(finds="tags", height=HEIGHT, diameter=0.3, cube_at=(x, y, turned))
    yaw = 0.7
    c, s = math.cos(yaw), math.sin(yaw)
    found.look(top(1.0 + c * x - s * y, s * x + c * y, yaw + turned), [])
    last = found.states[-1]
    assert math.dist((last.position.x, last.position.y), on_map(1.0, 0.0)) < 0.004
    assert math.remainder(last.yaw - yaw - ROBOT[2], math.tau) == pytest.approx(0.0, abs=0.02)


def test_the_covariance_is_honest_where_mount_tags_and_pose_are_off() -> None:
    """Each run has a camera mounted anew, a cube set up anew and a pose on the map that is off.

    Squared errors, in their own deviations, of the last state are those of 2 numbers a run, and of 1 of the yaw.
    """
    random, runs, place, turn = np.random.default_rng(1), 120, 0.0, 0.0
    given = {"mount_off": 0.003, "mount_turned": 0.006, "cube_off": 0.004, "cube_turned": 0.03}
    for _ in range(runs):
        found = tracker(finds="tags", height=HEIGHT, diameter=0.3, **given)
        tilted = cv2.Rodrigues(given["mount_turned"] * random.standard_normal(3))[0]
        real = Mount(tilted @ ON.rotation, ON.position + given["mount_off"] * random.standard_normal(3))
        x, y, yaw = random.uniform(0.8, 1.3), random.uniform(-0.25, 0.25), random.uniform(-3.0, 3.0)
        off, skew = given["cube_off"] * random.standard_normal(2), given["cube_turned"] * random.standard_normal()
        found.off = tuple(0.01 * random.standard_normal(3))  # as its covariance says
        grey = top(x + off[0], y + off[1], yaw + skew, real)
        for _ in range(6):
            found.look(grey, [])
        last = found.states[-1]
        d = np.array((last.position.x, last.position.y)) - on_map(x, y)
        place += float(d @ np.linalg.solve(np.array(last.covariance).reshape(2, 2), d))
        turn += math.remainder(last.yaw - yaw - ROBOT[2], math.tau) ** 2 / last.yaw_variance
    for total, numbers in ((place, 2), (turn, 1)):
        low, high = chi2.ppf([0.025, 0.975], numbers * runs)
        assert low < total < high, (total, low, high)


def test_a_tag_gives_place_and_yaw() -> None:
    """One marker, drawn exactly, on top of a cube at 1 m."""
    yaw, height = 0.7, HEIGHT
    found = tracker(finds="tags", height=height, diameter=0.3)
    top_at = np.array([1.0, 0.0, height + 0.14])
    grey = top(1.0, 0.0, yaw)
    for _ in range(5):
        found.look(grey, [])
    last = found.states[-1]
    assert math.dist((last.position.x, last.position.y), on_map(1.0, 0.0)) < 0.004
    assert math.remainder(last.yaw - yaw - ROBOT[2], math.tau) == pytest.approx(0.0, abs=0.02)
    assert last.diameter == 0.3
    (line,) = found.outlines[-1].points
    corners = np.array([(p.x, p.y) for p in line.points])
    dark = grey[int(corners[:, 1].mean()) - 40 : int(corners[:, 1].mean()) + 40].min()
    assert len(corners) == 4 and dark < 60
    expected = EYE.project(ON.to_camera(top_at[None]))[0]
    assert corners.mean(axis=0) == pytest.approx(expected, abs=2.0)


def test_nothing_is_said_before_the_object_was_seen() -> None:
    found = tracker(finds="appearance")
    for seed in range(3):
        found.look(shown([], seed), [])
    assert not found.states


def test_out_of_sight_it_is_predicted_then_lost_and_found_again() -> None:
    found = tracker(finds="appearance")
    for seed in range(5):
        found.look(shown([AHEAD], seed), [AHEAD])
    before = found.states[-1]
    count = len(found.states)
    for seed in range(15):
        found.look(shown([], seed), [])
    kinds = [one.visibility for one in found.states[count:]]
    assert kinds == sorted(kinds) and set(kinds) == {Visibility.VISIBLE, Visibility.PREDICTED, Visibility.LOST}
    last = found.states[-1]
    assert math.dist((last.position.x, last.position.y), (before.position.x, before.position.y)) < 0.02
    assert last.covariance[0] > before.covariance[0]
    found.look(shown([AHEAD], 9), [AHEAD])
    assert found.states[-1].visibility == Visibility.VISIBLE


def test_without_pictures_it_goes_on_by_its_timer() -> None:
    found = tracker(finds="appearance")
    for seed in range(3):
        found.look(shown([AHEAD], seed), [AHEAD])
    count = len(found.states)
    for _ in range(15):
        found.look(None, [AHEAD])
    later = found.states[count:]
    assert [one.stamp for one in later] == [(3 + k) * STEP for k in range(4, 16)]
    assert later[-1].visibility == Visibility.LOST


def test_the_object_stays_where_it_is_while_the_robot_moves() -> None:
    found = tracker(finds="depth")
    true = on_map(AHEAD.x, AHEAD.y)
    for k in range(8):
        robot = (ROBOT[0] + 0.02 * k, ROBOT[1] - 0.01 * k, ROBOT[2] + 0.03 * k)
        dx, dy = true[0] - robot[0], true[1] - robot[1]
        c, s = math.cos(robot[2]), math.sin(robot[2])
        there = Thing(c * dx + s * dy, -s * dx + c * dy, 0.3, height=0.2)
        found.look(deep([there]), [there], robot)
    for one in found.states:
        assert math.dist((one.position.x, one.position.y), true) < 0.012


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "unreadable"),
        (b"\xff\xd8 no picture", "unreadable"),
        (cv2.imencode(".jpg", np.zeros((60, 80)))[1], "80 x 60"),
    ],
)
def test_what_is_no_picture_is_named_and_changes_nothing(data: bytes, words: str) -> None:
    found = tracker(finds="appearance")
    for seed in range(3):
        found.look(shown([AHEAD], seed), [AHEAD])
    count = len(found.states)
    found.now += STEP
    found.give("image", CompressedImage(timestamp=stamp(found.now), data=bytes(data), format="jpeg"))
    assert len(found.states) == count
    assert words in found.said[-1] and "640 x 480" in found.said[-1]
    assert found.service.state.unreadable == 1


def test_a_calibration_that_cannot_be_is_refused() -> None:
    found = Fed(TrackerService(TrackerConfig(diameter=0.3)))
    found.give("calibration", CameraCalibration(width=640, height=480, K=[0.0] * 9))
    found.give("camera/mount", FrameTransform())
    assert "K is" in found.said[0] and "no length" in found.said[1]
    found.look(shown([AHEAD]), [AHEAD])
    assert not found.states


@pytest.mark.parametrize("finds", ["appearance", "depth"])
def test_a_restored_tracker_goes_on_alike_to_the_byte(finds: str) -> None:
    draw = shown if finds == "appearance" else lambda things, _: deep(things)  # type: ignore[misc, return-value]
    first = tracker(finds=finds)
    for seed in range(4):
        first.look(draw([AHEAD], seed), [AHEAD])
    second = tracker(finds=finds)
    second.service.restore(first.service.snapshot(), dict(first.service.latest))
    second.now = first.now
    count = len(first.states)
    for seed in range(4, 8):
        for each in (first, second):
            each.look(draw([AHEAD], seed), [AHEAD])
    assert [one.SerializeToString() for one in first.states[count:]] == [
        one.SerializeToString() for one in second.states
    ]
    assert len(second.states) == 4
    assert first.service.snapshot() == second.service.snapshot()


def beside_the_robot(found: Fed) -> np.ndarray:
    """Return where the newest state has the object, m, base frame of where mapping has the robot."""
    state = found.states[-1]
    robot = np.array((ROBOT[0] + found.off[0], ROBOT[1] + found.off[1], ROBOT[2]))
    return between(robot, np.array((state.position.x, state.position.y, 0.0)))[:2]


def test_where_mapping_changes_its_mind_the_object_goes_along_and_does_not_seem_to_move() -> None:
    found = tracker(finds="depth")
    for _ in range(4):
        found.look(deep([AHEAD]), [AHEAD])
    before = beside_the_robot(found)
    # 5 cm to and fro, as between two neighbouring cells, would be half a metre a second.
    for turn in range(8):
        found.off = (0.05, -0.03, 0.0) if turn % 2 else (0.0, 0.0, 0.0)
        found.look(deep([AHEAD]), [AHEAD])
        assert found.states[-1].visibility == Visibility.VISIBLE
        assert beside_the_robot(found) == pytest.approx(before, abs=1e-3)
    track = found.service.state.track
    assert track is not None and np.hypot(*track.mean[2:]) < 1e-3


def test_time_does_not_go_back_where_a_picture_comes_after_a_prediction() -> None:
    found = tracker(finds="depth")
    for _ in range(3):
        found.look(deep([AHEAD]), [AHEAD])
    for _ in range(4):
        found.look(None, [AHEAD])
    predicted = found.states[-1].stamp
    assert predicted == found.now
    _, data = cv2.imencode(".png", deep([AHEAD]))
    found.give("depth", CompressedImage(timestamp=stamp(found.now - STEP), data=data.tobytes(), format="png"))
    assert found.states[-1].stamp == predicted, "of the picture, gone on to what was said already"
    assert found.states[-1].visibility == Visibility.VISIBLE


def test_tags_need_to_be_told_how_large_the_object_is() -> None:
    with pytest.raises(ValueError, match="diameter is 0, expected d_o"):
        TrackerConfig(finds="tags")
    assert TrackerConfig(finds="depth").diameter == 0.0


def test_where_the_odometry_begins_anew_the_object_stays_on_the_map() -> None:
    found = tracker(finds="depth")
    for _ in range(4):
        found.look(deep([AHEAD]), [AHEAD])
    before = found.states[-1].position
    found.origin = np.array((-4.0, 3.0, -2.0))
    for _ in range(2):
        found.look(deep([AHEAD]), [AHEAD])
    assert [one for one in found.said if "begun anew" in one]
    after = found.states[-1].position
    assert (after.x, after.y) == pytest.approx((before.x, before.y), abs=1e-3)
    assert found.states[-1].visibility == Visibility.VISIBLE


def test_a_late_picture_is_left_out() -> None:
    found = tracker(finds="depth")
    for _ in range(3):
        found.look(deep([AHEAD]), [AHEAD])
    count = len(found.states)
    _, data = cv2.imencode(".png", deep([AHEAD]))
    found.give("depth", CompressedImage(timestamp=stamp(found.now - STEP), data=data.tobytes(), format="png"))
    assert len(found.states) == count
