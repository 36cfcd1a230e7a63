"""Pictures of boxes and cylinders on a floor, made by following each pixel's ray, so that the truth is known."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from runtime.messages import CameraCalibration, FrameTransform
from services.vision.camera import Camera, Mount


@dataclass(frozen=True)
class Thing:
    """A box of length x width m, turned by yaw, or a cylinder where width is 0 and length its diameter."""

    x: float
    y: float
    length: float
    width: float = 0.0
    yaw: float = 0.0
    height: float = 0.2
    colour: tuple[int, int, int] = (170, 40, 40)

    @property
    def diameter(self) -> float:
        return math.hypot(self.length, self.width)


def camera(width: int = 640, height: int = 480) -> Camera:
    """The camera of the simulation: 60 degrees from bottom to top."""
    f = height / 2 / math.tan(math.radians(30.0))
    matrix = np.array([[f, 0.0, width / 2 - 0.5], [0.0, f, height / 2 - 0.5], [0.0, 0.0, 1.0]])
    return Camera(matrix, np.zeros(5), width, height)


def mount(pitch: float = 45.0, height: float = 0.9) -> Mount:
    """A camera at (0.1, 0, height) that looks forward and `pitch` degrees down."""
    c, s = math.cos(math.radians(pitch)), math.sin(math.radians(pitch))
    rotation = np.array([[0.0, -s, c], [-1.0, 0.0, 0.0], [0.0, -c, -s]])
    return Mount(rotation, np.array([0.1, 0.0, height]))


def cast(eye: Camera, on: Mount, things: list[Thing]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return for each pixel the depth, m, what it shows (0 floor, k-th thing, -1 nothing) and whether that is a top."""
    v, u = np.mgrid[: eye.height, : eye.width]
    rays = eye.rays(np.column_stack([u.ravel(), v.ravel()]).astype(float)) @ on.rotation.T
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(rays[:, 2] < -1e-6, -on.position[2] / rays[:, 2], np.inf)
        shown = np.where(np.isfinite(depth), 0, -1)
        top = np.zeros(len(rays), bool)
        for k, thing in enumerate(things):
            c, s = math.cos(thing.yaw), math.sin(thing.yaw)
            turned = np.array([[c, s], [-s, c]])
            start, way = turned @ (on.position[:2] - [thing.x, thing.y]), rays[:, :2] @ turned.T
            through = (thing.height - on.position[2]) / rays[:, 2]
            low, high = (
                np.where(rays[:, 2] < 0, through, -np.inf),
                np.where(rays[:, 2] < 0, depth * 0 + np.inf, through),
            )
            if thing.width:
                for axis, half in ((0, thing.length / 2), (1, thing.width / 2)):
                    a, b = (-half - start[axis]) / way[:, axis], (half - start[axis]) / way[:, axis]
                    low, high = np.maximum(low, np.minimum(a, b)), np.minimum(high, np.maximum(a, b))
            else:
                a, b = (way**2).sum(axis=1), way @ start
                root = np.sqrt(b * b - a * (start @ start - (thing.length / 2) ** 2))
                low, high = np.maximum(low, (-b - root) / a), np.minimum(high, (-b + root) / a)
            hit = (low < high) & (low > 0) & (low < depth)
            depth, shown, top = (
                np.where(hit, low, depth),
                np.where(hit, k + 1, shown),
                np.where(hit, low == through, top),
            )
    shape = (eye.height, eye.width)
    return np.where(np.isfinite(depth), depth, 0.0).reshape(shape), shown.reshape(shape), top.reshape(shape)


def measured(depth: np.ndarray, seed: int) -> np.ndarray:
    """Return depths as a depth camera has them: noise that grows with the square of the depth."""
    return depth + 0.0015 * depth**2 * np.random.default_rng(seed).normal(size=depth.shape)


def wood(eye: Camera, on: Mount, base: tuple[int, int, int] = (176, 140, 100)) -> np.ndarray:
    """Return what the camera sees of a floor of boards with grain, (H, W, 3), RGB."""
    v, u = np.mgrid[: eye.height, : eye.width]
    at = np.nan_to_num(on.on_plane(eye.rays(np.column_stack([u.ravel(), v.ravel()]).astype(float))))
    board = np.floor(at[:, 1] / 0.12)
    grain = np.sin(at[:, 1] * 260.0 + 3.0 * np.sin(at[:, 0] * 5.0 + board * 2.1)) * 7.0
    light = 1.0 - 0.06 * at[:, 0]
    shade = ((board * 7.3) % 1.0 - 0.5) * 22.0 + grain
    return ((np.array(base) + shade[:, None]) * light[:, None]).reshape(eye.height, eye.width, 3)


def picture(eye: Camera, on: Mount, things: list[Thing], seed: int = 0, floor: np.ndarray | None = None) -> np.ndarray:
    """Return a picture, (H, W, 3) uint8 RGB, with noise of 3 grey levels; tops are lighter than sides."""
    _, shown, top = cast(eye, on, things)
    image = wood(eye, on) if floor is None else floor.astype(float)
    image = np.where((shown < 0)[..., None], 200.0, image)
    for k, thing in enumerate(things):
        image[shown == k + 1] = thing.colour
        image[(shown == k + 1) & top] = np.array(thing.colour) * 1.35
    image = cv2.GaussianBlur(image, (0, 0), 0.5)
    image += 3.0 * np.random.default_rng(seed).normal(size=image.shape)
    return np.clip(image, 0, 255).astype(np.uint8)


def free_floor(things: list[Thing], seed: int = 0, reach: float = 3.0, count: int = 2000) -> np.ndarray:
    """Return points, (N, 2), m, base frame, between the robot and what a laser meets, 0.3 m to `reach` away."""
    rng = np.random.default_rng(seed)
    angle, range_ = rng.uniform(-0.9, 0.9, count), np.full(count, reach)
    for thing in things:
        off = math.hypot(thing.x, thing.y)
        wide = math.asin(min(0.99, thing.diameter / 2 / off)) + 0.03
        behind = np.abs(angle - math.atan2(thing.y, thing.x)) < wide
        range_ = np.where(behind, np.minimum(range_, off - thing.diameter / 2 - 0.05), range_)
    far = 0.3 + rng.uniform(0.0, 1.0, count) * (range_ - 0.3)
    return (far[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))[far > 0.29]


def calibration_of(eye: Camera) -> CameraCalibration:
    """Return what a camera without distortion says of itself."""
    k = eye.matrix.ravel().tolist()
    return CameraCalibration(width=eye.width, height=eye.height, distortion_model="plumb_bob", K=k, D=[0.0] * 5)


def transform_of(on: Mount) -> FrameTransform:
    """Return a mount as it is said, its turn made a quaternion by axis and angle."""
    found = FrameTransform()
    found.translation.x, found.translation.y, found.translation.z = on.position
    turn = cv2.Rodrigues(on.rotation)[0].ravel()
    angle = float(np.linalg.norm(turn))
    q = np.sin(angle / 2) * turn / angle
    found.rotation.x, found.rotation.y, found.rotation.z, found.rotation.w = *q, math.cos(angle / 2)
    return found
