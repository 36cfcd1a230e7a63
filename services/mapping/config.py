"""Settings of the mapping service."""

from typing import Annotated

import msgspec
from msgspec import Meta


class FilterConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the particle filter."""

    particles: Annotated[int, Meta(ge=1, le=1000, description="particles, each with a map")] = 30
    seed: Annotated[int, Meta(ge=0, lt=2**53, description="of everything drawn")] = 1
    furthest: Annotated[float, Meta(gt=0, le=100, description="m, beams are looked at up to there")] = 20.0
    memory: Annotated[
        float, Meta(ge=2, le=1e6, description="scans that a cell remembers at most: what came before fades")
    ] = 12.0


class MappingConfig(FilterConfig, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the mapping service."""

    start: Annotated[
        tuple[float, float, float], Meta(description="x, y, theta: where the base starts, map frame, m and rad")
    ] = (0.0, 0.0, 0.0)
    nothing: Annotated[float, Meta(gt=0, le=200, description="m, laser readings from here on met nothing")] = 9.99
    step: Annotated[float, Meta(ge=0, le=5, description="m on which scans are matched again")] = 0.05
    turn: Annotated[float, Meta(ge=0, le=3.15, description="rad by which scans are matched again")] = 0.05
    pause: Annotated[float, Meta(ge=0, le=60, description="s after which scans are matched again, at rest")] = 0.5
    shown_memory: Annotated[
        float, Meta(ge=2, le=1e6, description="scans that a cell of the published map remembers at most")
    ] = 6.0
    map_period: Annotated[float, Meta(ge=0, le=60, description="s between two maps at least")] = 0.5
    object_margin: Annotated[
        float, Meta(ge=0, le=1, description="m around the pushed object in which nothing is taken for the room")
    ] = 0.10
    wait: Annotated[float, Meta(ge=0, le=60, description="s to wait for the object at first, not to map it")] = 3.0
