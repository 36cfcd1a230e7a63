"""Runs a push in lockstep: starts the workers, meets them over Zenoh, and steps them."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import msgspec
import zenoh

from runtime import registry
from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import hub
from runtime.lockstep.remote import RemoteNode, StepFailed

_READY_LIMIT = 60.0
_STOP_LIMIT = 2.0


@dataclass(frozen=True)
class Place:
    """Where a worker runs.

    Attributes:
        prefix: what its command line begins with, such as `ip netns exec NAME`.
        connect: the hub's endpoints as seen from there; those of the bus by default.
    """

    prefix: Sequence[str] = ()
    connect: Sequence[str] = ()


@dataclass(frozen=True)
class Spread:
    """Where the workers run: here, unless `places` says otherwise by the service's name."""

    bus: BusConfig
    places: Mapping[str, Place] = field(default_factory=dict)


def on_this_machine(robot: str = "lockstep") -> Spread:
    """Return the spread for workers on this machine alone, at a loopback port that is free now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    return Spread(BusConfig(robot=robot, listen=(endpoint,), connect=(endpoint,)))


@contextmanager
def workers(sections: Mapping[str, msgspec.Struct], names: Sequence[str], spread: Spread) -> Iterator[list[RemoteNode]]:
    """Start a worker for each of `names` and give them as nodes to schedule.

    Raises:
        NoBus: the hub cannot listen.
        StepFailed: a worker does not come up.
    """
    keys = Keys(spread.bus.robot)
    running: dict[str, subprocess.Popen[bytes]] = {}
    with hub(spread.bus) as session:
        try:
            for name in names:
                running[name] = _start(name, spread)
            _await(session, keys, running)
            nodes = [RemoteNode(session, keys, registry.service_class(name), sections[name]) for name in names]
            yield nodes
            for node in nodes:
                node.stop()
        finally:
            _end(running)


def _start(name: str, spread: Spread) -> subprocess.Popen[bytes]:
    place = spread.places.get(name, Place())
    command = [*place.prefix, sys.executable, "-m", "runtime.lockstep.worker", name, "--robot", spread.bus.robot]
    for endpoint in place.connect or spread.bus.connect:
        command += ["--connect", endpoint]
    # A group of its own: Ctrl-C is for the scheduler, which ends the workers.
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True)


def _await(session: zenoh.Session, keys: Keys, running: Mapping[str, subprocess.Popen[bytes]]) -> None:
    deadline = time.monotonic() + _READY_LIMIT
    while True:
        ready = {str(reply.ok.key_expr) for reply in session.liveliness().get(keys.node("*"), timeout=1.0) if reply.ok}
        missing = [name for name in running if keys.node(name) not in ready]
        if not missing:
            return
        for name in missing:
            code = running[name].poll()
            if code is not None:
                raise StepFailed(f"worker '{name}' ended with {code} before it was ready")
        if time.monotonic() > deadline:
            raise StepFailed(f"worker '{missing[0]}' was not ready within {_READY_LIMIT:g} s")
        time.sleep(0.05)


def _end(running: Mapping[str, subprocess.Popen[bytes]]) -> None:
    deadline = time.monotonic() + _STOP_LIMIT
    for process in running.values():
        try:
            process.wait(max(0.0, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            process.terminate()
    for process in running.values():
        try:
            process.wait(_STOP_LIMIT)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
