"""The camera on the base as a scene describes it, and what it says of itself on the bus."""

from __future__ import annotations

import math
from math import cos, sin
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

from runtime.messages import CameraCalibration, FrameTransform

Metres = Annotated[float, msgspec.Meta(ge=-5.0, le=5.0)]
Angle = Annotated[float, msgspec.Meta(ge=-math.pi, le=math.pi)]

FRAME = "camera"
"""The camera's optical frame: x right, y down, z forward."""


class CameraModel(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A camera without distortion, high on the base: it sees what is pushed from above, and 2.5 m ahead.

    x, y, z: m, base frame, the floor at z = 0. yaw, pitch, roll: rad, turned about z, y, x in this order, from a
    camera that looks ahead; positive pitch looks down. field: rad, vertical field of view. width, height: pixels.
    exposure: times the light. noise: grey levels of 255, standard deviation. rate: Hz. latency: s from the picture
    to its message. quality: of JPEG. depth: whether it measures depth as well; depth_noise: m at 1 m, standard
    deviation, growing with the square of the range as that of cameras that triangulate. off, turned: m and rad,
    standard deviations along and about each axis of how the camera really sits to what it says of that: nobody
    measures a mount exactly.
    """

    x: Metres = 0.12
    y: Metres = 0.0
    z: Annotated[float, msgspec.Meta(ge=0.05, le=5.0)] = 1.0
    yaw: Angle = 0.0
    pitch: Angle = math.radians(50)
    roll: Angle = 0.0
    field: Annotated[float, msgspec.Meta(gt=0.1, lt=2.8)] = math.radians(76)
    width: Annotated[int, msgspec.Meta(ge=32, le=4096)] = 640
    height: Annotated[int, msgspec.Meta(ge=32, le=4096)] = 480
    exposure: Annotated[float, msgspec.Meta(gt=0.0, le=20.0)] = 1.0
    noise: Annotated[float, msgspec.Meta(ge=0.0, le=100.0)] = 3.0
    rate: Annotated[float, msgspec.Meta(ge=0.5, le=20.0)] = 10.0
    latency: Annotated[float, msgspec.Meta(ge=0.0, le=2.0)] = 0.05
    quality: Annotated[int, msgspec.Meta(ge=10, le=100)] = 90
    depth: bool = False
    depth_noise: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.003
    off: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.002
    turned: Annotated[float, msgspec.Meta(ge=0.0, le=0.5)] = math.radians(0.2)

    @property
    def focal(self) -> float:
        """Return the focal length, pixels."""
        return self.height / 2 / math.tan(self.field / 2)

    def rotation(self) -> NDArray[np.float64]:
        """Return the rotation, (3, 3), from a frame that looks along x, z up, to the base's."""
        cy, sy, cp, sp, cr, sr = (f(a) for a in (self.yaw, self.pitch, self.roll) for f in (cos, sin))
        about_z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
        about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
        about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
        return np.asarray(about_z @ about_y @ about_x)

    def calibration(self) -> CameraCalibration:
        """Return the intrinsics, pixels counted from the middle of the first one."""
        f, u, v = self.focal, (self.width - 1) / 2, (self.height - 1) / 2
        return CameraCalibration(
            frame_id=FRAME,
            width=self.width,
            height=self.height,
            distortion_model="plumb_bob",
            D=[0.0] * 5,
            K=[f, 0, u, 0, f, v, 0, 0, 1],
            R=[1, 0, 0, 0, 1, 0, 0, 0, 1],
            P=[f, 0, u, 0, 0, f, v, 0, 0, 0, 1, 0],
        )

    def mount(self) -> FrameTransform:
        """Return where the optical frame is on the base."""
        optical = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
        x, y, z, w = quaternion(self.rotation() @ optical)
        found = FrameTransform(parent_frame_id="base", child_frame_id=FRAME)
        found.translation.x, found.translation.y, found.translation.z = self.x, self.y, self.z
        found.rotation.x, found.rotation.y, found.rotation.z, found.rotation.w = x, y, z, w
        return found


def quaternion(rotation: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Return the unit quaternion x, y, z, w of a rotation, (3, 3), the largest component positive (Shepperd 1978)."""
    m = rotation
    four = np.array([m[0, 0], m[1, 1], m[2, 2], np.trace(m)])
    k = int(np.argmax(four))
    if k == 3:
        q = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], 1.0 + four[3]])
    else:
        i, j, n = k, (k + 1) % 3, (k + 2) % 3
        q = np.empty(4)
        q[i] = 1.0 + 2.0 * m[i, i] - four[3]
        q[j], q[n] = m[j, i] + m[i, j], m[n, i] + m[i, n]
        q[3] = m[n, j] - m[j, n]
    q /= np.linalg.norm(q)
    return float(q[0]), float(q[1]), float(q[2]), float(q[3])
