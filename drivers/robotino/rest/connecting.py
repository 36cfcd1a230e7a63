"""Where a base is: its URL, its addresses, and what an exchange with it fails by."""

from __future__ import annotations

import select
import socket
import threading
import time
from urllib.parse import urlsplit

from runtime.errors import PushlaneError
from runtime.messages import HttpFault

Address = tuple[int, tuple[str | int | bytes, ...]]
"""Family and address, as the socket module has them."""


class BadUrl(PushlaneError):
    """The URL of a base is none that can be asked."""


class Failed(Exception):
    """An exchange that brought no answer: its kind, and why. `connected`: the base took the connection."""

    def __init__(self, fault: HttpFault, reason: str, connected: bool = True) -> None:
        super().__init__(reason)
        self.fault = fault
        self.connected = connected


def parsed(url: str) -> tuple[str, int]:
    """Return host and port of the URL of a base.

    Raises:
        BadUrl: it is not http, has no host or an impossible port, or says more than these.
    """
    expected = f"url {url!r}, expected http://HOST or http://HOST:PORT, as in http://172.26.1.1"
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise BadUrl(f"{expected} ({error})") from error
    more = parts.path not in ("", "/") or parts.query or parts.fragment or "@" in parts.netloc
    if parts.scheme != "http" or not host or port == 0 or more or not host.isascii() or any(map(str.isspace, url)):
        raise BadUrl(expected)
    return host, port or 80


class Search(threading.Thread):
    """Looks a name up in a thread of its own, since that cannot be cut short."""

    def __init__(self, host: str, port: int) -> None:
        super().__init__(name=f"look up {host}", daemon=True)
        self._host, self._port = host, port
        self.found: list[Address] = []
        self.reason = ""
        self.start()

    def run(self) -> None:
        """Look up."""
        try:
            found = socket.getaddrinfo(self._host, self._port, type=socket.SOCK_STREAM)
            # IPv4 first: bases have it, and an address of the other kind that nobody answers would use up the time.
            found.sort(key=lambda one: one[0] != socket.AF_INET)
            self.found = [(one[0], one[4]) for one in found]
        except (OSError, UnicodeError) as error:
            self.reason = str(error)


def is_quiet(line: socket.socket) -> bool:
    """Return whether neither bytes wait at a socket nor its end."""
    poll = select.poll()  # select.select would fail from the 1024th file on
    poll.register(line, select.POLLIN)
    return not poll.poll(0)


def late(connected: bool = True) -> Failed:
    """Return that time is up."""
    return Failed(
        HttpFault.HTTP_TIMEOUT, "no whole answer in time" if connected else "no connection in time", connected
    )


def left(until: float, connected: bool = True) -> float:
    """Return the seconds until then, of the monotonic clock.

    Raises:
        Failed: there are none.
    """
    seconds = until - time.monotonic()
    if seconds <= 0.0:
        raise late(connected)
    return seconds
