"""One input to everything that reads bytes of a base. A parser survives if nothing but its own error comes out."""

from __future__ import annotations

from google.protobuf.message import Message

from drivers.robotino.rest import shapes
from drivers.robotino.rest.service import SENSORS, RobotinoRest
from drivers.robotino.rest.shapes import BadShape
from drivers.robotino.serial.framing import encode
from drivers.robotino.serial.service import RobotinoSerial
from runtime.finite import nonfinite
from runtime.messages import HttpAnswer, SerialData
from runtime.service import Effects, Publication
from runtime.time import SECOND

_STEP = SECOND // 50
_READERS = (shapes.odometry, shapes.distances, shapes.bumper, shapes.power, shapes.scan, shapes.versions)


class Wrong(AssertionError):
    """Something was published that no base can have said."""


class SerialFeed:
    """A driver at the end of a line on which anything comes, as it is, and as payloads of good frames."""

    def __init__(self) -> None:
        self._service = RobotinoSerial(RobotinoSerial.Config())
        self._now = SECOND

    def __call__(self, data: bytes) -> None:
        """Let the driver hear `data`."""
        self._now += _STEP
        for piece in (data, encode(data[:128])):
            _checked(self._service.hear(SerialData(data=piece, open=True), self._now))
        _checked(self._service.ask(self._now))


class RestFeed:
    """A driver whose every request is answered with anything."""

    def __init__(self) -> None:
        self._service = RobotinoRest(RobotinoRest.Config())
        self._now = SECOND

    def __call__(self, data: bytes) -> None:
        """Let the driver hear `data` in answer to each of its sensors."""
        for reader in _READERS:
            try:
                reader(data)
            except BadShape:
                continue
        self._now += SECOND
        _checked(self._service.ask(self._now))
        asked = dict(self._service.state.asked)
        for lane, path in SENSORS.items():
            number = asked.get(lane, (0, 0))[0]
            _checked(self._service.hear(HttpAnswer(id=number, path=path, status=200, body=data), self._now))


def _checked(effects: Effects | None) -> None:
    for one in effects or ():
        if isinstance(one, Publication):
            _check(one.message)


def _check(message: Message) -> None:
    wrong = nonfinite(message)
    if wrong:
        raise Wrong(f"{wrong} is not finite")
