"""Signs of life of a process to the launcher that started it, through a socket between the two.

Not over the bus: its hub may be on another machine, and a launcher that hears nothing from there since the network is
cut would take its healthy services for frozen and kill them.
"""

from __future__ import annotations

import os
import socket
import stat
from contextlib import suppress

_STANDARD_INPUT = 0


def beat() -> bool:
    """Give a sign of life. Returns False if the launcher is gone, and nobody will end or restart this process.

    Without a launcher, whose socket is the standard input, this does nothing.
    """
    try:
        if stat.S_ISSOCK(os.fstat(_STANDARD_INPUT).st_mode):
            os.write(_STANDARD_INPUT, b".")
    except ConnectionError:
        return False
    except OSError:  # it does not look: not the concern of a service
        return True
    return True


class Pulse:
    """The launcher's end. `given` is to be the standard input of the process, and closed here once it has it."""

    def __init__(self) -> None:
        self._own, self.given = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._own.setblocking(False)
        self.given.setblocking(False)  # also for the process: a launcher that hangs must not stop it

    def felt(self) -> bool:
        """Return whether there was a sign of life since the last call."""
        found = False
        with suppress(OSError):
            while self._own.recv(1):
                found = True
        return found

    def close(self) -> None:
        """Listen no more."""
        self._own.close()
        self.given.close()
