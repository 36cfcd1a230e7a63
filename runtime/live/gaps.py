"""Finds the messages that never came, by the numbers of those that did."""

from __future__ import annotations

from dataclasses import dataclass, field

from runtime.sample import INCARNATION, Sample


@dataclass
class Gaps:
    """Watches the numbers of every topic.

    Attributes:
        missed: topic -> how many never came; of a journal, how many entries.
    """

    missed: dict[str, int] = field(default_factory=dict)
    _last: dict[str, int] = field(default_factory=dict)

    @property
    def total(self) -> int:
        """Return how many messages never came."""
        return sum(self.missed.values())

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
        self.missed[sample.topic] = self.missed.get(sample.topic, 0) + count
        what = "entries" if first is not None else "messages"
        numbers = f"{expected} to {begin - 1}" if count > 1 else f"{expected}"
        return f"missed {count} {what} of '{sample.topic}': {numbers}"
