"""The simulated base behind the double of its board: what a serial line would carry, as messages."""

from __future__ import annotations

from dataclasses import dataclass, field

from drivers.robotino.serial.board import PIECE, Board
from drivers.sapien import publish
from drivers.sapien.config import SapienConfig
from drivers.sapien.plant import PlantState, SapienPlant
from runtime import topics
from runtime.messages import SerialData
from runtime.service import Effects, Input, Output, Service, Timer, on
from runtime.time import Time

_PERIOD = 0.05
_SCAN_EVERY = 2


@dataclass
class EmulatedSerialState:
    """What goes on: the board's and the world's state, and ticks so far."""

    board: Board = field(default_factory=Board)
    plant: PlantState = field(default_factory=PlantState)
    ticks: int = 0


class EmulatedSerial(Service):
    """A Robotino at the end of a serial line, in the simulated world; its laser has a line of its own."""

    name = "emulated-serial"
    Config = SapienConfig

    sent = Input(topics.SERIAL_SENT)
    odometry = Input(topics.ODOMETRY)
    received = Output(topics.SERIAL_RECEIVED)
    scan = Output(topics.SCAN)
    truth = Output(topics.TRUTH)
    tick = Timer(_PERIOD)

    config: SapienConfig
    state: EmulatedSerialState

    def __init__(self, config: SapienConfig) -> None:
        super().__init__(config)
        self._plant = SapienPlant(config)
        self.state = EmulatedSerialState(Board(volts=config.battery_voltage), self._plant.state)

    def freeze(self) -> None:
        """Take the world's state."""
        self._plant.freeze()

    def thaw(self) -> None:
        """Build the world again from the state."""
        self._plant.thaw(self.state.plant)

    @on(sent)
    def answer(self, sent: SerialData, now: Time) -> Effects:
        """Give the board what the driver wrote, and publish what it answers, in the pieces of its USB writes."""
        self._plant.advance(now, self.state.board)
        answer = self.state.board.receive(sent.data, self._plant)
        for at in range(0, len(answer), PIECE):
            yield self.received(SerialData(stamp=now, data=answer[at : at + PIECE], open=True))

    @on(tick)
    def sense(self, now: Time) -> Effects:
        """Publish what is so, and what the laser sees."""
        self._plant.advance(now, self.state.board)
        self.state.ticks += 1
        sequence = 0 if self.odometry is None else self.odometry.driver_sequence
        yield self.truth(publish.truth(self._plant.world, sequence, now))
        if self.state.ticks % _SCAN_EVERY == 1:
            plant, noise = self._plant, self.config.scene.noise.scan
            pose, generator = plant.world.robot_pose, plant.state.generator
            yield self.scan(publish.scan(self.config.laser, pose, plant.outlines, noise, generator, now))
