"""What joins a service to a device or a socket: its messages go out there, and what comes from there are its inputs.

A service touches nothing; its driver's bytes are messages of topics of their own (`serial/sent`, `http/request`). In
simulation a double consumes and publishes them. Where the base is a real one the service's own host has a wire, which
carries them, so no other process and no network stands between a driver and its base.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from google.protobuf.message import Message

from runtime.time import Time

Bring = Callable[[Message], None]
"""Takes what came from outside. May be called from any thread, and never waits."""


class Wire(Protocol):
    """Carries the messages of one output of a service, and brings those of one of its inputs.

    Attributes:
        sends: topic of what `carry` is given. brings: topic of what is brought. Nobody else publishes that.
    """

    sends: str
    brings: str

    def open(self, bring: Bring, now: Callable[[], Time]) -> None:
        """Begin. What cannot be opened yet is tried again and again, and said as a message, not raised.

        Args:
            now: gives the host's time, ns, for the stamps of what is brought.
        """

    def carry(self, message: Message) -> None:
        """Send a message on its way. Never waits and never raises."""

    def close(self) -> None:
        """See off what was given to `carry`, at most for a quarter of a second, and end. Brings nothing after it."""
