"""The [bus] section: which robot, where its processes meet, and who may do what there."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

_SECURE = "tls/"
_LOOPBACK = ("tcp/127.0.0.1:7447",)
_NAME = Annotated[str, Meta(pattern=r"^[A-Za-z0-9]([A-Za-z0-9.-]{0,62}[A-Za-z0-9])?$")]


class TlsConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The certificate that this machine, or this person, shows, and the authority whose certificates it believes.

    Paths are relative to the configuration file, as `--set` to the working folder. Only paths: the configuration
    goes into every recording.
    """

    ca: Annotated[str, Meta(min_length=1, description="file: certificate of the authority, PEM")]
    certificate: Annotated[str, Meta(min_length=1, description="file: own certificate, PEM")]
    key: Annotated[str, Meta(min_length=1, description="file: key of the own certificate, PEM, readable by its owner")]


class AccessConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Who may do what, by the common name of the certificate. Who is not named may do nothing.

    A host may publish what its services publish, and answer for them, and no more: only the controller's host may
    publish `command`.
    """

    hosts: Annotated[
        dict[_NAME, tuple[str, ...]],
        Meta(description="host -> the services that it runs; the section [hosts] of the file if absent"),
    ] = {}
    operators: Annotated[
        tuple[_NAME, ...], Meta(description="who may ask for something: set and cancel goals; they also see everything")
    ] = ()
    watchers: Annotated[tuple[_NAME, ...], Meta(description="who may see and record everything, and no more")] = ()

    def __post_init__(self) -> None:
        if not self.hosts:
            raise ValueError("access without hosts: expected host -> services, here or in the section [hosts]")


class BusConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where the processes of one robot meet.

    One of them is the hub, a Zenoh router inside our own process; the others are its clients. Loopback only by
    default, with multicast off: two people on one network never drive each other's robot.
    """

    robot: Annotated[
        str, Meta(min_length=1, max_length=64, description="name of the robot, first part of all keys")
    ] = "robot"
    listen: Annotated[tuple[str, ...], Meta(min_length=1, description="Zenoh endpoints at which the hub listens")] = (
        _LOOPBACK
    )
    connect: Annotated[
        tuple[str, ...], Meta(min_length=1, description="Zenoh endpoints at which clients look for the hub")
    ] = _LOOPBACK
    lease: Annotated[
        float, Meta(ge=0.5, le=60, description="s without a sign of life after which a link is given up")
    ] = 2.0
    tls: Annotated[TlsConfig | None, Meta(description="mutual TLS: ca, certificate and key; absent: none")] = None
    access: Annotated[
        AccessConfig | None, Meta(description="who may do what at the hub: hosts, operators, watchers; absent: all")
    ] = None

    def __post_init__(self) -> None:
        # Who offers no meeting point need not say where: with TLS the default is one where the hub cannot open.
        listen = () if self.listen == _LOOPBACK else self.listen
        for place in (*listen, *self.connect):
            if self.tls is None and place.startswith(_SECURE):
                raise ValueError(f"endpoint {place} needs bus.tls: expected ca, certificate and key")
            if self.tls is not None and not place.startswith(_SECURE):
                # One plain endpoint beside the others would let everybody in.
                raise ValueError(
                    f"endpoint {place} is not encrypted: expected {_SECURE}HOST:PORT, since bus.tls is set"
                )
        if self.access is not None and self.tls is None:
            raise ValueError("bus.access needs bus.tls: without certificates nobody has a name")
