"""When a recording begins a new part: after so many bytes, or so much time."""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import inf

from runtime.errors import PushlaneError

_FORM = re.compile(r"(\d+(?:\.\d+)?) ?([A-Za-z]+)")
_BYTES = {"kB": 1e3, "MB": 1e6, "GB": 1e9}
_SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}
_LEAST_BYTES, _LEAST_SECONDS = 100e3, 2.0


class BadSplit(PushlaneError):
    """The text is neither a size nor a time."""


@dataclass(frozen=True)
class Split:
    """Limits of a part: bytes and s, infinite for none."""

    size: float = inf
    time: float = inf

    @classmethod
    def parse(cls, text: str) -> Split:
        """Return the limit that `text` names: 200MB, 60s, 10min; none if it is empty.

        Raises:
            BadSplit: it is no such text, or less than a part needs to begin.
        """
        if not text:
            return cls()
        found = _FORM.fullmatch(text.strip())
        unit = found.group(2) if found else ""
        if found is None or unit not in _BYTES | _SECONDS:
            units = ", ".join(_BYTES | _SECONDS)
            raise BadSplit(f"'{text}' is no size or time to split at: expected a number with one of {units}")
        value = float(found.group(1)) * (_BYTES | _SECONDS)[unit]
        least = _LEAST_BYTES if unit in _BYTES else _LEAST_SECONDS
        if value < least:
            raise BadSplit(f"'{text}' is too little to split at: expected at least 100kB or 2s")
        return cls(size=value) if unit in _BYTES else cls(time=value)
