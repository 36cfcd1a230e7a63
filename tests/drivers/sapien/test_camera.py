"""The simulated camera: where things are in its pictures, and that the same seed gives the same bytes."""

from __future__ import annotations

import math

import cv2
import msgspec
import numpy as np
import pytest

from drivers.sapien import objects, scene
from drivers.sapien.camera import SapienCamera, SapienCameraConfig
from drivers.sapien.look import NoCamera, plates
from drivers.sapien.optics import CameraModel, quaternion
from runtime.messages import CameraCalibration, CompressedImage, FrameTransform, Pose2, Truth
from runtime.service import Publication
from runtime.time import SECOND
from services.tracker.layout import cube
from services.vision.camera import Camera, Mount

HOME = scene.get("living-room")
BODY = objects.draw(objects.get("orange-cylinder"), np.random.default_rng(1))
ROBOT = (1.65, 1.75, 0.3)


def object_at(distance: float, aside: float = 0.0) -> tuple[float, float, float]:
    """Return the pose of an object so many m ahead of the robot and to its left."""
    c, s = math.cos(ROBOT[2]), math.sin(ROBOT[2])
    return ROBOT[0] + c * distance - s * aside, ROBOT[1] + s * distance + c * aside, 0.5


def camera(tagged: bool = False, seed: int = 1, **model: object) -> SapienCamera:
    room = msgspec.structs.replace(HOME, camera=CameraModel(**model))  # type: ignore[arg-type]
    return SapienCamera(SapienCameraConfig(seed=seed, scene=room, body=BODY, tagged=tagged))


def shot(service: SapienCamera, thing: tuple[float, float, float], count: int = 1) -> list[Publication]:
    """Return what the camera publishes while robot and object stand still, `count` pictures."""
    found: list[Publication] = []
    for k in range(1, 2 * count + 2):
        now = k * SECOND // 20
        truth = Truth(stamp=now, robot=Pose2(x=ROBOT[0], y=ROBOT[1], theta=ROBOT[2]))
        truth.object.x, truth.object.y, truth.object.theta = thing
        found += service.watch(truth, now)  # type: ignore[arg-type]
        if k % 2:
            found += service.shoot(now)  # type: ignore[arg-type]
    return found


def one(found: list[Publication], kind: type) -> object:
    return next(each.message for each in found if isinstance(each.message, kind))


def test_calibration_and_mount_say_where_the_camera_is() -> None:
    model = CameraModel(x=0.1, y=-0.05, z=0.8, yaw=0.2, pitch=0.6, roll=0.1)
    mount = Mount.of(model.mount())
    assert mount.position == pytest.approx([0.1, -0.05, 0.8])
    # Turned about z, then y, then x, from a camera that looks along x with z up.
    z, y, x = (cv2.Rodrigues(np.array(v))[0] for v in ((0, 0, 0.2), (0, 0.6, 0), (0.1, 0, 0)))
    assert mount.rotation @ (0, 0, 1) == pytest.approx((z @ y @ x)[:, 0])
    assert mount.rotation @ (1, 0, 0) == pytest.approx(-(z @ y @ x)[:, 1])
    seen = Camera.of(model.calibration())
    top, bottom = seen.rays(np.array([[319.5, -0.5], [319.5, 479.5]]))
    angle = math.acos(top @ bottom / np.linalg.norm(top) / np.linalg.norm(bottom))
    assert angle == pytest.approx(model.field)


@pytest.mark.parametrize("turn", [(0.1, 0.2, 0.3), (3.1, 0.0, 0.0), (0.0, 3.1, 0.2), (0.0, 0.1, 3.1), (0.0, 0.0, 0.0)])
def test_quaternions_turn_like_their_matrices(turn: tuple[float, float, float]) -> None:
    rotation = cv2.Rodrigues(np.array(turn))[0]
    x, y, z, w = quaternion(rotation)
    length = math.hypot(*turn)
    assert abs(w) == pytest.approx(abs(math.cos(length / 2)), abs=1e-9)
    assert math.hypot(x, y, z, w) == pytest.approx(1.0)
    transform = FrameTransform()
    transform.rotation.x, transform.rotation.y, transform.rotation.z, transform.rotation.w = x, y, z, w
    assert Mount.of(transform).rotation == pytest.approx(rotation, abs=1e-9)


@pytest.mark.render
def test_tags_are_where_the_trackers_layout_has_them() -> None:
    layout = cube(range(5), 0.14, 0.105, BODY.height)
    for tag, plate in zip(layout.tags, plates(BODY.height), strict=True):
        matrix = plate.to_transformation_matrix()
        assert matrix[:3, :3] == pytest.approx(tag.rotation, abs=1e-6)
        assert matrix[:3, 3] == pytest.approx(tag.position, abs=1e-6)


@pytest.mark.render
@pytest.mark.parametrize(("distance", "aside"), [(0.6, 0.0), (1.2, 0.3), (2.0, -0.5)])
def test_the_object_is_where_the_calibration_projects_it(distance: float, aside: float) -> None:
    service = camera(noise=0.0, quality=100)
    found = shot(service, object_at(distance, aside))
    seen, mount = Camera.of(one(found, CameraCalibration)), Mount.of(one(found, FrameTransform))  # type: ignore[arg-type]
    image = one(found, CompressedImage)
    assert isinstance(image, CompressedImage) and image.format == "jpeg"
    picture = cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_COLOR).astype(int)
    # Orange: much more red than blue. Its upper rim is a circle of 0.14 m at its height.
    orange = np.argwhere(picture[..., 2] - picture[..., 0] > 70)
    angle = np.linspace(0.0, 2 * np.pi, 200)
    place = np.array([distance, aside])
    rims = [
        np.column_stack([place[0] + 0.07 * np.cos(angle), place[1] + 0.07 * np.sin(angle), np.full(200, height)])
        for height in (0.0, BODY.height)
    ]
    outline = seen.project(mount.to_camera(np.concatenate(rims)))
    expected = [outline[:, 0].min(), outline[:, 0].max(), outline[:, 1].min(), outline[:, 1].max()]
    got = [orange[:, 1].min(), orange[:, 1].max(), orange[:, 0].min(), orange[:, 0].max()]
    assert got == pytest.approx(expected, abs=2.0)


@pytest.mark.render
def test_depth_is_the_distance_of_the_floor() -> None:
    service = camera(noise=0.0, depth=True, depth_noise=0.0)
    found = shot(service, object_at(2.4, 1.0))
    image = next(each.message for each in found if each.topic == "depth")
    assert isinstance(image, CompressedImage) and image.format == "png"
    depth = cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_UNCHANGED) / 1000.0
    seen, mount = Camera.of(one(found, CameraCalibration)), Mount.of(one(found, FrameTransform))  # type: ignore[arg-type]
    for u, v in ((320, 300), (200, 400), (450, 250)):
        (floor,) = mount.on_plane(seen.rays(np.array([[u, v]], float)))
        along = mount.to_camera(np.array([[*floor, 0.0]]))[0, 2]
        assert depth[v, u] == pytest.approx(along, abs=0.004)


@pytest.mark.render
def test_the_same_seed_gives_the_same_pictures_and_a_restored_camera_goes_on_alike() -> None:
    thing = object_at(0.9)
    first, second = (shot(camera(tagged=True, depth=True), thing, 3) for _ in range(2))
    assert [m.message.SerializeToString() for m in first] == [m.message.SerializeToString() for m in second]
    other = shot(camera(tagged=True, depth=True, seed=2), thing, 3)
    assert [m.message.SerializeToString() for m in first] != [m.message.SerializeToString() for m in other]
    service = camera(tagged=True)
    shot(service, thing, 2)
    restored = camera(tagged=True)
    restored.restore(service.snapshot(), {})
    later = 10 * SECOND
    for each in (service, restored):
        truth = Truth(stamp=later, robot=Pose2(x=ROBOT[0], y=ROBOT[1], theta=ROBOT[2]))
        list(each.watch(truth, later))
    now = later + SECOND
    pictures = [[m.message.SerializeToString() for m in each.shoot(now)] for each in (service, restored)]  # type: ignore[union-attr]
    assert pictures[0] == pictures[1] and len(pictures[0]) == 1


@pytest.mark.render
def test_pictures_are_as_late_as_they_say() -> None:
    found = shot(camera(latency=0.1), object_at(1.0), 4)
    stamps = [m.message.timestamp.ToNanoseconds() for m in found if m.topic == "image"]  # type: ignore[attr-defined]
    assert stamps == sorted(set(stamps))
    # Taken at 0.05, 0.15 and so on, a picture shows what was newest 0.1 s before.
    assert [round(stamp * 1e-9, 3) for stamp in stamps] == [0.05, 0.15, 0.25, 0.35]


def test_without_vulkan_the_packages_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    from drivers.sapien import look

    def fail() -> None:
        raise RuntimeError("failed to find a rendering device")

    monkeypatch.setattr(look.sapien.render, "RenderSystem", fail)
    with pytest.raises(NoCamera, match=r"mesa-vulkan-drivers \(25 or newer.*perception=truth"):
        camera()
