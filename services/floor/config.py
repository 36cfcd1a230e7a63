"""Settings of the floor service."""

from typing import Annotated, Literal

import msgspec
from msgspec import Meta


class FloorConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of what is looked at of the floor."""

    sees: Annotated[
        Literal["appearance", "depth"],
        Meta(description="what tells the floor from what stands on it: how it looks, or depth where it is measured"),
    ] = "appearance"
    period: Annotated[float, Meta(ge=0, le=60, description="s between two pictures that are looked at, at least")] = 0.2
    furthest: Annotated[
        float, Meta(gt=0.3, le=20, description="m from below the camera, where looking ends: pixels grow with it")
    ] = 2.5
    base_height: Annotated[
        float, Meta(ge=0, le=2, description="m, of the robot's own body, which hides what is close to it")
    ] = 0.25
