"""The driver and the double of the board on a wire that can go wrong, in simulated time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import hypot

import numpy as np

from drivers.robotino.plant import IdealPlant
from drivers.robotino.serial.board import Board
from drivers.robotino.serial.config import SerialConfig
from drivers.robotino.serial.service import RobotinoSerial
from runtime.messages import Log, Odometry, RangeArray, RobotStatus, SerialData, Twist2, VelocityCommand
from runtime.service import Effects, Publication
from runtime.time import SECOND, Time

STEP = SECOND // 1000
PIECE = 64
Wire = Callable[[bytes], bytes]


def clean(data: bytes) -> bytes:
    return data


@dataclass
class Rig:
    """Runs in steps of 1 ms; the service polls every 20."""

    config: SerialConfig = field(default_factory=SerialConfig)
    board: Board = field(default_factory=Board)
    plant: IdealPlant = field(default_factory=IdealPlant.at_rest)
    now: Time = 0
    down: Wire = clean
    up: Wire = clean
    plugged: bool = True
    hung: bool = False
    wish: tuple[float, float, float] | None = None
    odometry: list[tuple[Odometry, tuple[float, float, float]]] = field(default_factory=list)
    ranges: list[RangeArray] = field(default_factory=list)
    statuses: list[RobotStatus] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    sent: list[bytes] = field(default_factory=list)
    speeds: list[tuple[Time, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.service = RobotinoSerial(self.config)

    def run(self, seconds: float) -> None:
        """Let so much time pass."""
        for _ in range(round(seconds * 1000)):
            self.now += STEP
            self.plant.pass_by(STEP / SECOND)
            self.board.advance(self.now / SECOND, self.plant)
            self.speeds.append((self.now, hypot(*self.plant.twist[:2]) + abs(self.plant.twist[2])))
            if self.now % (50 * STEP) == 0 and self.wish is not None and not self.hung:
                self.order(*self.wish)
            if self.now % (20 * STEP) == 0 and not self.hung:
                self.take(self.service.ask(self.now))

    def order(self, vx: float, vy: float, omega: float) -> None:
        """Command a motion, based on the newest odometry."""
        newest = self.odometry[-1][0].driver_sequence if self.odometry else 0
        command = VelocityCommand(
            twist=Twist2(vx=vx, vy=vy, omega=omega), driver_sequence=newest, deadline=SECOND // 5
        )  # fmt: skip
        self.take(self.service.obey(command, self.now))

    def hear(self, data: bytes, up: bool = True, fault: str = "") -> None:
        """Give the service what the line says."""
        self.take(self.service.hear(SerialData(data=data, open=up, fault=fault), self.now))

    def plug(self, there: bool) -> None:
        """Pull the plug, or put it back."""
        self.plugged = there
        self.hear(b"", there, "" if there else "device gone")

    def take(self, effects: Effects | None) -> None:
        for one in effects or ():
            assert isinstance(one, Publication)
            message = one.message
            if isinstance(message, SerialData):
                self._to_board(message.data)
            elif isinstance(message, Odometry):
                self.odometry.append((message, self.plant.pose))
            elif isinstance(message, RangeArray):
                self.ranges.append(message)
            elif isinstance(message, RobotStatus):
                self.statuses.append(message)
            elif isinstance(message, Log):
                self.said.append(message.message)

    def _to_board(self, data: bytes) -> None:
        self.sent.append(data)
        if not self.plugged:
            return
        answer = self.up(self.board.receive(self.down(data), self.plant))
        for at in range(0, len(answer), PIECE):
            self.hear(answer[at : at + PIECE])

    def moving_after(self, when: Time) -> float:
        """Return how long after `when`, s, the base still moved."""
        late = [at for at, speed in self.speeds if at >= when and speed > 1e-9]
        return (late[-1] - when) / SECOND if late else 0.0

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
