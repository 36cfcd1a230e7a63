"""Records a live system: every message on the bus to MCAP, from now on, so that the file replays by itself.

Run by the launcher as `python -m runtime.live.record FILE --plan PLAN`, or by `pushlane record`.
"""

from __future__ import annotations

import argparse
import fnmatch
import queue
import signal
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path

import msgspec
import zenoh

from runtime.bus import envelope
from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import client
from runtime.errors import PushlaneError
from runtime.live.host import fail
from runtime.live.plan import Plan
from runtime.recorder import header
from runtime.recorder.writer import Recorder
from runtime.sample import Sample
from runtime.topics import TOPICS

_PATIENCE = 10.0
_SETTLE = 0.3


class NoSystem(PushlaneError):
    """No live system answers at the meeting point."""


class Tape:
    """Subscribes to everything and writes it down on one thread of its own.

    Args:
        topics: patterns of what to record; the runtime's own topics are always recorded, for replay needs them.
    """

    def __init__(self, session: zenoh.Session, keys: Keys, path: Path, plan: Plan, patterns: Sequence[str]) -> None:
        self._keys = keys
        self._patterns = patterns
        self._queue: queue.SimpleQueue[Sample | None] = queue.SimpleQueue()
        self._recorder = Recorder(path, header.of_this_machine("live", plan.seed, plan.nodes), plan.config())
        self._session = session
        self.failure: PushlaneError | None = None
        self._thread = threading.Thread(target=self._write, name="tape")
        self._thread.start()
        self._subscriber = session.declare_subscriber(keys.everything(), self._receive)

    @property
    def count(self) -> int:
        """Return how many messages were written."""
        return self._recorder.count

    def join(self) -> None:
        """Ask for what a recording begins with: latched values, and a snapshot of every node."""
        for topic, row in TOPICS.items():
            if row.latched:
                for reply in self._session.get(self._keys.latched(topic), timeout=1.0):
                    if reply.ok is not None and reply.ok.attachment is not None:
                        attachment = bytes(reply.ok.attachment)
                        self._queue.put(envelope.unpack(topic, bytes(reply.ok.payload), attachment))
        # What was sent before the subscription was in force must have been handled before the snapshot.
        time.sleep(_SETTLE)
        for _ in self._session.get(self._keys.snapshot("*"), timeout=2.0):
            pass  # each node also publishes it, at its place in the journal

    def close(self) -> None:
        """Write what has come, and end the file.

        Raises:
            CannotRecord: that was not possible.
        """
        self._subscriber.undeclare()
        self._queue.put(None)
        self._thread.join()
        self._recorder.close()

    def _receive(self, sample: zenoh.Sample) -> None:
        topic = self._keys.name(str(sample.key_expr))
        attachment = None if sample.attachment is None else bytes(sample.attachment)
        try:
            self._queue.put(envelope.unpack(topic, bytes(sample.payload), attachment))
        except envelope.BadEnvelope:
            return  # no message of ours: a service that consumes it counts and reports it

    def _write(self) -> None:
        seen: set[tuple[str, int]] = set()
        while True:
            sample = self._queue.get()
            if sample is None:
                return
            if not self._wanted(sample.topic) or (sample.topic, sample.sequence) in seen:
                continue
            if sample.topic in TOPICS and TOPICS[sample.topic].latched:
                seen.add((sample.topic, sample.sequence))  # came as answer and by subscription
            try:
                self._recorder(sample)
            except PushlaneError as error:
                self.failure = error
                return
            except KeyError:
                continue  # a key that is no topic of ours

    def _wanted(self, topic: str) -> bool:
        return topic not in TOPICS or any(fnmatch.fnmatch(topic, pattern) for pattern in self._patterns)


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


def record(bus: BusConfig, path: Path, patterns: Sequence[str], stop: threading.Event) -> int:
    """Record until `stop`. Returns how many messages were written.

    Raises:
        NoBus, NoSystem, CannotRecord: see there.
    """
    keys = Keys(bus.robot)
    with client(bus) as session:
        tape = Tape(session, keys, path, ask_for_plan(session, keys), patterns)
        token = session.liveliness().declare_token(keys.node("recorder"))
        try:
            tape.join()
            while not stop.wait(0.2) and tape.failure is None:
                session.put(keys.beat("recorder"), b"")
            time.sleep(_SETTLE)  # what the services sent last is still on its way
        finally:
            token.undeclare()
            tape.close()
        if tape.failure is not None:
            raise tape.failure
        return tape.count


def main() -> None:
    """Run the recorder that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--plan", type=Path, required=True)
    given = parser.parse_args()
    stop = threading.Event()
    signal.signal(signal.SIGINT, lambda *_: stop.set())
    signal.signal(signal.SIGTERM, lambda *_: stop.set())
    try:
        record(Plan.read(given.plan).bus(), given.file, ["*"], stop)
    except PushlaneError as error:
        fail("recorder", error)
    sys.exit(0)


if __name__ == "__main__":
    main()
