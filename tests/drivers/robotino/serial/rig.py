"""The driver and the double of the board on a wire that can go wrong, in simulated time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import hypot

import numpy as np
from google.protobuf.message import Message

from drivers.robotino.serial.board import PIECE, Board
from drivers.robotino.serial.config import SerialConfig
from drivers.robotino.serial.service import RobotinoSerial
from runtime.messages import SerialData
from runtime.time import SECOND
from tests.drivers.robotino.rig import STEP, BaseRig

Wire = Callable[[bytes], bytes]


def clean(data: bytes) -> bytes:
    return data


@dataclass
class Rig(BaseRig):
    """Runs in steps of 1 ms; the service polls every 20."""

    service: RobotinoSerial = field(init=False)
    config: SerialConfig = field(default_factory=SerialConfig)
    board: Board = field(default_factory=Board)
    down: Wire = clean
    up: Wire = clean
    plugged: bool = True
    sent: list[bytes] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.service = RobotinoSerial(self.config)

    def run(self, seconds: float) -> None:
        """Let so much time pass."""
        for _ in range(round(seconds * 1000)):
            self.step()
            self.board.advance(self.now / SECOND, self.plant)
            self.look()
            if self.now % (50 * STEP) == 0 and self.wish is not None and not self.hung:
                self.order(*self.wish)
            if self.now % (20 * STEP) == 0 and not self.hung:
                self.take(self.service.ask(self.now))

    def hear(self, data: bytes, up: bool = True, fault: str = "") -> None:
        """Give the service what the line says."""
        self.take(self.service.hear(SerialData(data=data, open=up, fault=fault), self.now))

    def plug(self, there: bool) -> None:
        """Pull the plug, or put it back."""
        self.plugged = there
        self.hear(b"", there, "" if there else "device gone")

    def carry(self, message: Message) -> None:
        """Give the board what the service writes, and the service what the board answers."""
        assert isinstance(message, SerialData)
        self.sent.append(message.data)
        if not self.plugged:
            return
        answer = self.up(self.board.receive(self.down(message.data), self.plant))
        for at in range(0, len(answer), PIECE):
            self.hear(answer[at : at + PIECE])

    def worst(self) -> float:
        """Return how far published odometry was from where the wheels were, m, at most."""
        return max(hypot(one.pose.x - p[0], one.pose.y - p[1]) for one, p in self.odometry)


def noisy(generator: np.random.Generator, rate: float) -> Wire:
    """Return a wire on which bytes get lost, are put in and flipped, each with this rate."""

    def work(data: bytes) -> bytes:
        out = bytearray()
        for byte in data:
            draw = generator.random()
            if draw < rate:
                continue
            if draw < 2 * rate:
                out.append(int(generator.integers(256)))
            out.append(byte ^ (1 << int(generator.integers(8))) if 2 * rate <= draw < 3 * rate else byte)
        return bytes(out)

    return work
