"""What a check of a base finds, a row for each thing that was asked for; the same over both links."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Row:
    """One thing that a base was asked for.

    Attributes:
        name: of what was asked. state: it said it, there is none, or something is wrong with it.
        words: the reading with units, or what is wrong and what is expected.
        milliseconds: until the answer came, or was given up.
    """

    name: str
    state: Literal["ok", "missing", "bad"]
    words: str
    milliseconds: float
