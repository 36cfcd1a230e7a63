"""Settings of the strategy service."""

from typing import Annotated

import msgspec
from msgspec import Meta


class PredictiveConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the predictive strategy, and of the controller that follows it."""

    speed: Annotated[float, Meta(gt=0, le=2, description="V, m/s")] = 0.3
    approach: Annotated[float, Meta(gt=0, le=10, description="m/s^2, slow down towards the goal as if braking so")] = (
        0.15
    )
    slowest: Annotated[float, Meta(gt=0, le=2, description="m/s, least speed of the approach")] = 0.06
    margin: Annotated[float, Meta(ge=0, le=1, description="m the robot keeps from the corridor's edge")] = 0.02
    horizon: Annotated[float, Meta(ge=2.5, le=20, description="s to look ahead")] = 7.0
    caution: Annotated[float, Meta(gt=0, le=1, description="share of the speed while the object is a stranger")] = 0.5
    wheels: Annotated[float, Meta(gt=0, le=1, description="share of the speed where the object has wheels")] = 0.67
    acquainted: Annotated[int, Meta(ge=0, le=1000, description="observations of pushes that end the caution")] = 12
    lead: Annotated[float, Meta(ge=0, le=1, description="s from a plan to when it moves the base")] = 0.05


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
    predictive: PredictiveConfig = PredictiveConfig()
