"""The driver and the double of the REST server with a network between that can go wrong, in simulated time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from google.protobuf.message import Message

from drivers.robotino.rest.config import RestConfig
from drivers.robotino.rest.restapid import Response, Restapid
from drivers.robotino.rest.service import RobotinoRest
from runtime.messages import HttpAnswer, HttpFault, HttpRequest, LaserScan
from runtime.time import SECOND, Time
from tests.drivers.robotino.rig import STEP, BaseRig

Trouble = Callable[[HttpRequest], "HttpFault.ValueType | Response | None"]
"""What becomes of a request: a fault, another answer, or nothing out of the way"""


def none(_: HttpRequest) -> None:
    return None


@dataclass
class Rig(BaseRig):
    """Runs in steps of 1 ms; a fault is told when the request's time is up, or at once if nobody listens."""

    service: RobotinoRest = field(init=False)
    config: RestConfig = field(default_factory=RestConfig)
    server: Restapid = field(default_factory=Restapid)
    trouble: Trouble = none
    scans: list[LaserScan] = field(default_factory=list)
    requests: list[HttpRequest] = field(default_factory=list)
    late: list[tuple[Time, HttpAnswer]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.service = RobotinoRest(self.config)

    def run(self, seconds: float) -> None:
        """Let so much time pass."""
        for _ in range(round(seconds * 1000)):
            self.step()
            self.server.advance(self.now / SECOND, self.plant)
            self.look()
            due = [answer for at, answer in self.late if at <= self.now]
            self.late = [one for one in self.late if one[0] > self.now]
            for answer in due:
                self.take(self.service.hear(answer, self.now))
            if self.now % (50 * STEP) == 0 and not self.hung:
                if self.wish is not None:
                    self.order(*self.wish)
                self.take(self.service.ask(self.now))

    def carry(self, message: Message) -> None:
        """Take a scan, or bring a request to the server."""
        if isinstance(message, LaserScan):
            self.scans.append(message)
            return
        assert isinstance(message, HttpRequest)
        self.requests.append(message)
        became = self.trouble(message)
        answer = HttpAnswer(id=message.id, path=message.path)
        if isinstance(became, int):
            answer.fault = became
            wait = message.timeout if became == HttpFault.HTTP_TIMEOUT else STEP
        else:
            found = became or self.server.handle(message.method, message.path, message.body, self.plant)
            answer.status, answer.content_type, answer.body = found.status, found.media, found.body
            wait = 2 * STEP
        self.late.append((self.now + wait, answer))
