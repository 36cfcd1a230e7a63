"""Says on the bus which services are there: the topic `alive`, from Zenoh's liveliness tokens.

A token vanishes within ms of its process, so a driver knows of a dead controller before its last command runs out.
The launcher that leads a system calls the roll; a topic has one publisher.
"""

from __future__ import annotations

import threading

import zenoh

from runtime import topics
from runtime.bus import envelope
from runtime.bus.keys import Keys
from runtime.live.clock import Clock
from runtime.messages import Alive
from runtime.time import SECOND, Time

_REPEAT = SECOND


class Roll:
    """Publishes `alive` whenever a service comes or goes, and tells late joiners."""

    def __init__(self, session: zenoh.Session, keys: Keys) -> None:
        self._clock = Clock()
        self._lock = threading.Lock()
        self._present: set[str] = set()
        self._sequence = 0
        self._said: Time = 0
        self._last: tuple[bytes, bytes] | None = None
        name = topics.ALIVE.name
        self._publisher = session.declare_publisher(
            keys.topic(name), congestion_control=zenoh.CongestionControl.DROP, priority=zenoh.Priority.REAL_TIME
        )
        self._teller = session.declare_queryable(keys.latched(name), self._tell)
        self._subscriber = session.liveliness().declare_subscriber(keys.node("*"), self._hear, history=True)

    def repeat(self) -> None:
        """Say it again if it was not said for a while: a message may be lost."""
        with self._lock:
            if self._clock.now() - self._said > _REPEAT:
                self._publish()

    def close(self) -> None:
        """End it."""
        self._subscriber.undeclare()
        self._teller.undeclare()
        self._publisher.undeclare()

    def _hear(self, sample: zenoh.Sample) -> None:
        name = str(sample.key_expr).rpartition("/")[2]
        with self._lock:
            before = set(self._present)
            (self._present.add if sample.kind == zenoh.SampleKind.PUT else self._present.discard)(name)
            if self._present != before:
                self._publish()

    def _publish(self) -> None:
        self._sequence += 1
        now = self._said = self._clock.now()
        payload = Alive(stamp=now, nodes=sorted(self._present)).SerializeToString(deterministic=True)
        self._last = payload, envelope.pack(self._sequence, now)
        self._publisher.put(payload, attachment=self._last[1])

    def _tell(self, query: zenoh.Query) -> None:
        with self._lock:
            last = self._last
        if last is not None:
            query.reply(str(query.key_expr), last[0], attachment=last[1])
        query.drop()
