"""Settings of the tracker."""

import math
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

Seconds = Annotated[float, Meta(gt=0, le=60)]


class FilterConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the filter that follows the object."""

    visible_for: Annotated[float, Meta(gt=0, le=10, description="s after it was seen that it counts as seen")] = 0.25
    predicted_for: Annotated[float, Meta(gt=0, le=60, description="s after which it counts as lost")] = 1.0
    drag: Annotated[float, Meta(gt=0, le=60, description="s in which friction stops what nobody pushes")] = 0.15
    drag_pushed: Annotated[float, Meta(gt=0, le=60, description="s, the same beside the base")] = 3.0
    shove: Annotated[float, Meta(gt=0, le=50, description="m/s^2, accelerations of what nobody pushes")] = 0.3
    shove_pushed: Annotated[float, Meta(gt=0, le=50, description="m/s^2, the same beside the base")] = 1.5
    speed: Annotated[float, Meta(gt=0, le=10, description="m/s that it may have when it is seen first")] = 0.3
    diameter_share: Annotated[
        float, Meta(gt=0, le=1, description="share of a reading of the diameter in what is known of it, at least")
    ] = 0.05


class TrackerConfig(FilterConfig, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the tracker."""

    finds: Annotated[
        Literal["tags", "depth", "appearance"],
        Meta(
            description="what the object is found by: tags on it; depth, where the camera measures it; or that it "
            "looks other than the floor"
        ),
    ] = "tags"
    dictionary: Annotated[str, Meta(description="of the tags, by OpenCV's name")] = "DICT_4X4_50"
    first_tag: Annotated[
        int, Meta(ge=0, le=10_000, description="id of the tag on top; then that in front, left, behind, right")
    ] = 0
    cube: Annotated[float, Meta(ge=0.01, le=2, description="m, side of the cube of tags on the object")] = 0.14
    height: Annotated[float, Meta(ge=0, le=5, description="m, of the object below the cube")] = 0.2
    cube_at: Annotated[
        tuple[float, float, float],
        Meta(description="x, y, yaw of that cube, m and rad, from the object's centre and its x axis"),
    ] = (0.0, 0.0, 0.0)
    cube_off: Annotated[float, Meta(ge=0, le=1, description="m that this may be off, standard deviation")] = 0.002
    cube_turned: Annotated[float, Meta(ge=0, le=1, description="rad, the same of its yaw")] = 0.02
    mount_off: Annotated[
        float, Meta(ge=0, le=1, description="m that the camera's place on the base may be off, standard deviation")
    ] = 0.002
    mount_turned: Annotated[
        float, Meta(ge=0, le=1, description="rad that its attitude may be off about each axis, standard deviation")
    ] = 0.0035
    diameter: Annotated[float, Meta(ge=0, le=10, description="m, d_o; 0: measured, which tags cannot")] = 0.0
    largest: Annotated[float, Meta(gt=0, le=10, description="m, what is wider is no object to push")] = 0.8
    furthest: Annotated[float, Meta(gt=0.3, le=20, description="m from below the camera, where looking ends")] = 3.0
    base_height: Annotated[
        float, Meta(ge=0, le=2, description="m, of the robot's own body, which hides what is close to it")
    ] = 0.25

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, self.cube_at)):
            raise ValueError(f"cube_at is {self.cube_at}, expected finite numbers")
        if self.finds == "tags" and not self.diameter:
            raise ValueError("diameter is 0, expected d_o, m: tags do not say how large the object is")
