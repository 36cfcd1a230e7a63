"""A pseudo-terminal with the double of the board at its far end, in real time: a Robotino for any serial client.

The line can be unplugged and plugged in again, spoiled, and made deaf while it runs.
"""

from __future__ import annotations

import os
import random
import tty
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from errno import EEXIST
from pathlib import Path
from threading import Event, RLock, Thread
from time import monotonic
from types import TracebackType
from typing import Protocol

from drivers.robotino.plant import Plant
from drivers.robotino.serial.board import PIECE

_STEP = 0.002
"""s between two looks at the line"""
_RING = 1024
"""bytes that wait for a client who does not read; what is more gets lost, as on the board"""
_MOST = 4096


@dataclass(frozen=True)
class Noise:
    """What becomes of bytes, each way: shares of them that are lost, follow one put in, and have a bit turned over."""

    lost: float = 0.0
    inserted: float = 0.0
    flipped: float = 0.0

    def spoil(self, data: bytes, generator: random.Random) -> bytes:
        """Return what is left of the data."""
        if self == Noise():
            return data
        out = bytearray()
        for byte in data:
            if generator.random() < self.inserted:
                out.append(generator.randrange(256))
            if generator.random() < self.lost:
                continue
            out.append(byte ^ 1 << generator.randrange(8) if generator.random() < self.flipped else byte)
        return bytes(out)


class FarEnd(Protocol):
    """What a line ends at: `Board`, or what has one."""

    def advance(self, now: float, plant: Plant) -> None:
        """Let time pass up to `now`, s."""

    def receive(self, data: bytes, plant: Plant) -> bytes:
        """Take bytes from the host; return the answers."""

    def reset(self) -> None:
        """Begin as after power-up."""


class PtyLine:
    """The board on a pseudo-terminal, while the `with` lasts.

    Attributes:
        lock: held while the board or the plant is touched; take it to look at them.
        noise: on the line. hangs: the board takes bytes and does nothing with them, so its watchdog stops the motors.
    """

    def __init__(
        self,
        board: FarEnd,
        plant: Plant,
        pass_by: Callable[[float], None] | None = None,
        link: Path | None = None,
        seed: int = 0,
    ) -> None:
        """Take the board, and the plant it drives.

        Args:
            pass_by: lets so many seconds pass for the plant; None: its time passes by itself.
            link: a symbolic link to the device, which keeps its name when it is plugged in again.
            seed: of the noise.
        """
        self.lock = RLock()
        self.noise = Noise()
        self.hangs = False
        self._board, self._plant, self._pass_by, self._link = board, plant, pass_by, link
        self._generator = random.Random(seed)
        self._master: int | None = None
        self._slave = ""
        self._out = bytearray()
        self._ended = Event()
        self._thread = Thread(target=self._work, name="pty-line", daemon=True)

    def __enter__(self) -> PtyLine:
        """Switch the board on and plug it in."""
        self.plug()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Unplug it and end."""
        self._ended.set()
        self._thread.join()
        self.unplug()

    @property
    def device(self) -> str:
        """Return the path that a client opens."""
        return str(self._link) if self._link is not None else self._slave

    def plug(self) -> None:
        """Put the plug in: a new device, behind the same link.

        Raises:
            FileExistsError: where the link is to be there is something that is none.
        """
        with self.lock:
            if self._master is not None:
                return
            if self._link is not None and self._link.exists():
                # A link that leads nowhere was left behind; one that leads to a device is another line's.
                raise FileExistsError(EEXIST, f"{self._link} is there already: expected nothing, or a link left behind")
            self._master, slave = os.openpty()
            # Raw for a client that sets nothing itself: else the terminal would give it back what it writes.
            tty.setraw(slave)
            self._slave = os.ttyname(slave)
            os.close(slave)
            os.set_blocking(self._master, False)
            if self._link is not None:
                beside = self._link.with_name(f"{self._link.name}.{os.getpid()}")
                beside.unlink(missing_ok=True)
                beside.symlink_to(self._slave)
                beside.replace(self._link)

    def unplug(self) -> None:
        """Pull the plug: the device is gone, the board runs on."""
        with self.lock:
            if self._master is None:
                return
            if self._link is not None:
                self._link.unlink(missing_ok=True)
            os.close(self._master)
            self._master = None
            self._out.clear()

    def reset(self) -> None:
        """Let the board begin anew, its counters at zero and nothing set."""
        with self.lock:
            self._board.reset()
            self._out.clear()

    def _work(self) -> None:
        began = before = monotonic()
        while not self._ended.wait(_STEP):
            with self.lock:
                now = monotonic()
                if self._pass_by is not None:
                    self._pass_by(now - before)
                before = now
                self._board.advance(now - began, self._plant)
                if self._master is not None:
                    self._serve(self._master)

    def _serve(self, master: int) -> None:
        """Take what has come, and give what is to go."""
        try:
            data = os.read(master, _MOST)
        except BlockingIOError:
            data = b""
        except OSError:
            # Nobody has the device open, so nobody gets what was to go.
            self._out.clear()
            return
        if data and not self.hangs:
            answer = self._board.receive(self.noise.spoil(data, self._generator), self._plant)
            self._out += self.noise.spoil(answer, self._generator)
            del self._out[_RING:]
        with suppress(BlockingIOError):
            while self._out:
                del self._out[: os.write(master, self._out[:PIECE])]
