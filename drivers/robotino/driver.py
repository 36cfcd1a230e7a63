"""What the drivers over both links have in common: which commands are taken, and what they publish of the base."""

from __future__ import annotations

from dataclasses import dataclass, field

from drivers.robotino import infrared
from drivers.robotino.config import BaseConfig
from drivers.robotino.faults import Faults
from drivers.robotino.gate import Gate
from drivers.robotino.odometry import DeadReckoning
from runtime import topics
from runtime.messages import Alive, Charger, RangeArray, RobotStatus, VelocityCommand
from runtime.service import Effects, Input, Output, Publication, Service, on
from runtime.time import Time


@dataclass
class BaseState:
    """What either driver goes on from.

    Attributes:
        bumper: pressed. battery: V. charging, low: as the base says. chargers: by number, as they said last.
    """

    gate: Gate = field(default_factory=Gate)
    reckoning: DeadReckoning = field(default_factory=DeadReckoning)
    faults: Faults = field(default_factory=Faults)
    bumper: bool = False
    battery: float = 0.0
    charging: bool = False
    low: bool = False
    chargers: dict[int, Charger] = field(default_factory=dict)


class RobotinoDriver(Service):
    """Takes commands while they are fresh, and publishes status and ranges; a link says the rest."""

    command = Input(topics.COMMAND)
    alive = Input(topics.ALIVE)
    odometry = Output(topics.ODOMETRY)
    ranges = Output(topics.RANGES)
    status = Output(topics.STATUS)

    config: BaseConfig
    state: BaseState

    @on(alive)
    def call(self, alive: Alive, now: Time) -> Effects:
        """Stop the base at once when the controller is gone."""
        if self.state.gate.call(alive):
            yield self._told(now)
            yield self.say("the controller is gone: base held", now, "WARNING")

    @on(command)
    def obey(self, command: VelocityCommand, now: Time) -> Effects:
        """Take a command, unless it is too old. What is told next carries it."""
        config = self.config
        refused = self.state.gate.offer(command, now, config.deadline, config.limits, config.geometry)
        if refused:
            yield from self._fault("command", refused, now)

    def _told(self, now: Time) -> Publication:
        """Return what tells the base how to move now."""
        raise NotImplementedError

    def _works(self) -> bool:
        """Return whether the link works, and so the motors do what they are told."""
        raise NotImplementedError

    def _stopped(self) -> bool:
        """Return whether the base's own emergency stop acts."""
        return False

    def _ranges(self, distances: list[float], now: Time) -> Publication:
        """Return the message of the infra-red sensors, (9,) m."""
        return self.ranges(
            RangeArray(
                stamp=now,
                bearing=infrared.bearings(),
                distance=distances,
                ring_radius=infrared.RING_RADIUS,
                minimum=infrared.NEAREST,
                maximum=infrared.FARTHEST,
            )
        )

    def _status(self, now: Time) -> Publication:
        state, config = self.state, self.config
        gate = state.gate
        return self.status(
            RobotStatus(
                stamp=now,
                bumper=state.bumper,
                emergency_stop=self._stopped(),
                motors_enabled=self._works(),
                battery_voltage=state.battery,
                charging=state.charging,
                battery_low=state.low,
                limits=config.limits,
                diameter=config.diameter,
                commands_accepted=gate.accepted,
                commands_clamped=gate.clamped,
                commands_refused=gate.refused,
                commands_stale=gate.stale,
                link_down=not self._works(),
                faults=state.faults.messages(),
                chargers=[one for _, one in sorted(state.chargers.items())],
            )
        )

    def _fault(self, kind: str, detail: str, now: Time) -> Effects:
        for line in self.state.faults.note(kind, detail, now):
            yield self.say(line, now, "WARNING")
