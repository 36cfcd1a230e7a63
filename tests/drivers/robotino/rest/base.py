"""A base alone on a floor behind the double of its server, in the time of the clock on the wall."""

from __future__ import annotations

import time

from drivers.robotino.plant import IdealPlant
from drivers.robotino.rest.restapid import Response, Restapid


class Base:
    """What a `RestServer` is given."""

    def __init__(self, server: Restapid | None = None) -> None:
        self.server = server or Restapid()
        self.plant = IdealPlant.at_rest()
        self._begun = time.monotonic()
        self._last = 0.0
        self.asked: list[tuple[str, str, bytes]] = []

    def handle(self, method: str, target: str, body: bytes) -> Response:
        """Let time pass up to now, and answer."""
        now = time.monotonic() - self._begun
        self.plant.pass_by(now - self._last)
        self._last = now
        self.server.advance(now, self.plant)
        self.asked.append((method, target, body))
        return self.server.handle(method, target, body, self.plant)
