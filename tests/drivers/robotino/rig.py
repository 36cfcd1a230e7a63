"""What the rigs of both links have in common: a driver on an ideal base, in simulated time, and what it published."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import hypot
from typing import TypeVar

from google.protobuf.message import Message

from drivers.robotino.driver import RobotinoDriver
from drivers.robotino.plant import IdealPlant
from runtime.messages import Log, Odometry, RangeArray, RobotStatus, Twist2, VelocityCommand
from runtime.service import Effects, Publication
from runtime.time import SECOND, Time

STEP = SECOND // 1000


@dataclass
class BaseRig:
    """Steps of 1 ms. A link says in `run` when its service is asked, and in `carry` what becomes of what it sends."""

    service: RobotinoDriver = field(init=False)
    plant: IdealPlant = field(default_factory=IdealPlant.at_rest)
    now: Time = 0
    hung: bool = False
    wish: tuple[float, float, float] | None = None
    odometry: list[tuple[Odometry, tuple[float, float, float]]] = field(default_factory=list)
    ranges: list[RangeArray] = field(default_factory=list)
    statuses: list[RobotStatus] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    speeds: list[tuple[Time, float]] = field(default_factory=list)

    def run(self, seconds: float) -> None:
        """Let so much time pass."""
        raise NotImplementedError

    def carry(self, message: Message) -> None:
        """Take what the service sends over its link, or publishes besides."""
        raise NotImplementedError

    def step(self) -> None:
        """Let 1 ms pass for the base, and note how fast it is."""
        self.now += STEP
        self.plant.pass_by(STEP / SECOND)

    def look(self) -> None:
        """Note how fast the base is."""
        self.speeds.append((self.now, hypot(*self.plant.twist[:2]) + abs(self.plant.twist[2])))

    def order(self, vx: float, vy: float, omega: float) -> None:
        """Command a motion, based on the newest odometry."""
        newest = self.odometry[-1][0].driver_sequence if self.odometry else 0
        twist = Twist2(vx=vx, vy=vy, omega=omega)
        command = VelocityCommand(twist=twist, driver_sequence=newest, deadline=SECOND // 5)
        self.take(self.service.obey(command, self.now))

    def take(self, effects: Effects | None) -> None:
        """Carry out what the service yields."""
        for one in effects or ():
            assert isinstance(one, Publication)
            message = one.message
            if isinstance(message, Odometry):
                self.odometry.append((message, self.plant.pose))
            elif isinstance(message, RangeArray):
                self.ranges.append(message)
            elif isinstance(message, RobotStatus):
                self.statuses.append(message)
            elif isinstance(message, Log):
                self.said.append(message.message)
            else:
                self.carry(message)

    def moving_after(self, when: Time) -> float:
        """Return how long after `when`, s, the base still moved."""
        late = [at for at, speed in self.speeds if at >= when and speed > 1e-9]
        return (late[-1] - when) / SECOND if late else 0.0

    def faults(self, kind: str) -> int:
        """Return how often the service counted this."""
        return self.service.state.faults.counts.get(kind, 0)


R = TypeVar("R", bound=BaseRig)


def driven(rig: R, start: float, seconds: float, wish: tuple[float, float, float]) -> R:
    """Return the rig after `start` s of rest and so many s of a command."""
    rig.run(start)
    rig.wish = wish
    rig.run(seconds)
    return rig
