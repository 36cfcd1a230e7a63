"""Records a live system: every message on the bus to MCAP, from now on, so that the file replays by itself.

Run by the launcher as `python -m runtime.live.record --plan PLAN`, where it records when asked to; and by
`pushlane record` from any machine of the system.
"""

from __future__ import annotations

import argparse
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec
import zenoh

from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import client
from runtime.errors import PushlaneError
from runtime.live.deck import Deck
from runtime.live.ends import fail
from runtime.live.plan import Plan
from runtime.live.split import Split
from runtime.live.tape import Tape

_PATIENCE = 10.0


class NoSystem(PushlaneError):
    """No live system answers at the meeting point."""


def ask_for_plan(session: zenoh.Session, keys: Keys, patience: float = _PATIENCE) -> Plan:
    """Return the plan of the system that runs.

    Raises:
        NoSystem: nobody tells it.
    """
    deadline = time.monotonic() + patience
    while time.monotonic() < deadline:
        for reply in session.get(keys.session(), timeout=1.0):
            if reply.ok is not None:
                return msgspec.json.decode(bytes(reply.ok.payload), type=Plan)
        time.sleep(0.1)
    raise NoSystem(f"no running system of robot '{keys.root.partition('/')[2]}' answered within {patience:g} s")


def record(
    bus: BusConfig,
    path: Path,
    patterns: Sequence[str],
    split: Split,
    stop: threading.Event,
    say: Callable[[str], None],
) -> Tape:
    """Record until `stop`. Returns the tape, which knows what was recorded and what was missed.

    Raises:
        NoBus, NoSystem, CannotRecord: see there.
    """
    keys = Keys(bus.robot)
    with client(bus) as session:
        tape = Tape(session, keys, path, ask_for_plan(session, keys), patterns, split, say)
        try:
            while not stop.wait(0.2) and tape.failure is None:
                pass
        finally:
            tape.close()
        return tape


def main() -> None:
    """Run the recorder that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plan", type=Path, required=True)
    parser.add_argument("--state", type=Path, required=True)
    parser.add_argument("--incarnation", type=int, default=0)
    parser.add_argument("--file", type=Path)
    given = parser.parse_args()
    stop = threading.Event()
    signal.signal(signal.SIGINT, lambda *_: stop.set())
    signal.signal(signal.SIGTERM, lambda *_: stop.set())
    try:
        plan = Plan.read(given.plan)
        with client(plan.bus(), _PATIENCE) as session:
            deck = Deck(session, Keys(plan.robot), plan, given.state, given.incarnation)
            deck.run(stop, given.file)
    except PushlaneError as error:
        fail("recorder", error)
    sys.exit(0)


if __name__ == "__main__":
    main()
