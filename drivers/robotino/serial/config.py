"""Settings of the driver over the serial link."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from drivers.robotino.config import BaseConfig


class SerialConfig(BaseConfig, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of robotino-serial."""

    device: Annotated[
        str, Meta(description="the serial device, as in /dev/ttyACM0; empty: the one that says it is a Robotino 3")
    ] = ""
    gyro: Annotated[bool, Meta(description="whether the board has a gyro: Robotino 3 with an MPU6000")] = False
    emergency_bumper: Annotated[
        bool, Meta(description="whether the board stops the motors by itself while the bumper is pressed")
    ] = True
    ramp: Annotated[
        float, Meta(ge=5000, le=12000, description="rpm/s, of the board's own ramps: how steeply the base stops")
    ] = 11500.0
