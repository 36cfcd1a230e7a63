"""Zenoh sessions with our settings: the hub that processes meet at, and its clients.

A session must be closed, also after an error: a process with open subscribers does not end otherwise. So both come
as context managers, and closing has a time limit of its own, since it can block when the peer is gone.
"""

from __future__ import annotations

import json
import os
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress

import zenoh

from runtime.bus import certificates
from runtime.bus.access import access_control
from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.errors import PushlaneError

_CLOSE_LIMIT = 1.0
_KEEP_ALIVE = 4
_RUNTIME = "ZENOH_RUNTIME"
_RX_THREADS = 32
_QUEUE = 16
_PRIORITIES = (
    "control",
    "real_time",
    "interactive_high",
    "interactive_low",
    "data_high",
    "data",
    "data_low",
    "background",
)


class NoBus(PushlaneError):
    """The meeting point cannot be opened, or is not there."""


@contextmanager
def hub(config: BusConfig) -> Iterator[zenoh.Session]:
    """Open the meeting point of a system.

    Raises:
        NoBus: it cannot listen there, for example because another system does.
        BadCertificate: a file of [bus.tls] is wrong.
    """
    if config.tls is not None:
        certificates.check(config.tls)
    try:
        with _many_threads():
            session = zenoh.open(_config(hub_settings(config)))
    except zenoh.ZError as error:
        raise NoBus(f"cannot listen at {', '.join(config.listen)}: {_first_line(error)}") from error
    with _closing(session):
        yield session


@contextmanager
def client(config: BusConfig, patience: float = 3.0) -> Iterator[zenoh.Session]:
    """Open a session that reaches the others through the hub, and finds it again by itself when it was away.

    Args:
        patience: s to wait for the hub.

    Raises:
        NoBus: there is no hub at the endpoints, or it does not take our certificate.
        BadCertificate: a file of [bus.tls] is wrong.
    """
    if config.tls is not None:
        certificates.check(config.tls)
    settings: dict[str, object] = {
        **_common(config),
        "mode": "client",
        "connect/endpoints": list(config.connect),
        "connect/timeout_ms": 500,
        "connect/retry": {"period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 1.5},
    }
    deadline = time.monotonic() + patience
    while True:
        # In slices, since an open session attempt does not hear Ctrl-C.
        try:
            session = zenoh.open(_config(settings))
            break
        except zenoh.ZError as error:
            if time.monotonic() > deadline:
                reasons = _why(config) or _first_line(error)
                places = ", ".join(config.connect)
                raise NoBus(
                    f"no hub at {places}: {reasons}; start a system with pushlane run, or set bus.connect"
                ) from error
            time.sleep(0.1)
    with _closing(session):
        yield session


@contextmanager
def _many_threads() -> Iterator[None]:
    """Let Zenoh start with many receiving threads, unless somebody has said how many.

    A link that died without a word holds the thread that closes it for up to 10 s (zenoh issues 1101 and 2718). A
    laptop has a link for each of its services: with Zenoh's own few threads, its network cut stops all traffic of the
    robot for as long.
    """
    own = _RUNTIME not in os.environ
    os.environ.setdefault(_RUNTIME, f"(rx: (worker_threads: {_RX_THREADS}))")
    try:
        yield
    finally:
        if own:
            del os.environ[_RUNTIME]  # not for child processes


@contextmanager
def _closing(session: zenoh.Session) -> Iterator[None]:
    try:
        yield
    finally:
        closer = threading.Thread(target=_close, args=(session,), daemon=True)
        closer.start()
        closer.join(_CLOSE_LIMIT)


def _close(session: zenoh.Session) -> None:
    # An error says that the link was gone already: there is nothing left to close.
    with suppress(zenoh.ZError):
        session.close()


def hub_settings(config: BusConfig) -> dict[str, object]:
    """Return Zenoh's settings of the hub: path -> value. A router of somebody else with these does as well."""
    settings = {
        **_common(config),
        "mode": "router",
        "listen/endpoints": list(config.listen),
        "connect/endpoints": [],
    }
    if config.access is not None:
        settings["access_control"] = access_control(config.access, Keys(config.robot))
    return settings


def _common(config: BusConfig) -> dict[str, object]:
    settings: dict[str, object] = {
        "scouting/multicast/enabled": False,
        "scouting/delay": 0,
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": round(1000 * config.lease),
        "transport/link/tx/keep_alive": _KEEP_ALIVE,
        # Nobody waits for a slow link; the more room there is, the less is lost to a machine that is busy for a moment.
        "transport/link/tx/queue/size": dict.fromkeys(_PRIORITIES, _QUEUE),
    }
    if config.tls is not None:
        tls = config.tls
        settings["transport/link/protocols"] = ["tls"]
        settings["transport/link/tls"] = {
            "root_ca_certificate": tls.ca,
            "listen_certificate": tls.certificate,
            "listen_private_key": tls.key,
            "connect_certificate": tls.certificate,
            "connect_private_key": tls.key,
            "enable_mtls": True,
            "verify_name_on_connect": True,
            "close_link_on_expiration": True,
        }
    return settings


def _config(settings: Mapping[str, object]) -> zenoh.Config:
    config = zenoh.Config()
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return config


def _why(config: BusConfig) -> str:
    """Return what is wrong at each TLS endpoint."""
    if config.tls is None:
        return ""
    return ", ".join(filter(None, (certificates.why_refused(place, config.tls) for place in config.connect)))


def _first_line(error: Exception) -> str:
    # Without the place in Zenoh's own sources, which helps nobody here.
    return str(error).splitlines()[0].partition(" at /")[0][:200]
