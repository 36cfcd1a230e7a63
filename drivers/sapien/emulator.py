"""A simulated base in real time, behind the double of its serial link or of its REST server.

For who has no robot, and for tests through real sockets and serial lines. It is no service: it stands where a robot
would, and what it does is not recorded; what its driver sends and hears is.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Generic, TypeVar

from drivers.robotino.plant import Plant
from drivers.robotino.rest.restapid import Response, Restapid
from drivers.robotino.serial.board import Board
from drivers.sapien import plant as simulated
from drivers.sapien.camera import SapienCameraConfig
from drivers.sapien.config import SapienConfig
from drivers.sapien.painter import Painter, View
from runtime.time import SECOND

_PERIOD = 0.005
"""s between two looks at what the board wants"""
_PICTURE_PERIOD = 0.1
_WATCHED_FOR = 2.0
"""s after a request of a picture in which pictures are drawn"""
CAMERA, SCAN = "/cam0", "/data/scan0"

D = TypeVar("D", bound=simulated.Board)


@dataclass(frozen=True)
class Standing:
    """Where everything is, by the simulation's truth.

    Attributes:
        seconds: since it began. robot, object: x, y, theta, m and rad, the scene's frame. twist: m/s and rad/s, base
            frame.
        hit: robot or object have touched walls or furniture lately.
    """

    seconds: float
    robot: tuple[float, float, float]
    object: tuple[float, float, float]
    twist: tuple[float, float, float]
    hit: bool


class Emulated(Generic[D]):
    """A simulated base that `double` drives. It moves on in real time while `running`.

    Args:
        clock: gives ns, steadily.
    """

    def __init__(self, config: SapienConfig, double: D, clock: Callable[[], int] = time.monotonic_ns) -> None:
        self.double = double
        self.plant = simulated.SapienPlant(config)
        self._clock = clock
        self._began = clock()
        self._lock = threading.RLock()
        self._stop = threading.Event()
        self._wanted = 0.0  # the first picture takes the longest, so it is drawn before anybody asks

    @contextmanager
    def running(self, camera: SapienCameraConfig | None = None) -> Iterator[None]:
        """Let time pass while this is open.

        Args:
            camera: what its camera is; without one it has none.
        """
        threads = [threading.Thread(target=self._go, name="emulated-base", daemon=True)]
        if camera is not None:
            threads.append(threading.Thread(target=self._draw, args=(camera,), name="emulated-camera", daemon=True))
        for one in threads:
            one.start()
        try:
            yield
        finally:
            self._stop.set()
            for one in threads:
                one.join()

    def standing(self) -> Standing:
        """Return where everything is now."""
        with self.now():
            world = self.plant.world
            (rx, ry, rt), (ox, oy, ot) = world.robot_pose, world.object_pose
            return Standing(
                seconds=world.seconds,
                robot=(float(rx), float(ry), float(rt)),
                object=(float(ox), float(oy), float(ot)),
                twist=self.plant.twist,
                hit=bool(world.robot_hit or world.object_hit),
            )

    @contextmanager
    def now(self) -> Iterator[float]:
        """Hold the world still at this moment; gives s since it began."""
        with self._lock:
            now = self._clock() - self._began
            self.plant.advance(now, self.double)
            yield now / SECOND

    def _go(self) -> None:
        while not self._stop.wait(_PERIOD):
            with self.now():
                pass

    def _draw(self, config: SapienCameraConfig) -> None:
        """Draw pictures while somebody asks for them."""
        with Painter(config) as painter:
            while not self._stop.wait(_PICTURE_PERIOD):
                found = self.standing()
                if found.seconds - self._wanted <= _WATCHED_FOR:
                    picture = painter.picture(View(found.robot, found.object, found.seconds))
                    with self._lock:
                        self._show(picture)

    def _show(self, picture: bytes) -> None:
        """Take the newest picture, a JPEG."""


class EmulatedServer(Emulated[Restapid]):
    """A simulated base behind the double of its REST server."""

    def handle(self, method: str, target: str, body: bytes) -> Response:
        """Return the server's answer to a request, and do what it asks for."""
        with self.now() as seconds:
            if target.partition("?")[0] == CAMERA:
                self._wanted = seconds
            return self.double.handle(method, target, body, self.plant)

    def _show(self, picture: bytes) -> None:
        self.double.picture = picture


class EmulatedBoard(Emulated[Board]):
    """A simulated base behind the double of its board. Laser and camera are read over REST all the same."""

    def __init__(self, config: SapienConfig, double: Board, clock: Callable[[], int] = time.monotonic_ns) -> None:
        super().__init__(config, double, clock)
        self._server = Restapid()

    def far(self) -> FarEnd:
        """Return the board as a line has it: touching it lets the world come up to now."""
        return FarEnd(self)

    def handle(self, method: str, target: str, body: bytes) -> Response:
        """Return the answer of a server without controld3: it has scans and pictures, and drives nothing."""
        with self.now() as seconds:
            self._server.now = seconds
            path = target.partition("?")[0]
            if path == CAMERA:
                self._wanted = seconds
            if method != "GET" or path not in (CAMERA, SCAN):
                return Response(400 if method != "GET" else self._server.unknown)
            return self._server.handle(method, target, body, self.plant)

    def _show(self, picture: bytes) -> None:
        self._server.picture = picture


class FarEnd:
    """What a `PtyLine` needs of a board."""

    def __init__(self, base: EmulatedBoard) -> None:
        self._base = base

    def advance(self, now: float, plant: Plant) -> None:  # noqa: ARG002, the world has a clock of its own
        """Let time pass."""
        with self._base.now():
            pass

    def receive(self, data: bytes, plant: Plant) -> bytes:
        """Take bytes from the host; return the answers."""
        with self._base.now():
            return self._base.double.receive(data, plant)

    def reset(self) -> None:
        """Begin anew, as after power-up."""
        with self._base.now():
            self._base.double.reset()
