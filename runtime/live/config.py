"""The [live] section: beats, patience and restarts of live hosts."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta


class LiveConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How live hosts and their launcher behave."""

    snapshot_period: Annotated[float, Meta(ge=0.1, le=3600, description="s between snapshots of each service")] = 1.0
    snapshot_rate: Annotated[
        float,
        Meta(ge=1e4, le=1e12, description="bytes a second of snapshots at most: large states are given more seldom"),
    ] = 2e6
    journal_period: Annotated[float, Meta(ge=0.01, le=0.25, description="s between journal batches")] = 0.1
    health_period: Annotated[float, Meta(ge=0.1, le=60, description="s between health messages")] = 1.0
    remind_period: Annotated[
        float, Meta(ge=0.1, le=60, description="s between repetitions of latched values, for those who missed them")
    ] = 1.0
    beat_period: Annotated[float, Meta(ge=0.02, le=5, description="s between heartbeats")] = 0.1
    frozen_after: Annotated[
        float, Meta(ge=0.2, le=60, description="s without a heartbeat after which a service is killed and restarted")
    ] = 2.0
    restarts: Annotated[int, Meta(ge=0, le=200, description="restarts of a service before the launcher gives up")] = 20
    back_off: Annotated[float, Meta(ge=0, le=60, description="s before the second restart, doubled each time")] = 0.1
    kept: Annotated[
        int,
        Meta(
            ge=0, le=1 << 30, description="bytes of sent messages that a service keeps for recorders that missed them"
        ),
    ] = 32 << 20
    largest: Annotated[int, Meta(ge=1024, le=1 << 30, description="bytes of a payload above which it is refused")] = (
        16 << 20
    )
    recordings: Annotated[str, Meta(min_length=1, description="folder of recordings that are asked for")] = "."
    split: Annotated[
        str, Meta(description="size or time after which a recording begins a new part, as 200MB or 10min; empty: never")
    ] = ""
