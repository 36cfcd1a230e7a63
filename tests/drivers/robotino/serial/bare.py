"""A pseudo-terminal of the test's own, with nothing behind it, and what a wire brought from it."""

from __future__ import annotations

import os
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from select import select
from time import monotonic, sleep

from google.protobuf.message import Message

from drivers.robotino.serial.wire import SerialWire
from runtime.messages import SerialData

LONG = 10.0
"""s, after which a thing that did not happen never will: the machine may be loaded"""


def until(happened: Callable[[], object], seconds: float = LONG) -> bool:
    """Wait for it; return whether it happened."""
    end = monotonic() + seconds
    while not happened():
        if monotonic() > end:
            return False
        sleep(0.002)
    return True


def framed(payload: str) -> bytes:
    """Return the frame of bytes, in hex, of which none needs an escape."""
    data = bytes.fromhex(payload)
    body = bytes((len(data), 0)) + data
    frame = body + (0x10000 - len(data) - sum(data)).to_bytes(2, "little")
    assert not {0xAA, 0x55} & set(frame)
    return b"\xaa" + frame


def plain(frame: bytes) -> bytes:
    """Return the payload of a frame, by the rules of reference 2.2."""
    assert frame[:1] == b"\xaa" and b"\xaa" not in frame[1:]
    body, rest = bytearray(), iter(frame[1:])
    for byte in rest:
        body.append(next(rest) ^ 0x20 if byte == 0x55 else byte)
    assert int.from_bytes(body[:2], "little") == len(body) - 4
    assert (sum(body[:-2]) + int.from_bytes(body[-2:], "little")) % 65536 == 0
    return bytes(body[2:-2])


def whole(frame: bytes) -> bool:
    """Return whether what follows a head is one whole frame."""
    try:
        return bool(plain(b"\xaa" + frame))
    except (AssertionError, StopIteration):
        return False


@dataclass
class Bare:
    """The far end of a line: a link to a new terminal at each `plug`."""

    link: Path
    master: int = -1

    def plug(self) -> None:
        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.link.unlink(missing_ok=True)
        self.link.symlink_to(os.ttyname(slave))
        os.close(slave)

    def unplug(self) -> None:
        self.link.unlink()
        os.close(self.master)
        self.master = -1

    def read(self, quiet: float = 0.3) -> bytes:
        """Return what comes, until nothing has come for so many seconds."""
        data = b""
        while select([self.master], [], [], quiet)[0]:
            try:
                data += os.read(self.master, 65536)
            except OSError:
                return data  # nobody has the other end open any more
        return data

    def read_to(self, end: bytes) -> bytes:
        """Return what comes, up to these bytes."""
        data = b""
        last = monotonic() + LONG
        while not data.endswith(end) and monotonic() < last:
            try:
                if select([self.master], [], [], LONG)[0]:
                    data += os.read(self.master, 65536)
            except OSError:
                sleep(0.002)  # nobody has the other end open yet
        return data

    def write(self, data: bytes) -> None:
        os.write(self.master, data)


@contextmanager
def plugged(folder: Path) -> Iterator[Bare]:
    """Yield a line that is plugged in."""
    bare = Bare(folder / "robotino")
    bare.plug()
    try:
        yield bare
    finally:
        if bare.master >= 0:
            os.close(bare.master)


@dataclass
class Heard:
    """What a wire brought."""

    said: list[SerialData] = field(default_factory=list)

    def bring(self, message: Message) -> None:
        assert isinstance(message, SerialData)
        self.said.append(message)

    @property
    def data(self) -> bytes:
        return b"".join(one.data for one in self.said)

    @property
    def states(self) -> list[bool]:
        """What was said of the line, without what came over it."""
        return [one.open for one in self.said if not one.data]

    @property
    def faults(self) -> list[str]:
        return [one.fault for one in self.said if one.fault]


@contextmanager
def wired(device: str) -> Iterator[tuple[SerialWire, Heard]]:
    """Yield a wire that is open, and what it brings."""
    heard, wire = Heard(), SerialWire(device)
    wire.open(heard.bring, lambda: 7)
    try:
        yield wire, heard
    finally:
        wire.close()
