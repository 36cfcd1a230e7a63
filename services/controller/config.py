"""Settings of the controller service."""

from typing import Annotated

import msgspec
from msgspec import Meta


class ControllerConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the controller service (Sec. 5.1, 5.2, 6.1, 6.3.3)."""

    rate: Annotated[float, Meta(ge=1, le=200, description="Hz, of commands")] = 20.0
    speed: Annotated[float, Meta(gt=0, le=2, description="V, m/s")] = 0.3
    approach_deceleration: Annotated[
        float, Meta(ge=0, le=10, description="m/s^2, slow down towards the goal as if braking so; 0: V throughout")
    ] = 0.15
    approach_speed: Annotated[float, Meta(gt=0, le=2, description="m/s, least speed of the approach")] = 0.1
    k_gamma: Annotated[float, Meta(ge=0, le=10, description="K_gamma, gain on gamma in (8)")] = 0.1
    k_mu_gamma: Annotated[float, Meta(ge=0, le=10, description="K_mu_gamma, gain on the mean of gamma in (8)")] = 0.05
    centroid_k_g: Annotated[float, Meta(gt=0, le=10, description="1/s, K_g of centroid alignment")] = 0.2
    centroid_k_c: Annotated[float, Meta(gt=0, le=10, description="1/s, K_c of centroid alignment")] = 0.4
    centroid_saturation: Annotated[float, Meta(gt=0, le=2, description="m/s, limit of centroid alignment")] = 0.2
    heading_p: Annotated[float, Meta(ge=0, le=20, description="1/s, P of the turn towards the object")] = 1.5
    heading_d: Annotated[float, Meta(ge=0, le=20, description="D of the turn towards the object")] = 0.2
    heading_limit: Annotated[float, Meta(gt=0, le=10, description="rad/s")] = 1.0
    deadline: Annotated[float, Meta(gt=0.02, le=2, description="s a command may be old")] = 0.2
    patience: Annotated[
        float,
        Meta(gt=0, le=5, description="s without a new object or robot position before the base is stopped"),
    ] = 0.5
    silence: Annotated[
        float, Meta(gt=0, le=60, description="s without news of the push from the task after which the base is stopped")
    ] = 1.0
    barrier: Annotated[bool, Meta(description="keep the robot inside the corridor; off as in the paper")] = False
    barrier_margin: Annotated[float, Meta(ge=0, le=1, description="m kept from the corridor's edge")] = 0.02
    predicted_share: Annotated[
        float, Meta(ge=0, le=1, description="share of the speed while the tracker only predicts the object")
    ] = 0.5
    seek: Annotated[
        float, Meta(ge=0, le=3, description="rad/s of the base that looks for a lost object; 0: it stands still")
    ] = 0.5
