"""The simulated base behind the double of its REST server: requests and answers as messages."""

from __future__ import annotations

from dataclasses import dataclass, field

from drivers.robotino.rest.restapid import Restapid
from drivers.sapien import publish
from drivers.sapien.config import SapienConfig
from drivers.sapien.plant import PlantState, SapienPlant
from runtime import topics
from runtime.messages import HttpAnswer, HttpRequest
from runtime.service import Effects, Input, Output, Service, Timer, on
from runtime.time import Time

_PERIOD = 0.05


@dataclass
class EmulatedRestState:
    """What goes on: the server's and the world's state."""

    server: Restapid = field(default_factory=Restapid)
    plant: PlantState = field(default_factory=PlantState)


class EmulatedRest(Service):
    """A Robotino behind its REST server, in the simulated world."""

    name = "emulated-rest"
    Config = SapienConfig

    request = Input(topics.HTTP_REQUEST)
    odometry = Input(topics.ODOMETRY)
    answer = Output(topics.HTTP_ANSWER)
    truth = Output(topics.TRUTH)
    tick = Timer(_PERIOD)

    config: SapienConfig
    state: EmulatedRestState

    def __init__(self, config: SapienConfig) -> None:
        super().__init__(config)
        self._plant = SapienPlant(config)
        self.state = EmulatedRestState(Restapid(volts=config.battery_voltage), self._plant.state)

    def freeze(self) -> None:
        """Take the world's state."""
        self._plant.freeze()

    def thaw(self) -> None:
        """Build the world again from the state."""
        self._plant.thaw(self.state.plant)

    @on(request)
    def reply(self, request: HttpRequest, now: Time) -> Effects:
        """Let the server answer."""
        self._plant.advance(now, self.state.server)
        found = self.state.server.handle(request.method, request.path, request.body, self._plant)
        yield self.answer(
            HttpAnswer(
                stamp=now, id=request.id, path=request.path, status=found.status, content_type=found.media,
                body=found.body,
            )
        )  # fmt: skip

    @on(tick)
    def sense(self, now: Time) -> Effects:
        """Publish what is so."""
        self._plant.advance(now, self.state.server)
        sequence = 0 if self.odometry is None else self.odometry.driver_sequence
        yield self.truth(publish.truth(self._plant.world, sequence, now))
