"""Tells a service manager how a process is: ready, alive, stopping. systemd's protocol, one datagram a message."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import MutableMapping
from contextlib import suppress

from runtime.errors import PushlaneError

_SOCKET, _PERIOD, _PROCESS = "NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"


class BadSupervisor(PushlaneError):
    """The environment names a supervisor in a way that cannot be."""


class Notifier:
    """Speaks to the supervisor that the environment names; without one all methods do nothing.

    Takes the variables out of the environment, so that child processes do not speak in our name.

    Raises:
        BadSupervisor: a variable has no sense.
    """

    def __init__(self, environment: MutableMapping[str, str] | None = None) -> None:
        found = os.environ if environment is None else environment
        address, period, process = (found.pop(name, "") for name in (_SOCKET, _PERIOD, _PROCESS))
        if address and address[0] not in "/@":
            raise BadSupervisor(f"{_SOCKET}={address}: expected a path, or @NAME")
        # A leading @ stands for the zero byte of an abstract address.
        self._address = f"\0{address[1:]}" if address.startswith("@") else address
        if period and not period.isdecimal():
            raise BadSupervisor(f"{_PERIOD}={period}: expected microseconds")
        mine = not process or process == str(os.getpid())
        self._every = int(period) / 3e6 if period and mine else 0.0
        self._alive = -self._every
        self._ready = False
        self._socket: socket.socket | None = None
        if self._address:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
            self._socket.setblocking(False)

    def ready(self) -> None:
        """Say, once, that everything is up."""
        if not self._ready:
            self._ready = True
            self._send("READY=1")

    def alive(self) -> None:
        """Say that the loop turns; call it every turn. Speaks at a third of the watchdog's time."""
        now = time.monotonic()
        if self._every and now - self._alive >= self._every:
            self._alive = now
            self._send("WATCHDOG=1")

    def stopping(self) -> None:
        """Say that the end has begun, and no more after it."""
        self._send("STOPPING=1")
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _send(self, text: str) -> None:
        if self._socket is None:
            return
        # A supervisor that is gone or does not listen must not stop the robot's services: its watchdog is its judge.
        with suppress(OSError):
            self._socket.sendto(text.encode(), self._address)
