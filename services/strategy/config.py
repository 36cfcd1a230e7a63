"""Settings of the strategy service."""

from typing import Annotated

import msgspec
from msgspec import Meta


class StrategyConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the strategy service (Sec. 4)."""

    lookahead: Annotated[float, Meta(gt=0, le=2, description="m, of the fixed-lookahead strategy (Sec. 6.3.2)")] = 0.1
    strict_fallback: Annotated[
        float, Meta(ge=0, le=2, description="m, look-ahead where the strict strategy has no target")
    ] = 0.1
    relaxed_fallback: Annotated[
        float, Meta(ge=0, le=2, description="m, look-ahead where the relaxed strategy has no target")
    ] = 0.3
    switch_ratio: Annotated[
        float,
        Meta(
            gt=0,
            le=10,
            description="least corridor width over d_r + d_o below which switching is relaxed (Sec. 7.1)",
        ),
    ] = 1.0
