"""Settings of the corridor service."""

from typing import Annotated, Literal

import msgspec
from msgspec import Meta


class CorridorConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the corridor service (Sec. 3)."""

    threshold: Annotated[float, Meta(gt=0, le=1, description="m, disagreement that Algorithm 1 acts on")] = 0.05
    object_margin: Annotated[
        float, Meta(ge=0, le=1, description="m around the object within which hits are taken for the object")
    ] = 0.10
    object_speed: Annotated[
        float,
        Meta(ge=0, le=5, description="m/s that it may have been pushed on since it was seen, and that more margin"),
    ] = 0.0
    scan_maximum: Annotated[float, Meta(gt=0, le=200, description="m, laser readings from here on met nothing")] = 10.0
    path_weight: Annotated[
        float,
        Meta(ge=0, le=100, description="how much the path keeps away from obstacles where there is room"),
    ] = 3.0
    clearance_cap: Annotated[float, Meta(gt=0, le=10, description="m, clearances beyond this count as this")] = 1.5
    unknown: Annotated[
        Literal["occupied", "free"],
        Meta(description="what cells count as that nobody has seen yet: free where the map grows while pushing"),
    ] = "occupied"
    map_threshold: Annotated[
        float, Meta(gt=0, le=5, description="m by which the map has to come nearer to the path for a new plan")
    ] = 0.12
    map_gain: Annotated[
        float, Meta(gt=0, le=5, description="m by which it has to leave the path free for a new plan")
    ] = 0.3
    spare: Annotated[
        float,
        Meta(ge=0, le=2, description="m of clearance beyond what is needed that the path keeps wherever a way has it"),
    ] = 0.0
    steady: Annotated[
        bool, Meta(description="a new plan keeps to the way of the last while that is roomy and none is clearly better")
    ] = False
    apart: Annotated[
        bool, Meta(description="the map has neither object nor robot, so that what is near them is an obstacle")
    ] = False
