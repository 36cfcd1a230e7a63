"""Settings of the driver over REST, and of the laser alone."""

from __future__ import annotations

from math import radians
from typing import Annotated

import msgspec
from msgspec import Meta

from drivers.robotino.config import BaseConfig

Rate = Annotated[float, Meta(ge=0, le=20)]
Url = Annotated[str, Meta(description="of the base, as in http://172.26.1.1; the port is 80 unless said")]
ScanRate = Annotated[Rate, Meta(description="Hz, of the laser; 0: not asked")]
Timeout = Annotated[float, Meta(gt=0.02, le=2, description="s, for a whole answer")]
Offset = Annotated[float, Meta(ge=-1, le=1, description="m, base frame, where the laser sits")]
Bearing = Annotated[float, Meta(ge=-3.15, le=3.15, description="rad, where it looks")]


class RestConfig(BaseConfig, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of robotino-rest."""

    url: Url = ""
    angular_speed: Annotated[float, Meta(gt=0, le=3, description="rad/s, most that it is told")] = radians(67)
    odometry_rate: Annotated[float, Meta(ge=8, le=20, description="Hz")] = 20.0
    ranges_rate: Annotated[Rate, Meta(description="Hz, of the infra-red sensors; 0: not asked")] = 20.0
    bumper_rate: Annotated[Rate, Meta(description="Hz; 0: not asked")] = 10.0
    scan_rate: ScanRate = 10.0
    power_rate: Annotated[Rate, Meta(description="Hz, of the battery; 0: not asked")] = 1.0
    timeout: Timeout = 0.25
    laser_x: Offset = 0.1
    laser_y: Offset = 0.0
    laser_yaw: Bearing = 0.0


class LaserConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of robotino-laser."""

    url: Url = ""
    scan_rate: ScanRate = 10.0
    timeout: Timeout = 0.25
    laser_x: Offset = 0.1
    laser_y: Offset = 0.0
    laser_yaw: Bearing = 0.0
