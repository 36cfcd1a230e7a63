"""Listens to a running system for a while."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field

import zenoh
from google.protobuf.message import DecodeError

from runtime.bus import envelope
from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import client
from runtime.sample import Sample


@dataclass
class Tally:
    """What came while listening.

    Attributes:
        seconds: s listened.
        counts, sizes: messages and bytes, by topic.
        longest: s, longest gap between two messages of a topic.
    """

    seconds: float = 0.0
    counts: dict[str, int] = field(default_factory=dict)
    sizes: dict[str, int] = field(default_factory=dict)
    longest: dict[str, float] = field(default_factory=dict)
    _last: dict[str, float] = field(default_factory=dict)

    def add(self, topic: str, size: int, now: float) -> None:
        """Take one message."""
        self.counts[topic] = self.counts.get(topic, 0) + 1
        self.sizes[topic] = self.sizes.get(topic, 0) + size
        gap = now - self._last.get(topic, now)
        self.longest[topic] = max(self.longest.get(topic, 0.0), gap)
        self._last[topic] = now

    def rate(self, topic: str) -> float:
        """Return messages a second."""
        return self.counts[topic] / self.seconds if self.seconds else 0.0


def listen(bus: BusConfig, pattern: str, duration: float, show: Callable[[Sample], None] | None = None) -> Tally:
    """Listen to the topics that match `pattern` for `duration` s, or until Ctrl-C if that is 0.

    Raises:
        NoBus: there is no meeting point.
    """
    keys, tally, lock = Keys(bus.robot), Tally(), threading.Lock()

    def hear(sample: zenoh.Sample) -> None:
        topic, payload = keys.name(str(sample.key_expr)), bytes(sample.payload)
        with lock:
            tally.add(topic, len(payload), time.monotonic())
            if show is not None and sample.attachment is not None:
                with suppress(envelope.BadEnvelope, DecodeError):  # no message of ours
                    show(envelope.unpack(topic, payload, bytes(sample.attachment)))

    with client(bus) as session:
        begin = time.monotonic()
        subscriber = session.declare_subscriber(keys.topic(pattern), hear)
        try:
            threading.Event().wait(duration or None)
        except KeyboardInterrupt:
            pass
        finally:
            subscriber.undeclare()
            tally.seconds = time.monotonic() - begin
    return tally
