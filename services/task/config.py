"""Settings of the task service."""

from typing import Annotated

import msgspec
from msgspec import Meta

from services.names import Controller, Strategy

YAW_PRECISION = (0.05, 3.15)
"""rad, least and largest precision of an orientation: below the first, a tracker's noise of 2 degrees decides"""


class TaskConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the task service (Sec. 6.2). What a goal leaves open is taken from here."""

    strategy: Annotated[Strategy, Meta(description="of goals that name none")] = "predictive"
    controller: Annotated[Controller, Meta(description="of goals that name none")] = "predictive"
    precision: Annotated[float, Meta(gt=0, le=5, description="m, of goals that state none")] = 0.1
    yaw_precision: Annotated[
        float,
        Meta(
            ge=YAW_PRECISION[0],
            le=YAW_PRECISION[1],
            description="rad, of goals that ask for an orientation and state no precision of it",
        ),
    ] = 0.2618
    confirmations: Annotated[
        int, Meta(ge=1, le=100, description="object states in a row within the precision that make a delivery")
    ] = 3
    rest: Annotated[
        float,
        Meta(
            ge=0.1,
            le=5,
            description="s that the object is to be at rest within the precision to be delivered with the predictive "
            "strategy, which can wait for what still moves",
        ),
    ] = 0.4
    rest_speed: Annotated[float, Meta(gt=0, le=2, description="m/s below which an object counts as at rest")] = 0.04
    rest_turn: Annotated[
        float, Meta(gt=0, le=10, description="rad/s below which it does, where an orientation is wanted")
    ] = 0.2
    shared: Annotated[
        bool,
        Meta(
            description="the object is seen from the robot: the error of the robot's own place is in all observations, "
            "and no mean of them lessens it"
        ),
    ] = False
    time_limit: Annotated[float, Meta(gt=0, le=36000, description="s, of goals that state none")] = 400.0
    violation_tolerance: Annotated[
        float,
        Meta(ge=0, le=0.5, description="m a centre may seem outside the corridor: the noise of positions"),
    ] = 0.02
    stop_on_violation: Annotated[
        bool, Meta(description="end the push as failed when a centre leaves the pushing corridor")
    ] = True
    lost_after: Annotated[float, Meta(gt=0, le=600, description="s without the object before the push fails")] = 10.0
    planning_limit: Annotated[float, Meta(gt=0, le=600, description="s to wait for a corridor")] = 10.0
    stall_after: Annotated[float, Meta(gt=0, le=36000, description="s without progress before the push fails")] = 60.0
    stall_progress: Annotated[float, Meta(gt=0, le=5, description="m that count as progress")] = 0.05
    stall_turn: Annotated[
        float, Meta(gt=0, le=3.15, description="rad towards the wanted orientation that count as progress")
    ] = 0.175
