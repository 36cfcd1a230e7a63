"""Settings that both drivers of a Robotino share."""

from __future__ import annotations

from math import pi
from typing import Annotated

import msgspec
from msgspec import Meta

from drivers.robotino.kinematics import ROBOTINO_3_4, Geometry
from runtime.messages import MotionLimits


class BaseConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What is known of the base, and what it is told at most."""

    speed: Annotated[float, Meta(gt=0, le=2, description="m/s, most that the base is told, in any direction")] = 0.58
    angular_speed: Annotated[float, Meta(gt=0, le=3.3, description="rad/s, most that it is told")] = pi / 2
    acceleration: Annotated[float, Meta(gt=0, le=5, description="m/s^2, with which it follows commands")] = 0.4
    angular_acceleration: Annotated[float, Meta(gt=0, le=30, description="rad/s^2, the same")] = pi
    lag: Annotated[float, Meta(ge=0, le=1, description="s, of its velocity behind that")] = 0.1
    diameter: Annotated[float, Meta(gt=0, le=2, description="m, d_r, of the circle around it")] = 0.46
    deadline: Annotated[float, Meta(gt=0.05, le=0.5, description="s, longest age of a command")] = 0.5

    @property
    def geometry(self) -> Geometry:
        """Return the drive: that of Robotino 3 and 4, which have both links."""
        return ROBOTINO_3_4

    @property
    def limits(self) -> MotionLimits:
        """Return the limits as status says them."""
        return MotionLimits(
            speed=self.speed,
            angular_speed=self.angular_speed,
            acceleration=self.acceleration,
            angular_acceleration=self.angular_acceleration,
            lag=self.lag,
        )
