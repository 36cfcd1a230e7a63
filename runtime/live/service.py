"""Starts one live host: `python -m runtime.live.service NAME --plan FILE`. The launcher's work."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import msgspec

from runtime import registry
from runtime.bus.keys import Keys
from runtime.bus.session import client
from runtime.errors import PushlaneError
from runtime.guard import Guard
from runtime.live.config import LiveConfig
from runtime.live.ends import fail, stop_on_signals
from runtime.live.host import LiveHost
from runtime.live.plan import Plan
from runtime.messages import Snapshot
from runtime.node import Node

_PATIENCE = 15.0
# Zenoh's threads bring messages while a handler computes: let them in twenty times as often as Python would.
_SWITCH_INTERVAL = 0.00025


def main() -> None:
    """Run the host that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name")
    parser.add_argument("--plan", type=Path, required=True)
    parser.add_argument("--incarnation", type=int, default=0)
    parser.add_argument("--resume", type=Path)
    given = parser.parse_args()
    sys.setswitchinterval(_SWITCH_INTERVAL)
    try:
        serve(given.name, Plan.read(given.plan), given.incarnation, given.resume)
    except PushlaneError as error:
        fail(given.name, error)


def serve(name: str, plan: Plan, incarnation: int, resume: Path | None) -> None:
    """Host the service `name` until a signal ends it.

    Raises:
        PushlaneError: it cannot start, or its service broke its contract.
    """
    kind = registry.service_class(name)
    config = msgspec.convert(plan.sections[name], kind.Config)
    service, wire = kind(config), registry.wire(name, plan.nodes, config)
    live = msgspec.convert(plan.sections.get("live", {}), LiveConfig)
    last = Snapshot.FromString(resume.read_bytes()) if resume is not None else None
    with client(plan.bus(), _PATIENCE) as session, Guard() as guard:
        host = LiveHost(Node(service, guard), session, Keys(plan.robot), live, incarnation, last, wire)
        stop_on_signals(host)
        host.run()


if __name__ == "__main__":
    main()
