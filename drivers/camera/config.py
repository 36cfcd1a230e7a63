"""Settings of the camera service: what `pushlane calibrate` writes, where the camera sits, what is expected of it."""

from __future__ import annotations

import math
from typing import Annotated

import msgspec
from msgspec import Meta

Pixels = Annotated[int, Meta(ge=16, le=8192)]
Coefficient = Annotated[float, Meta(ge=-1000, le=1000)]
Metres = Annotated[float, Meta(ge=-5, le=5)]
Angle = Annotated[float, Meta(ge=-math.pi, le=math.pi)]


class CalibrationConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Intrinsics of the camera at one size of picture. Pixels count from the middle of the first one."""

    width: Annotated[Pixels, Meta(description="pixels")]
    height: Annotated[Pixels, Meta(description="pixels")]
    focal: Annotated[
        tuple[Annotated[float, Meta(gt=1, le=1e6)], Annotated[float, Meta(gt=1, le=1e6)]],
        Meta(description="fx and fy of K, pixels"),
    ]
    centre: Annotated[
        tuple[Annotated[float, Meta(ge=-8192, le=16384)], Annotated[float, Meta(ge=-8192, le=16384)]],
        Meta(description="cx and cy of K, pixels"),
    ]
    distortion: Annotated[
        tuple[Coefficient, Coefficient, Coefficient, Coefficient, Coefficient],
        Meta(description="D, plumb_bob: k1, k2, p1, p2, k3"),
    ] = (0.0, 0.0, 0.0, 0.0, 0.0)


class MountConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where the camera sits on the base: x forward, y left, z up, the floor at z = 0.

    With all angles at 0 it looks ahead and stands upright. It is turned by R = Rz(yaw) Ry(pitch) Rx(roll).
    """

    x: Annotated[Metres, Meta(description="m, ahead of the base's centre")]
    y: Annotated[Metres, Meta(description="m, left of it")] = 0.0
    z: Annotated[float, Meta(ge=0, le=5, description="m, above the floor")]
    roll: Annotated[Angle, Meta(description="rad, about the direction of view; positive: its right side down")] = 0.0
    pitch: Annotated[Angle, Meta(description="rad, positive: looks down")]
    yaw: Annotated[Angle, Meta(description="rad, positive: looks left")] = 0.0


class CameraConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the camera service. No camera is like another: calibration and mount have no default."""

    calibration: Annotated[CalibrationConfig, Meta(description="intrinsics, as pushlane calibrate writes them")]
    mount: Annotated[MountConfig, Meta(description="where the camera sits on the base")]
    rate: Annotated[
        float, Meta(ge=0.1, le=120, description="Hz, pictures that are expected; the log says when half of them lack")
    ] = 10.0
    latency: Annotated[
        float, Meta(ge=0, le=2, description="s from the exposure of a picture until the service has it")
    ] = 0.05
