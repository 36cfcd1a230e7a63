"""How a process of a live system ends: by a signal, or because it cannot go on."""

from __future__ import annotations

import signal
import sys
from types import FrameType
from typing import NoReturn, Protocol

from runtime.errors import PushlaneError


class Stoppable(Protocol):
    """What runs until it is told to stop."""

    def stop(self) -> None:
        """End soon."""


def stop_on_signals(host: Stoppable) -> None:
    """End `host` on SIGINT and SIGTERM."""

    def end(_: int, __: FrameType | None) -> None:
        host.stop()

    signal.signal(signal.SIGINT, end)
    signal.signal(signal.SIGTERM, end)


def fail(name: str, error: PushlaneError) -> NoReturn:
    """Say why a host cannot go on, and end the process."""
    print(f"{name}: {error}", file=sys.stderr, flush=True)
    sys.exit(error.exit_code)
