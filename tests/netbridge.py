"""A bad network between two namespaces: forwards Ethernet frames, and loses, delays or cuts them as told.

Each host gets a TAP device; a process of its own reads frames from one and writes them to the other. TAP devices and
not veth with AF_PACKET: the kernel completes checksums and cuts large segments before a frame leaves through a TAP.
"""

from __future__ import annotations

import fcntl
import json
import os
import random
import selectors
import struct
import subprocess
import sys
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

_TUNSETIFF = 0x400454CA
_IFF_TAP, _IFF_NO_PI = 0x0002, 0x1000
_LARGEST_FRAME = 65536
_MOST_FRAMES = 20_000


@dataclass
class Way:
    """One direction of the link. Whether it loses its n-th frame is decided by seed and n alone."""

    source: int
    target: int
    generator: random.Random
    waiting: deque[tuple[float, bytes]] = field(default_factory=deque)
    counts: dict[str, int] = field(default_factory=lambda: {"passed": 0, "lost": 0, "cut": 0})

    def take(self, loss: float, delay: float, down: bool) -> None:
        """Read all frames that came, and throw away or keep each."""
        while True:
            try:
                frame = os.read(self.source, _LARGEST_FRAME)
            except BlockingIOError:
                return
            lost = self.generator.random() < loss
            if down:
                self.counts["cut"] += 1
            elif lost or len(self.waiting) >= _MOST_FRAMES:
                self.counts["lost"] += 1
            else:
                self.waiting.append((time.monotonic() + delay, frame))

    def give(self) -> None:
        """Hand over the frames whose delay has passed."""
        now = time.monotonic()
        while self.waiting and self.waiting[0][0] <= now:
            try:
                os.write(self.target, self.waiting.popleft()[1])
                self.counts["passed"] += 1
            except OSError:  # the interface is down, or its queue is full: lost, as on a wire
                self.counts["lost"] += 1

    def clear(self) -> None:
        """Lose what is on its way, as a cut cable does."""
        self.counts["cut"] += len(self.waiting)
        self.waiting.clear()


class Bridge:
    """The link, as a test steers it. Frames that are sent while it is cut are gone."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process

    def worsen(self, loss: float = 0.0, delay: float = 0.0) -> None:
        """Lose this share of the frames and delay the others by so many s, each way."""
        self._tell({"loss": loss, "delay": delay, "down": False})

    def cut(self) -> None:
        """Let nothing through, what is on its way included."""
        self._tell({"loss": 0.0, "delay": 0.0, "down": True})

    def heal(self) -> None:
        """Let everything through at once."""
        self.worsen()

    def counts(self) -> list[dict[str, int]]:
        """Return how many frames passed, were lost, and came while cut: from the first host, from the second."""
        return self._tell({})

    def _tell(self, order: dict[str, float]) -> list[dict[str, int]]:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(order) + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        assert answer, "the bridge has ended"
        found: list[dict[str, int]] = json.loads(answer)
        return found


@dataclass(frozen=True)
class End:
    """One end of the link: namespace, name of the interface there, and its address with prefix length."""

    namespace: str
    link: str
    address: str


@contextmanager
def bridged(a: End, b: End, seed: int = 1) -> Iterator[Bridge]:
    """Link two namespaces by a bridge, healed at first; end it and its interfaces afterwards."""
    command = [sys.executable, "-m", "tests.netbridge", a.link, b.link, str(seed)]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parent.parent
    )
    try:
        bridge = Bridge(process)
        bridge.heal()  # answered once the interfaces are there
        for end in (a, b):
            for arguments in (
                ("link", "set", end.link, "netns", end.namespace),
                ("-n", end.namespace, "addr", "add", end.address, "dev", end.link),
                ("-n", end.namespace, "link", "set", end.link, "up"),
            ):
                subprocess.run(["ip", *arguments], check=True, capture_output=True)
        yield bridge
    finally:
        process.kill()  # the interfaces go with it
        process.wait()
        for pipe in (process.stdin, process.stdout):
            assert pipe is not None
            pipe.close()


def _tap(name: str) -> int:
    descriptor = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(descriptor, _TUNSETIFF, struct.pack("16sH22x", name.encode(), _IFF_TAP | _IFF_NO_PI))
    return descriptor


def main() -> None:
    """Forward frames between two new TAP devices; orders come as JSON lines, each is answered by the counts."""
    first, second, seed = sys.argv[1], sys.argv[2], int(sys.argv[3])
    a, b = _tap(first), _tap(second)
    ways = [Way(a, b, random.Random(2 * seed)), Way(b, a, random.Random(2 * seed + 1))]
    state = {"loss": 0.0, "delay": 0.0, "down": False}
    os.set_blocking(0, False)
    orders = b""
    with selectors.DefaultSelector() as selector:
        for descriptor in (a, b, 0):
            selector.register(descriptor, selectors.EVENT_READ)
        while True:
            due = min((way.waiting[0][0] for way in ways if way.waiting), default=None)
            ready = selector.select(None if due is None else max(0.0, due - time.monotonic()))
            if any(key.fd == 0 for key, _ in ready):
                read = os.read(0, _LARGEST_FRAME)
                if not read:
                    return  # the test is gone
                *lines, orders = (orders + read).split(b"\n")
                for line in lines:
                    state |= json.loads(line)
                    if state["down"]:
                        for way in ways:
                            way.clear()
                    print(json.dumps([way.counts for way in ways]), flush=True)
            for way in ways:
                way.take(state["loss"], state["delay"], bool(state["down"]))
                way.give()


if __name__ == "__main__":
    main()
