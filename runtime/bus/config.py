"""The [bus] section: which robot, and where its processes meet."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta


class BusConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where the processes of one robot meet.

    One of them is the hub, a Zenoh router inside our own process; the others are its clients. Loopback only by
    default, with multicast off: two people on one network never drive each other's robot.
    """

    robot: Annotated[
        str, Meta(min_length=1, max_length=64, description="name of the robot, first part of all keys")
    ] = "robot"
    listen: Annotated[tuple[str, ...], Meta(min_length=1, description="Zenoh endpoints at which the hub listens")] = (
        "tcp/127.0.0.1:7447",
    )
    connect: Annotated[
        tuple[str, ...], Meta(min_length=1, description="Zenoh endpoints at which clients look for the hub")
    ] = ("tcp/127.0.0.1:7447",)
    lease: Annotated[
        float, Meta(ge=0.5, le=60, description="s without a sign of life after which a link is given up")
    ] = 2.0
