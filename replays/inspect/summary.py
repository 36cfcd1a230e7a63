"""What a conversion did."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class InspectSummary:
    """Rows drawn per entity, messages read per topic; times in ns of logical time.

    `undecoded` counts messages per topic of types not known here; `damage` says why the file ended early, or "".
    """

    rows: dict[str, int]
    messages: dict[str, int]
    undecoded: dict[str, int]
    first: int
    last: int
    damage: str
