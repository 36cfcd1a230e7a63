"""Counts what goes wrong on a wire, by kind, and says it in words, but not every time."""

from __future__ import annotations

from dataclasses import dataclass, field

from runtime.messages import Count
from runtime.time import SECOND, Time

_QUIET = SECOND


@dataclass
class Faults:
    """What went wrong so far.

    Attributes:
        counts: by kind. said: ns, when each kind was said last.
    """

    counts: dict[str, int] = field(default_factory=dict)
    said: dict[str, Time] = field(default_factory=dict)

    def note(self, kind: str, detail: str, now: Time) -> list[str]:
        """Count one; return what is to be said of it: nothing if the same kind was said less than a second ago."""
        self.counts[kind] = self.counts.get(kind, 0) + 1
        if now - self.said.get(kind, -_QUIET) < _QUIET:
            return []
        self.said[kind] = now
        return [f"{kind}: {detail} ({self.counts[kind]} so far)"]

    def messages(self) -> list[Count]:
        """Return the counts as status says them."""
        return [Count(name=name, value=value) for name, value in sorted(self.counts.items())]
