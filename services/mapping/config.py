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
