"""What a camera says of itself on the bus: its intrinsics, and where its optical frame is on the base."""

from __future__ import annotations

from math import cos, sin

from drivers.camera.config import CalibrationConfig, MountConfig
from runtime.messages import CameraCalibration, FrameTransform
from runtime.time import SECOND, Time

FRAME = "camera"
"""The camera's optical frame: x right, y down, z forward."""
BASE = "base"

Quaternion = tuple[float, float, float, float]  # x, y, z, w

_OPTICAL: Quaternion = (-0.5, 0.5, -0.5, 0.5)
"""From the optical frame to that of a camera's body, which looks along x with z up."""


def calibration(config: CalibrationConfig, now: Time) -> CameraCalibration:
    """Return the intrinsics; R is the identity and P holds K: there is one camera, and nothing is rectified."""
    (fx, fy), (cx, cy) = config.focal, config.centre
    message = CameraCalibration(
        frame_id=FRAME,
        width=config.width,
        height=config.height,
        distortion_model="plumb_bob",
        D=config.distortion,
        K=[fx, 0, cx, 0, fy, cy, 0, 0, 1],
        R=[1, 0, 0, 0, 1, 0, 0, 0, 1],
        P=[fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0],
    )
    message.timestamp.seconds, message.timestamp.nanos = divmod(now, SECOND)
    return message


def mount(config: MountConfig, now: Time) -> FrameTransform:
    """Return the transform from the optical frame to the base's."""
    message = FrameTransform(parent_frame_id=BASE, child_frame_id=FRAME)
    message.timestamp.seconds, message.timestamp.nanos = divmod(now, SECOND)
    message.translation.x, message.translation.y, message.translation.z = config.x, config.y, config.z
    q = rotation(config.roll, config.pitch, config.yaw)
    message.rotation.x, message.rotation.y, message.rotation.z, message.rotation.w = q
    return message


def rotation(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return the rotation from the optical frame to the base's, angles in rad as `MountConfig` has them."""
    about_x: Quaternion = (sin(roll / 2), 0.0, 0.0, cos(roll / 2))
    about_y: Quaternion = (0.0, sin(pitch / 2), 0.0, cos(pitch / 2))
    about_z: Quaternion = (0.0, 0.0, sin(yaw / 2), cos(yaw / 2))
    return _product(_product(_product(about_z, about_y), about_x), _OPTICAL)


def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )
