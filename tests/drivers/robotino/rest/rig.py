"""The driver and the double of the REST server with a network between that can go wrong, in simulated time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import hypot

from drivers.robotino.plant import IdealPlant
from drivers.robotino.rest.config import RestConfig
from drivers.robotino.rest.restapid import Response, Restapid
from drivers.robotino.rest.service import RobotinoRest
from runtime.messages import (
    HttpAnswer,
    HttpFault,
    HttpRequest,
    LaserScan,
    Log,
    Odometry,
    RangeArray,
    RobotStatus,
    Twist2,
    VelocityCommand,
)
from runtime.service import Effects, Publication
from runtime.time import SECOND, Time

STEP = SECOND // 1000
Trouble = Callable[[HttpRequest], "HttpFault.ValueType | Response | None"]
"""What becomes of a request: a fault, another answer, or nothing out of the way"""


def none(_: HttpRequest) -> None:
    return None


@dataclass
class Rig:
    """Runs in steps of 1 ms; a fault is told when the request's time is up, or at once if nobody listens."""

    config: RestConfig = field(default_factory=RestConfig)
    server: Restapid = field(default_factory=Restapid)
    plant: IdealPlant = field(default_factory=IdealPlant.at_rest)
    now: Time = 0
    trouble: Trouble = none
    hung: bool = False
    wish: tuple[float, float, float] | None = None
    odometry: list[tuple[Odometry, tuple[float, float, float]]] = field(default_factory=list)
    ranges: list[RangeArray] = field(default_factory=list)
    scans: list[LaserScan] = field(default_factory=list)
    statuses: list[RobotStatus] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    requests: list[HttpRequest] = field(default_factory=list)
    speeds: list[tuple[Time, float]] = field(default_factory=list)
    late: list[tuple[Time, HttpAnswer]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.service = RobotinoRest(self.config)

    def run(self, seconds: float) -> None:
        """Let so much time pass."""
        for _ in range(round(seconds * 1000)):
            self.now += STEP
            self.plant.pass_by(STEP / SECOND)
            self.server.advance(self.now / SECOND, self.plant)
            self.speeds.append((self.now, hypot(*self.plant.twist[:2]) + abs(self.plant.twist[2])))
            due = [answer for at, answer in self.late if at <= self.now]
            self.late = [one for one in self.late if one[0] > self.now]
            for answer in due:
                self.take(self.service.hear(answer, self.now))
            if self.now % (50 * STEP) == 0 and not self.hung:
                if self.wish is not None:
                    self.order(*self.wish)
                self.take(self.service.ask(self.now))

    def order(self, vx: float, vy: float, omega: float) -> None:
        """Command a motion, based on the newest odometry."""
        newest = self.odometry[-1][0].driver_sequence if self.odometry else 0
        twist = Twist2(vx=vx, vy=vy, omega=omega)
        command = VelocityCommand(twist=twist, driver_sequence=newest, deadline=SECOND // 5)
        self.take(self.service.obey(command, self.now))

    def take(self, effects: Effects | None) -> None:
        for one in effects or ():
            assert isinstance(one, Publication)
            message = one.message
            if isinstance(message, HttpRequest):
                self._carry(message)
            elif isinstance(message, Odometry):
                self.odometry.append((message, self.plant.pose))
            elif isinstance(message, RangeArray):
                self.ranges.append(message)
            elif isinstance(message, LaserScan):
                self.scans.append(message)
            elif isinstance(message, RobotStatus):
                self.statuses.append(message)
            elif isinstance(message, Log):
                self.said.append(message.message)

    def _carry(self, request: HttpRequest) -> None:
        self.requests.append(request)
        became = self.trouble(request)
        answer = HttpAnswer(id=request.id, path=request.path)
        if isinstance(became, int):
            answer.fault = became
            wait = request.timeout if became == HttpFault.HTTP_TIMEOUT else STEP
        else:
            found = became or self.server.handle(request.method, request.path, request.body, self.plant)
            answer.status, answer.content_type, answer.body = found.status, found.media, found.body
            wait = 2 * STEP
        self.late.append((self.now + wait, answer))

    def moving_after(self, when: Time) -> float:
        """Return how long after `when`, s, the base still moved."""
        late = [at for at, speed in self.speeds if at >= when and speed > 1e-9]
        return (late[-1] - when) / SECOND if late else 0.0
