"""Settings of the simulated driver and of the perception that stands in for mapping and tracker."""

from typing import Annotated

import msgspec
from msgspec import Meta

from drivers.sapien.base import BaseModel
from drivers.sapien.objects import ObjectBody
from drivers.sapien.scene import Scene
from drivers.sapien.sensors import Laser, RangeRing

Seed = Annotated[int, Meta(ge=0, le=2**63 - 1)]


class SapienConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the simulated driver. `scene` and `body` hold what was drawn for this session, whole.

    A command's age is counted from the odometry it names. The base is stopped when the newest one gets older
    than its own deadline, or than `deadline` if that is less.
    """

    seed: Seed
    scene: Scene
    body: ObjectBody
    base: BaseModel = BaseModel()
    laser: Laser = Laser()
    ring: RangeRing = RangeRing()
    deadline: Annotated[float, Meta(gt=0.05, le=2, description="s, longest age of a command")] = 0.5
    battery_voltage: Annotated[float, Meta(gt=0, le=100, description="V")] = 24.0


class TruthPerceptionConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the perception by truth: what mapping and tracker would say, with their noise and delay."""

    seed: Seed
    scene: Scene
    object_diameter: Annotated[float, Meta(gt=0, le=10, description="d_o, m, of the object's bounding circle")]
    object_noise: Annotated[float, Meta(ge=0, le=1, description="m, standard deviation in x and in y")] = 0.007
    object_yaw_noise: Annotated[float, Meta(ge=0, le=3.15, description="rad, standard deviation")] = 0.035
    robot_noise: Annotated[float, Meta(ge=0, le=1, description="m, standard deviation in x and in y")] = 0.005
    robot_yaw_noise: Annotated[float, Meta(ge=0, le=3.15, description="rad, standard deviation")] = 0.01
    latency_low: Annotated[float, Meta(ge=0, le=2, description="s, least delay of a position")] = 0.05
    latency_high: Annotated[float, Meta(ge=0, le=2, description="s, longest delay of a position")] = 0.10
    yaw: Annotated[bool, Meta(description="whether the object's orientation is seen")] = True
    map_resolution: Annotated[float, Meta(ge=0.01, le=0.5, description="m a cell")] = 0.05

    def __post_init__(self) -> None:
        if self.latency_low > self.latency_high:
            raise ValueError(
                f"latency_low is {self.latency_low} s, expected at most latency_high, {self.latency_high} s"
            )
