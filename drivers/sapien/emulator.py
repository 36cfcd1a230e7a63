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

import cv2
import numpy as np

from drivers.robotino.rest.restapid import Response, Restapid
from drivers.robotino.serial.board import Board
from drivers.sapien import plant as simulated
from drivers.sapien.base import BaseModel
from drivers.sapien.camera import SapienCameraConfig
from drivers.sapien.config import SapienConfig
from drivers.sapien.look import Eye, Sight
from runtime.time import SECOND

_PERIOD = 0.005
"""s between two looks at what the board wants"""
_PICTURE_PERIOD = 0.1
_WATCHED_FOR = 2.0
"""s after a request of a picture in which pictures are drawn"""
CAMERA = "/cam0"

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
        self._plant = simulated.SapienPlant(config)
        self._clock = clock
        self._began = clock()
        self._lock = threading.RLock()
        self._stop = threading.Event()
        self._wanted = -_WATCHED_FOR

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
        with self._now():
            world = self._plant.world
            (rx, ry, rt), (ox, oy, ot) = world.robot_pose, world.object_pose
            return Standing(
                seconds=world.seconds,
                robot=(float(rx), float(ry), float(rt)),
                object=(float(ox), float(oy), float(ot)),
                twist=self._plant.twist,
                hit=bool(world.robot_hit or world.object_hit),
            )

    @contextmanager
    def _now(self) -> Iterator[float]:
        """Hold the world still at this moment; gives s since it began."""
        with self._lock:
            now = self._clock() - self._began
            self._plant.advance(now, self.double)
            yield now / SECOND

    def _go(self) -> None:
        while not self._stop.wait(_PERIOD):
            with self._now():
                pass

    def _draw(self, config: SapienCameraConfig) -> None:
        """Draw pictures while somebody asks for them. A thread of its own has the renderer: it is no other's."""
        camera = config.scene.camera
        eye = Eye(config.scene, config.body, BaseModel().diameter, config.tagged)
        generator = np.random.Generator(np.random.PCG64(config.seed))
        while not self._stop.wait(_PICTURE_PERIOD):
            found = self.standing()
            if found.seconds - self._wanted > _WATCHED_FOR:
                continue
            picture, _ = eye.look(Sight(found.robot, found.object, found.seconds))
            noise = camera.noise * generator.standard_normal(picture.shape, np.float32)
            grey = np.clip(np.rint(picture * (255.0 * camera.exposure) + noise), 0.0, 255.0).astype(np.uint8)
            _, data = cv2.imencode(".jpg", grey[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, camera.quality])
            with self._lock:
                self._show(data.tobytes())

    def _show(self, picture: bytes) -> None:
        """Take the newest picture, a JPEG."""


class EmulatedServer(Emulated[Restapid]):
    """A simulated base behind the double of its REST server."""

    def handle(self, method: str, target: str, body: bytes) -> Response:
        """Return the server's answer to a request, and do what it asks for."""
        with self._now() as seconds:
            if target.partition("?")[0] == CAMERA:
                self._wanted = seconds
            return self.double.handle(method, target, body, self._plant)

    def _show(self, picture: bytes) -> None:
        self.double.picture = picture


class EmulatedBoard(Emulated[Board]):
    """A simulated base behind the double of its board."""

    def receive(self, data: bytes) -> bytes:
        """Give the board what came over the line; return what it answers."""
        with self._now():
            return self.double.receive(data, self._plant)

    def reset(self) -> None:
        """Let the board begin anew, as after power-up."""
        with self._now():
            self.double.reset()
