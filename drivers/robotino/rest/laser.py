"""The laser of a Robotino over its REST interface: for the whole driver, and by itself beside the serial link.

The serial link carries no scans. controld3 has to leave the board to us there, but laserd3 and restapid may go on, and
then the laser is read as ever.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from drivers.robotino.faults import Faults
from drivers.robotino.rest import shapes
from drivers.robotino.rest.config import LaserConfig, RestConfig
from drivers.robotino.rest.shapes import BadShape, ScanAnswer
from drivers.robotino.rest.trouble import trouble
from runtime import topics
from runtime.messages import HttpAnswer, HttpRequest, LaserScan
from runtime.service import Effects, Input, Output, Service, Timer, on
from runtime.time import SECOND, Time, nanoseconds

LANE, PATH = "scan", "/data/scan0"


def message(found: ScanAnswer, config: RestConfig | LaserConfig, stamp: Time) -> LaserScan:
    """Return a scan as it goes over the bus, base frame. What saw nothing has met nothing up to the farthest.

    Args:
        stamp: ns, when it was asked for.
    """
    scan = LaserScan(
        frame_id="base",
        start_angle=found.first + config.laser_yaw,
        end_angle=found.last + config.laser_yaw,
        ranges=[one if one > 0.0 else found.farthest for one in found.ranges],
    )
    scan.timestamp.seconds, scan.timestamp.nanos = divmod(stamp, SECOND)
    scan.pose.position.x, scan.pose.position.y = config.laser_x, config.laser_y
    scan.pose.orientation.w = 1.0
    return scan


@dataclass
class LaserState:
    """What the laser goes on from.

    Attributes:
        requests: so far. asked: id of the one under way; 0: none. since: ns, when it was sent.
        scanned: counter of the last scan.
    """

    requests: int = 0
    asked: int = 0
    since: Time = 0
    scanned: int = -1
    faults: Faults = field(default_factory=Faults)


class RobotinoLaser(Service):
    """Publishes what the laser sees, and asks for nothing else."""

    name = "robotino-laser"
    Config = LaserConfig

    answer = Input(topics.HTTP_ANSWER, wired=True)
    scan = Output(topics.SCAN)
    request = Output(topics.HTTP_REQUEST)
    tick = Timer(lambda config: 1.0 / max(config.scan_rate, 0.1))

    config: LaserConfig
    state: LaserState

    def __init__(self, config: LaserConfig) -> None:
        super().__init__(config)
        self.state = LaserState()

    @on(tick)
    def ask(self, now: Time) -> Effects:
        """Ask for a scan, unless one is asked for already."""
        state, timeout = self.state, nanoseconds(self.config.timeout)
        if self.config.scan_rate <= 0.0 or (state.asked and now - state.since < 2 * timeout):
            return
        state.requests += 1
        state.asked, state.since = state.requests, now
        yield self.request(
            HttpRequest(stamp=now, id=state.requests, lane=LANE, method="GET", path=PATH, timeout=timeout)
        )

    @on(answer)
    def hear(self, answer: HttpAnswer, now: Time) -> Effects:
        """Take a scan, or what became of the request."""
        if answer.id != self.state.asked:
            return  # given up: too late to say what is so now
        self.state.asked = 0
        wrong = trouble(answer, "no scan")
        if wrong is not None:
            yield from self._fault(*wrong, now)
        else:
            try:
                found = shapes.scan(answer.body)
            except BadShape as error:
                yield from self._fault("scan shape", f"{PATH}: {error}", now)
                return
            if found.sequence != self.state.scanned:
                self.state.scanned = found.sequence
                yield self.scan(message(found, self.config, self.state.since))

    def _fault(self, kind: str, detail: str, now: Time) -> Effects:
        for line in self.state.faults.note(kind, detail, now):
            yield self.say(line, now, "WARNING")
