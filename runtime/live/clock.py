"""The clock of live hosts: wall time that never goes back."""

from __future__ import annotations

import time

from runtime.time import Time


class Clock:
    """Nanoseconds since the Unix epoch, going on steadily from when it was made, whatever happens to the wall clock."""

    def __init__(self) -> None:
        self._offset = time.time_ns() - time.monotonic_ns()

    def now(self) -> Time:
        """Return the time now."""
        return time.monotonic_ns() + self._offset
