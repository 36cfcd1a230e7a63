"""Settings of the learner service."""

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from services.predictive.known import Known


class LearnerConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the learner service (Sec. 5.3)."""

    r0: Annotated[float, Meta(ge=0, le=1e6, description="R_0, prior hyperparameter")] = 5.84
    c: Annotated[float, Meta(gt=0, le=1e6, description="c, prior hyperparameter; above R_0")] = 7.0
    phi: Annotated[float, Meta(ge=-3.15, le=3.15, description="rad, prior hyperparameter")] = 0.0
    window: Annotated[
        float, Meta(gt=0, le=1, description="m of object travel over which its direction is measured")
    ] = 0.03
    memory: Annotated[float, Meta(gt=0, le=60, description="s within which that travel is to happen")] = 1.0
    accept: Annotated[
        Literal["decreasing", "small"],
        Meta(description="alphas that count as good: |gamma| decreased (the paper), or |gamma| below small_gamma"),
    ] = "decreasing"
    seed: Annotated[int, Meta(ge=0, lt=2**53, description="of the search for the response")] = 1
    small_gamma: Annotated[float, Meta(gt=0, le=3.15, description="rad, for accept = small")] = 0.3
    known: Annotated[
        Known | None, Meta(description="experience of the object from an earlier push: `pushlane experience save`")
    ] = None

    def __post_init__(self) -> None:
        if self.r0 >= self.c:
            raise ValueError(f"r0 is {self.r0:g}, expected less than c, {self.c:g}")
