"""Two fast publishers and a service that mixes them, for tests; as a module it hosts one of them, round by round."""

from __future__ import annotations

import sys
import threading
import zlib
from dataclasses import dataclass

import msgspec

from runtime import topics
from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import client
from runtime.guard import Guard
from runtime.live.config import LiveConfig
from runtime.live.host import LiveHost
from runtime.messages import Odometry, RobotStatus, VelocityCommand
from runtime.node import Node
from runtime.service import Effects, Input, Output, Publication, Service, Timer, on
from runtime.time import Time

RATE = 500.0


class Pace(msgspec.Struct, frozen=True):
    """Publications a second."""

    rate: float = RATE


@dataclass
class Mixture:
    """A number that depends on everything that came, and on its order."""

    digest: int = 0


class Speaker(Service):
    """Says one thing more at a rate."""

    Config = Pace
    tick = Timer(lambda config: 1 / config.rate)
    state: Mixture

    def __init__(self, config: Pace) -> None:
        super().__init__(config)
        self.state = Mixture()

    @on(tick)
    def speak(self, now: Time) -> Effects:
        """Say one more."""
        self.state.digest += 1
        yield self.words(self.state.digest, now)

    def words(self, number: int, now: Time) -> Publication:
        """Return what is said as the `number`-th."""
        raise NotImplementedError


class Left(Speaker):
    """Publishes odometry."""

    name = "left"
    odometry = Output(topics.ODOMETRY)

    def words(self, number: int, now: Time) -> Publication:
        """Return the next odometry."""
        return self.odometry(Odometry(stamp=now, driver_sequence=number))


class Right(Speaker):
    """Publishes the robot's status."""

    name = "right"
    status = Output(topics.STATUS)

    def words(self, number: int, now: Time) -> Publication:
        """Return the next status."""
        return self.status(RobotStatus(stamp=now, commands_accepted=number))


class Mixer(Service):
    """Takes both, and says after each what all of them in this order come to."""

    name = "mixer"
    Config = Pace
    odometry = Input(topics.ODOMETRY)
    status = Input(topics.STATUS)
    command = Output(topics.COMMAND)
    state: Mixture

    def __init__(self, config: Pace) -> None:
        super().__init__(config)
        self.state = Mixture()

    @on(odometry)
    def left(self, odometry: Odometry, now: Time) -> Effects:
        """Mix in one of the left."""
        return self._mix(b"l%d" % odometry.driver_sequence, now)

    @on(status)
    def right(self, status: RobotStatus, now: Time) -> Effects:
        """Mix in one of the right."""
        return self._mix(b"r%d" % status.commands_accepted, now)

    def _mix(self, what: bytes, now: Time) -> Effects:
        self.state.digest = zlib.crc32(what, self.state.digest)
        yield self.command(VelocityCommand(stamp=now, driver_sequence=self.state.digest))


KINDS: dict[str, type[Service]] = {kind.name: kind for kind in (Left, Right, Mixer)}


def main() -> None:
    """Host the service NAME at the hub ENDPOINT; each line of the input is a round: a robot's name and s."""
    name, endpoint = sys.argv[1:]
    print("ready", flush=True)
    for line in sys.stdin:
        robot, duration = line.split()
        bus = BusConfig(robot=robot, listen=(endpoint,), connect=(endpoint,))
        with client(bus) as session, Guard() as guard:
            host = LiveHost(Node(KINDS[name](Pace()), guard), session, Keys(robot), LiveConfig(snapshot_period=0.5))
            timer = threading.Timer(float(duration), host.stop)
            timer.start()
            host.run()
        print("done", flush=True)


if __name__ == "__main__":
    main()
