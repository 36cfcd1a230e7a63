"""The camera service: what it publishes, what it refuses, and that a recording of it can be executed again."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.camera.config import CalibrationConfig, CameraConfig, MountConfig
from drivers.camera.service import REQUEST, CameraService
from replays.recording import load
from replays.replay import replay
from runtime.config.layers import ConfigError, effective
from runtime.guard import Guard
from runtime.messages import (
    CameraCalibration,
    CompressedImage,
    FrameTransform,
    Log,
    Reply,
    Request,
    Snapshot,
)
from runtime.node import Node
from runtime.recorder import header
from runtime.recorder.writer import Recorder
from runtime.sample import Sample
from runtime.scheduler import Scheduler
from runtime.time import MILLISECOND, SECOND
from services.vision.camera import Camera, Mount

WIDTH, HEIGHT = 64, 48


def config(**changes: object) -> CameraConfig:
    values: dict[str, object] = {
        "calibration": CalibrationConfig(
            width=WIDTH,
            height=HEIGHT,
            focal=(50.0, 51.0),
            centre=(31.0, 24.5),
            distortion=(-0.2, 0.05, 0.001, 0.0, 0.0),
        ),
        "mount": MountConfig(x=0.1, y=-0.02, z=0.9, pitch=0.7),
        "latency": 0.03,
    }
    return CameraConfig(**(values | changes))  # type: ignore[arg-type]


def picture(width: int = WIDTH, height: int = HEIGHT, seed: int = 1) -> bytes:
    pixels = np.random.default_rng(seed).integers(0, 255, (height, width, 3), np.uint8)
    return cv2.imencode(".jpg", pixels)[1].tobytes()


def request(number: int, data: bytes, form: str = "jpeg") -> Request:
    payload = CompressedImage(data=data, format=form).SerializeToString()
    return Request(id=number, name=REQUEST, payload=payload)


def reply_of(samples: list[Sample]) -> Reply:
    return Reply.FromString(samples[-1].payload)


def test_a_picture_is_published_as_it_came_and_stamped_when_it_was_exposed() -> None:
    data = picture()
    with Guard() as guard:
        node = Node(CameraService(config()), guard)
        node.begin(7 * SECOND)
        samples = node.ask(request(1, data), 10 * SECOND, 10 * SECOND)
    image = CompressedImage.FromString(samples[0].payload)
    assert [sample.topic for sample in samples] == ["image", "reply/opencv-camera"]
    assert (image.data, image.format, image.frame_id) == (data, "jpeg", "camera")
    assert image.timestamp.seconds * SECOND + image.timestamp.nanos == 9970 * MILLISECOND
    assert reply_of(samples).accepted


def described(node: Node) -> dict[str, bytes]:
    return {sample.topic: sample.payload for sample in node.fire("tell", 1, SECOND, SECOND)}


def test_the_tracker_reads_calibration_and_mount_as_they_were_set() -> None:
    said = described(Node(CameraService(config()), None))
    message = CameraCalibration.FromString(said["calibration"])
    camera = Camera.of(message)
    assert (camera.width, camera.height, message.frame_id) == (WIDTH, HEIGHT, "camera")
    np.testing.assert_array_equal(camera.matrix, [[50, 0, 31], [0, 51, 24.5], [0, 0, 1]])
    np.testing.assert_array_equal(camera.distortion, [-0.2, 0.05, 0.001, 0, 0])
    np.testing.assert_array_equal(np.reshape(message.P, (3, 4))[:, :3], camera.matrix)
    np.testing.assert_array_equal(np.reshape(message.R, (3, 3)), np.eye(3))
    transform = FrameTransform.FromString(said["camera/mount"])
    assert (transform.parent_frame_id, transform.child_frame_id) == ("base", "camera")
    mount = Mount.of(transform)
    np.testing.assert_allclose(mount.position, [0.1, -0.02, 0.9])
    # Looking 0.7 rad down, the middle of the picture meets the floor so far ahead; its right is the base's right.
    ahead = mount.on_plane(np.array([[0.0, 0.0, 1.0], [0.1, 0.0, 1.0]]))
    np.testing.assert_allclose(ahead[0], [0.1 + 0.9 / math.tan(0.7), -0.02])
    assert ahead[1, 1] < -0.02


ANGLE = st.floats(-3.1, 3.1)


@given(roll=ANGLE, pitch=ANGLE, yaw=ANGLE)
def test_the_mount_is_turned_by_yaw_after_pitch_after_roll(roll: float, pitch: float, yaw: float) -> None:
    mount = MountConfig(x=0.0, z=1.0, roll=roll, pitch=pitch, yaw=yaw)
    said = described(Node(CameraService(config(mount=mount)), None))
    found = Mount.of(FrameTransform.FromString(said["camera/mount"])).rotation
    about = [cv2.Rodrigues(np.array(axis))[0] for axis in ((0, 0, yaw), (0, pitch, 0), (roll, 0, 0))]
    optical = np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # columns: right, down and ahead, seen from the body
    np.testing.assert_allclose(found, about[0] @ about[1] @ about[2] @ optical, atol=1e-12)


BOMB = bytearray(picture())
_AT = BOMB.find(b"\xff\xc0") + 5
BOMB[_AT : _AT + 4] = b"\xff\xff\xff\xff"


@pytest.mark.parametrize(
    ("data", "form", "words"),
    [
        (picture(48, 64), "jpeg", "48 x 64 pixels, expected 64 x 48"),
        (picture()[:-40], "jpeg", "cut off"),
        (b"", "jpeg", "0 bytes"),
        (b"<html>no camera</html>", "jpeg", "expected a JPEG"),
        (picture(), "png", "format is 'png', expected 'jpeg'"),
        (bytes(BOMB), "jpeg", "65535 x 65535 pixels"),
        (picture()[:400] + b"\xff\xd9", "jpeg", "JPEG of 402 bytes"),
    ],
)
def test_what_is_no_picture_of_this_camera_is_refused_and_counted(data: bytes, form: str, words: str) -> None:
    service = CameraService(config())
    node = Node(service, None)
    node.begin(0)
    samples = node.ask(request(1, data, form), SECOND, SECOND)
    assert [sample.topic for sample in samples] == ["reply/opencv-camera"]
    assert not reply_of(samples).accepted
    assert words in reply_of(samples).reason
    assert (service.state.taken, service.state.refused) == (0, 1)
    said = [Log.FromString(s.payload).message for s in node.fire("check", 1, 2 * SECOND, 2 * SECOND)]
    assert said[0].startswith("1 pictures refused, the last: ") and words in said[0]


def test_the_log_says_once_that_pictures_lack_and_once_that_they_come_again() -> None:
    node = Node(CameraService(config(rate=4.0)), None)
    node.begin(0)
    assert node.contract.timers["check"].seconds(config(rate=4.0)) == 1.0
    said = []
    for second in range(1, 6):
        for _ in range(4 if second >= 4 else 1):
            node.ask(request(1, picture()), second * SECOND, second * SECOND)
        said.append([Log.FromString(s.payload).message for s in node.fire("check", second, second, second)])
    assert said == [["1 pictures a second, expected 4"], [], [], ["4 pictures a second, expected 4"], []]


EVENTS = st.lists(
    st.one_of(
        st.tuples(st.just("ask"), st.sampled_from([picture(), picture(seed=2), picture(8, 8), b"no"])),
        st.tuples(st.sampled_from(["tell", "check"]), st.just(b"")),
    ),
    max_size=20,
)
Events = list[tuple[str, bytes]]


def apply(node: Node, events: Events, start: int) -> list[Sample]:
    given_out: list[Sample] = []
    for number, (kind, data) in enumerate(events, start + 1):
        now = number * 100 * MILLISECOND
        if kind == "ask":
            given_out += node.ask(request(number, data), now, now)
        else:
            given_out += node.fire(kind, number, now, now)
    return given_out


@settings(max_examples=30, deadline=None, derandomize=True)
@given(before=EVENTS, after=EVENTS)
def test_a_restored_camera_goes_on_as_if_it_had_never_stopped(before: Events, after: Events) -> None:
    with Guard() as guard:
        one = Node(CameraService(config()), guard)
        one.begin(0)
        apply(one, before, 0)
        snapshot = Snapshot.FromString(one.take_snapshot(50 * SECOND).payload)
        other = Node(CameraService(config()), guard)
        other.resume(snapshot)
        assert apply(other, after, 1000) == apply(one, after, 1000)
        assert other.journal.digest == one.journal.digest
        assert other.take_snapshot(200 * SECOND) == one.take_snapshot(200 * SECOND)


def test_a_recording_of_it_replays_byte_for_byte(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    head = header.of_this_machine("local", 1, [CameraService.name])
    sections = {CameraService.name: msgspec.to_builtins(config())}
    with Recorder(path, head, msgspec.json.encode({"sections": sections})) as recorder, Guard() as guard:
        scheduler = Scheduler([Node(CameraService(config()), guard)], recorder)
        for number, data in enumerate([picture(), b"no", picture(seed=5), picture(8, 8)]):
            message = CompressedImage(data=data, format="jpeg")
            scheduler.request(REQUEST, message, at=(100 + 700 * number) * MILLISECOND)
        scheduler.run(4 * SECOND)
        scheduler.finish()
    recording = load(path)
    assert len([sample for sample in recording.samples if sample[0] == "image"]) == 2
    found = replay(recording, services=lambda _: CameraService)
    assert found.identical
    changed = replay(recording, changes={CameraService.name: {"latency": 0.1}}, services=lambda _: CameraService)
    assert not changed.identical


def test_a_camera_without_calibration_or_mount_is_a_mistake_that_is_named() -> None:
    with pytest.raises(ConfigError, match="calibration"):
        effective({"opencv-camera": CameraConfig}, [])
    values = msgspec.to_builtins(config())
    values["calibration"]["focal"] = [50.0, -1.0]
    with pytest.raises(msgspec.ValidationError, match="focal"):
        msgspec.convert(values, CameraConfig)
