"""Finds the messages that never came, by the numbers of those that did."""

from __future__ import annotations

from dataclasses import dataclass, field

from runtime.sample import INCARNATION, Sample


@dataclass
class Gaps:
    """Watches the numbers of every topic.

    Attributes:
        missed: topic -> how many never came; of a journal, how many entries.
        wanted: first and last sequence of the messages that the newest gap lacks.
    """

    missed: dict[str, int] = field(default_factory=dict)
    wanted: tuple[int, int] = (0, 0)
    _last: dict[str, int] = field(default_factory=dict)
    _given: dict[str, int] = field(default_factory=dict)

    @property
    def total(self) -> int:
        """Return how many messages never came."""
        return sum(self.missed.values())

    def last(self, topic: str) -> int:
        """Return the sequence of the newest message of a topic; 0 before the first."""
        return self._last.get(topic, 0)

    def give(self, topic: str, sequence: int) -> None:
        """Learn from a journal that this message was sent: the last of a topic has none after it that shows a gap."""
        self._given[topic] = max(sequence, self._given.get(topic, 0))

    def behind(self) -> dict[str, tuple[int, int]]:
        """Return the messages that were sent and have not come: topic -> (first, last)."""
        found = {}
        for topic, given in self._given.items():
            last = self._last.get(topic, 0)
            if given > last and (last == 0 or given // INCARNATION == last // INCARNATION):
                found[topic] = (last + 1 if last else given, given)
        return found

    def pass_over(self, topic: str, sequence: int) -> None:
        """Wait no longer for the messages of a topic up to this one, which were asked for."""
        self._last[topic] = max(sequence, self._last.get(topic, 0))

    def take(self, sample: Sample, first: int | None = None) -> str:
        """Take the next message of a topic in the order of arrival. Returns what is missing before it, or "".

        Args:
            first: number that this one begins with where it stands for several, as a journal's batch does.
        """
        if sample.topic.startswith("request/"):
            return ""  # numbers of requests that did not parse are used up and never published
        last = self._last.get(sample.topic, 0)
        if sample.sequence <= last:
            return ""
        self._last[sample.topic] = sample.sequence
        # A batch bears the number of the entry after its last; any other message its own.
        begin = sample.sequence if first is None else first
        expected = last + 1 if first is None else last
        if last == 0 or begin <= expected or begin // INCARNATION != last // INCARNATION:
            return ""
        count = begin - expected
        self.wanted = (expected, begin - 1) if first is None else (expected + 1, begin)
        self.missed[sample.topic] = self.missed.get(sample.topic, 0) + count
        what = "entries" if first is not None else "messages"
        numbers = f"{expected} to {begin - 1}" if count > 1 else f"{expected}"
        return f"missed {count} {what} of '{sample.topic}': {numbers}"
