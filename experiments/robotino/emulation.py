"""A simulated Robotino behind its own interface, for people: what it says while it runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from drivers.robotino.rest.restapid import Restapid
from drivers.robotino.rest.server import RestServer
from drivers.robotino.serial.board import Board
from drivers.robotino.serial.line import PtyLine
from drivers.sapien.camera import SapienCameraConfig
from drivers.sapien.config import SapienConfig
from drivers.sapien.emulator import EmulatedBoard, EmulatedServer, Standing
from drivers.sapien.look import TAG_CUBE
from drivers.sapien.scene import Scene
from experiments.session import Session
from runtime.errors import PushlaneError

_SAY_EVERY = 5.0

T = TypeVar("T")


class NoPlace(PushlaneError):
    """The double's end of the link cannot be opened."""

    exit_code = 2


@dataclass(frozen=True)
class Place:
    """Where the link's end is to be, see `pushlane robotino emulate`."""

    address: str
    port: int
    device: Path
    idle: float
    camera: bool
    system: Path | None = None


def run(session: Session, link: str, place: Place, wait: Callable[[float], bool]) -> Iterator[str]:
    """Let a simulated base stand at the far end of a link until `wait` says to stop. Yields lines for people.

    Raises:
        NoPlace: the address, or the name of the device, is taken.
    """
    world = session.world
    camera = camera_of(world) if place.camera else None
    with ExitStack() as stack:
        base: EmulatedServer | EmulatedBoard
        if link == "rest":
            base = EmulatedServer(world, Restapid(idle=place.idle, volts=world.battery_voltage))
        else:
            base = EmulatedBoard(world, Board(volts=world.battery_voltage))
            line = _opened(
                f"serial device {place.device}",
                lambda: stack.enter_context(PtyLine(base.far(), base.plant, link=place.device)),
            )
            yield f"serial device {place.device} ({line.device})"
        server = _opened(f"{place.address}:{place.port}", lambda: RestServer(base.handle, place.address, place.port))
        stack.enter_context(server)
        what = "everything" if link == "rest" else "laser and camera"
        yield f"{what} at {server.url}{'' if camera else ', without a camera'}"
        stack.enter_context(base.running(camera))
        if place.system is not None:
            place.system.write_text(system(world, link, place, server.url))
        yield from introduced(world.scene, session.goal.position.x, session.goal.position.y, place.system, server.url)
        before = ""
        while not wait(_SAY_EVERY):
            found = base.standing()
            if (now := told(found, world.scene)) != before:
                yield f"{found.seconds:7.1f} s: {now}"
            before = now
        found = base.standing()
        yield f"{found.seconds:7.1f} s: {told(found, world.scene)}"


def camera_of(world: SapienConfig) -> SapienCameraConfig:
    """Return the camera of a world's base."""
    return SapienCameraConfig(seed=world.seed, scene=world.scene, body=world.body, base=world.base)


def system(world: SapienConfig, link: str, place: Place, url: str) -> str:
    """Return the system file, TOML, of services that drive this base: what a real base's says by hand.

    Args:
        url: of the REST server.
    """
    camera, body, laser = world.scene.camera, world.body, world.laser
    k = camera.calibration().K
    base = (
        f'[robotino-rest]\nurl = "{url}"\n'
        if link == "rest"
        else f'[robotino-serial]\ndevice = "{place.device.absolute()}"\n\n[robotino-laser]\nurl = "{url}"\n'
    )
    return f"""\
# The system that drives the emulated base: pushlane run this, pushlane camera feed {url}/cam0, pushlane push --to X Y
# For a real base take deploy/robotino-{link}.toml: camera, laser and speeds are others there.
[bus]
robot = "emulated"

[system]
base = "robotino-{link}"

{base}laser_x = {laser.x}
laser_y = {laser.y}
laser_yaw = {laser.yaw}

[opencv-camera]
rate = {camera.rate}
latency = 0.1

[opencv-camera.calibration]
width = {camera.width}
height = {camera.height}
focal = [{k[0]:.4f}, {k[4]:.4f}]
centre = [{k[2]:.4f}, {k[5]:.4f}]

[opencv-camera.mount]
x = {camera.x}
y = {camera.y}
z = {camera.z}
roll = {camera.roll}
pitch = {camera.pitch}
yaw = {camera.yaw}

[tracker]
finds = "tags"
cube = {TAG_CUBE}
height = {body.height}
diameter = {body.diameter}

# An emulated base hurts nobody; a real one goes at 0.1 m/s.
[controller]
speed = 0.3

[strategy.predictive]
speed = 0.3

[task]
strategy = "predictive"
controller = "predictive"
"""


def introduced(scene: Scene, x: float, y: float, file: Path | None, url: str) -> Iterator[str]:
    """Say where things are as the base's map will have it, which begins at the base; and what to do with them."""
    thing = from_start(scene, scene.object.x, scene.object.y)
    goal = from_start(scene, x, y)
    yield (
        f"as seen from where the base starts, its map's origin: object at ({thing[0]:.2f}, {thing[1]:.2f}) m, "
        f"the scene's goal at ({goal[0]:.2f}, {goal[1]:.2f}) m"
    )
    if file is not None:
        yield f"wrote {file}; in other terminals:"
        yield f"  pushlane run {file}"
        yield f"  pushlane camera feed {url}/cam0 --config {file}"
        yield f"  pushlane push --to {goal[0]:.2f} {goal[1]:.2f} --config {file}"


def told(found: Standing, scene: Scene) -> str:
    """Say where things are."""
    robot, thing = from_start(scene, *found.robot[:2]), from_start(scene, *found.object[:2])
    speed = math.hypot(*found.twist[:2])
    return (
        f"base at ({robot[0]:.2f}, {robot[1]:.2f}) m, {speed:.2f} m/s; "
        f"object at ({thing[0]:.2f}, {thing[1]:.2f}) m{'; touches something' if found.hit else ''}"
    )


def from_start(scene: Scene, x: float, y: float) -> tuple[float, float]:
    """Return a place of the scene, m, in the frame that has its origin where the base starts, and its direction."""
    dx, dy, yaw = x - scene.robot.x, y - scene.robot.y, scene.robot.yaw
    c, s = math.cos(yaw), math.sin(yaw)
    return c * dx + s * dy, -s * dx + c * dy


def _opened(what: str, make: Callable[[], T]) -> T:
    try:
        return make()
    except OSError as error:
        raise NoPlace(f"cannot open {what}: {error.strerror or error}") from error
