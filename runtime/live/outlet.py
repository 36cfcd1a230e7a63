"""What a host sends: over Zenoh, over its wire, and again where somebody missed it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import msgspec
import zenoh

from runtime.bus import envelope
from runtime.bus.keys import Keys
from runtime.live.sent import Missing, Sent
from runtime.live.wire import Wire
from runtime.sample import Sample
from runtime.topics import TOPICS

_PRIORITY = {
    "command": zenoh.Priority.REAL_TIME,
    "odometry": zenoh.Priority.REAL_TIME,
    "image": zenoh.Priority.DATA_LOW,
}
_LAST_WORDS = 0.8
"""s at most: the launcher waits 2.5 for all"""


class Outlet:
    """Sends the samples of the node called `name`.

    Args:
        kept: bytes of payloads that are kept for those who missed them.
        wire: carries those of its topic out of the process, before anybody else is told.
    """

    def __init__(self, name: str, session: zenoh.Session, keys: Keys, kept: int, wire: Wire | None = None) -> None:
        self._name = name
        self._session = session
        self._keys = keys
        self._wire = wire
        self._publishers: dict[str, tuple[zenoh.Publisher, bool]] = {}
        self._latched: dict[str, Sample] = {}
        self._sent = Sent(kept)

    def send(self, samples: list[Sample]) -> None:
        """Send them, in order."""
        for sample in samples:
            self._carry(sample)
            self.publish(sample)

    def send_last(self, samples: list[Sample]) -> None:
        """Send the last words: nothing after them shows that they lack, so here a full link is waited for."""
        for sample in samples:
            self._carry(sample)
            self._sent.add(sample)
            self._session.put(
                self._keys.topic(sample.topic),
                sample.payload,
                attachment=envelope.pack(sample.sequence, sample.time),
                congestion_control=zenoh.CongestionControl.BLOCK,
                priority=_PRIORITY.get(sample.topic, zenoh.Priority.DATA),
            )

    def _carry(self, sample: Sample) -> None:
        """Give the wire what is its own."""
        if self._wire is not None and sample.topic == self._wire.sends:
            self._wire.carry(TOPICS[sample.topic].message.FromString(sample.payload))

    def publish(self, sample: Sample) -> None:
        """Send one over Zenoh only."""
        publisher, latched = self._publishers.get(sample.topic) or self._publisher(sample.topic)
        if latched:
            self._latched[sample.topic] = sample
        _put(publisher, sample)
        self._sent.add(sample)

    def remind(self) -> None:
        """Send latched values again: who was cut off when one came must not go on with the one before.

        Else a base would be driven on after its push was ended, since nobody told the controller. Consumers and
        recorders know the number and leave it out.
        """
        for topic, sample in self._latched.items():
            _put(self._publishers[topic][0], sample)

    def teller(self, topic: str) -> Callable[[zenoh.Query], None]:
        """Return what answers those who ask for the last value of a topic."""

        def tell(query: zenoh.Query) -> None:
            sample = self._latched.get(topic)
            if sample is not None:
                _reply(query, sample)
            query.drop()

        return tell

    def send_again(self, query: zenoh.Query) -> None:
        """Answer what a recorder missed. On Zenoh's thread: the loop is not held up."""
        try:
            missing = msgspec.json.decode(b"" if query.payload is None else bytes(query.payload), type=Missing)
        except msgspec.MsgspecError as error:
            query.reply_err(f"'{self._name}': {error}")
        else:
            for sample in self._sent.find(missing):
                _reply(query, sample)
        query.drop()

    def see_off(self) -> None:
        """Wait until the hub has what was sent: a session that closes throws away what still waits for its link.

        A question that nobody answers is of the priority of most messages, and comes after them.
        """
        with suppress(zenoh.ZError):  # the link is gone, and what was sent with it
            for _ in self._session.get(self._keys.sent("nobody"), timeout=_LAST_WORDS):
                pass

    def _publisher(self, topic: str) -> tuple[zenoh.Publisher, bool]:
        publisher = self._session.declare_publisher(
            self._keys.topic(topic),
            # Never wait for a subscriber that may stall: what is lost shows as a gap in the sequence.
            congestion_control=zenoh.CongestionControl.DROP,
            priority=_PRIORITY.get(topic, zenoh.Priority.DATA),
        )
        found = self._publishers[topic] = (publisher, topic in TOPICS and TOPICS[topic].latched)
        return found


def _put(publisher: zenoh.Publisher, sample: Sample) -> None:
    publisher.put(sample.payload, attachment=envelope.pack(sample.sequence, sample.time))


def _reply(query: zenoh.Query, sample: Sample) -> None:
    query.reply(str(query.key_expr), sample.payload, attachment=envelope.pack(sample.sequence, sample.time))
