"""A pinhole camera with lens distortion, and where it sits on the base.

The camera's frame is the optical one: x right, y down, z forward. Pixels count from the middle of the first one, as
OpenCV's do. The base's frame: x forward, y left, z up, the floor at z = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from runtime.messages import CameraCalibration, FrameTransform

Array = NDArray[np.float64]

_INVERTED = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-9)
"""iterations at most, and pixels at which they end"""


_SMALLEST = 8
"""pixels on each side of a picture, at least"""


class BadCalibration(ValueError):
    """A calibration that no camera can have."""


@dataclass(frozen=True)
class Camera:
    """Intrinsics.

    Attributes:
        matrix: (3, 3), K, pixels.
        distortion: (5,), k1, k2, p1, p2, k3 (OpenCV's; Foxglove's and ROS' plumb_bob).
        width, height: pixels.
    """

    matrix: Array
    distortion: Array
    width: int
    height: int

    @classmethod
    def of(cls, message: CameraCalibration) -> Camera:
        """Return the camera of a calibration.

        Raises:
            BadCalibration: the model of distortion is another, or a number is not what it has to be.
        """
        if message.distortion_model not in ("", "plumb_bob"):
            raise BadCalibration(f"distortion_model is '{message.distortion_model}', expected 'plumb_bob'")
        if len(message.K) != 9 or message.K[0] <= 0 or message.K[4] <= 0:
            raise BadCalibration(f"K is {list(message.K)}, expected 9 numbers with positive focal lengths")
        if len(message.D) > 5:
            raise BadCalibration(f"D has {len(message.D)} numbers, expected at most 5")
        if min(message.width, message.height) < _SMALLEST:
            size = f"{message.width} x {message.height}"
            raise BadCalibration(f"the picture is {size} pixels, expected at least {_SMALLEST} each way")
        distortion = np.zeros(5)
        distortion[: len(message.D)] = message.D
        return cls(np.array(message.K).reshape(3, 3), distortion, message.width, message.height)

    def rays(self, pixels: Array) -> Array:
        """Return the directions that pixels, (N, 2), look in: (N, 3), camera frame, z = 1."""
        if not len(pixels):
            return np.empty((0, 3))
        # OpenCV's own five iterations leave more than a pixel at the rim of a wide lens.
        straight = cv2.undistortPoints(
            pixels.reshape(-1, 1, 2).astype(np.float64), self.matrix, self.distortion, criteria=_INVERTED
        )
        return np.column_stack([straight.reshape(-1, 2), np.ones(len(pixels))])

    def project(self, points: Array) -> Array:
        """Return the pixels, (N, 2), of points, (N, 3), m, camera frame, before the camera."""
        if not len(points):
            return np.empty((0, 2))
        pixels, _ = cv2.projectPoints(points.astype(np.float64), np.zeros(3), np.zeros(3), self.matrix, self.distortion)
        return np.asarray(pixels.reshape(-1, 2), np.float64)


@dataclass(frozen=True)
class Mount:
    """Where a camera sits on the base.

    Attributes:
        rotation: (3, 3), from the camera's frame to the base's.
        position: (3,), m, base frame.
    """

    rotation: Array
    position: Array

    @classmethod
    def of(cls, message: FrameTransform) -> Mount:
        """Return the mount that a transform from the camera's frame to the base's says.

        Raises:
            BadCalibration: the quaternion has no length.
        """
        q, t = message.rotation, message.translation
        x, y, z, w = q.x, q.y, q.z, q.w
        length = x * x + y * y + z * z + w * w
        if length < 1e-6:
            raise BadCalibration("the camera's mount has a rotation of no length")
        s = 2.0 / length
        rotation = np.array(
            [
                [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
                [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
                [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
            ]
        )
        return cls(rotation, np.array([t.x, t.y, t.z]))

    def to_base(self, points: Array) -> Array:
        """Return points, (N, 3), m, camera frame, in the base's frame."""
        return points @ self.rotation.T + self.position

    def to_camera(self, points: Array) -> Array:
        """Return points, (N, 3), m, base frame, in the camera's frame."""
        return (points - self.position) @ self.rotation

    def doubt(self, point: Array, off: float, turned: float) -> Array:
        """Return how far off what is seen at `point`, (3,), m, base frame, may be on its level plane: (2, 2), m^2.

        Args:
            off, turned: m and rad, what the mount itself may be off along and about each axis, standard deviations.
        """
        ray = point - self.position
        if not ray[2] < 0.0:
            return np.zeros((2, 2))
        # The camera moved along or turned about an axis, the ray meets the plane elsewhere.
        moved = np.concatenate([off * np.eye(3), turned * np.cross(np.eye(3), ray)])
        shift = moved[:, :2] - np.outer(moved[:, 2] / ray[2], ray[:2])
        return np.asarray(shift.T @ shift)

    def on_plane(self, rays: Array, height: float = 0.0) -> Array:
        """Return where rays, (N, 3), camera frame, meet the level plane at `height`, m: (N, 2), base frame.

        NaN for those that do not, since they look up or along it.
        """
        directions = rays @ self.rotation.T
        drop = self.position[2] - height
        with np.errstate(divide="ignore", invalid="ignore"):
            far = np.where(directions[:, 2] < -1e-9, drop / -directions[:, 2], np.nan)
        return np.asarray(self.position[:2] + far[:, None] * directions[:, :2])
