"""A room to push in: walls and furniture, where base and object start, and where the object is to go."""

from __future__ import annotations

from importlib import resources
from math import pi
from typing import Annotated, TypeVar

import msgspec
import numpy as np

from drivers.sapien.optics import CameraModel
from drivers.sapien.shapes import Box, Colour, Coordinate, Disc, Shape, Size, Yaw
from runtime.errors import PushlaneError

Noise = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]

Moment = Annotated[float, msgspec.Meta(ge=0.0, le=1e6)]

FOR_EVER = 1e6
"""s"""

WALL = 0.1
"""Thickness of a room's outer walls, m; they stand just outside its bounds."""


class SceneError(PushlaneError):
    """A scene's description is wrong; the message names the file, the key and what was expected."""


class UnknownScene(PushlaneError):
    """No scene of this name exists; the message lists those that do."""


class Bounds(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The inside of a room, m, map frame."""

    min_x: Coordinate
    min_y: Coordinate
    max_x: Coordinate
    max_y: Coordinate

    def __post_init__(self) -> None:
        if not (self.min_x < self.max_x and self.min_y < self.max_y):
            low, high = (self.min_x, self.min_y), (self.max_x, self.max_y)
            raise ValueError(f"min is {low}, expected less than max, {high}")


class BoxObstacle(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A wall or furniture: centre m, yaw rad, length along its own x and width along its own y, m.

    height: m, which only cameras see. since, until: s since the world began; it stands there from then to then.
    """

    x: Coordinate
    y: Coordinate
    length: Size
    width: Size
    yaw: Yaw = 0.0
    height: Size = 0.7
    label: str = ""
    colour: Colour = "#9a9a9a"
    since: Moment = 0.0
    until: Moment = FOR_EVER

    def shape(self) -> Box:
        """Return its outline."""
        return Box(x=self.x, y=self.y, yaw=self.yaw, length=self.length, width=self.width)


class DiscObstacle(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A post, a table leg or a round table: centre and radius, m. height, since, until: see BoxObstacle."""

    x: Coordinate
    y: Coordinate
    radius: Size
    height: Size = 0.7
    label: str = ""
    colour: Colour = "#9a9a9a"
    since: Moment = 0.0
    until: Moment = FOR_EVER

    def shape(self) -> Disc:
        """Return its outline."""
        return Disc(x=self.x, y=self.y, radius=self.radius)


Obstacle = TypeVar("Obstacle", BoxObstacle, DiscObstacle)


class Place(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A pose, map frame: m and rad."""

    x: Coordinate
    y: Coordinate
    yaw: Yaw = 0.0


class Goal(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where the object is to go, map frame, m."""

    x: Coordinate
    y: Coordinate


class Jitter(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How far starts differ from push to push; each is drawn evenly from minus to plus.

    robot_position, object_position: m, in x and in y. robot_yaw, object_yaw: rad.
    """

    robot_position: Annotated[float, msgspec.Meta(ge=0.0, le=0.5)] = 0.03
    robot_yaw: Annotated[float, msgspec.Meta(ge=0.0, le=3.1416)] = 0.1
    object_position: Annotated[float, msgspec.Meta(ge=0.0, le=0.5)] = 0.03
    object_yaw: Annotated[float, msgspec.Meta(ge=0.0, le=3.1416)] = pi


class SensorNoise(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Standard deviations of what sensors say.

    object_position: m, in x and in y, of a seen object. object_yaw: rad. scan: m, of a laser beam.
    ranges: m, of an infra-red reading. odometry_distance: m per root of a metre travelled.
    odometry_turn: rad per root of a radian turned. odometry_heading: rad per root of a metre travelled.
    """

    object_position: Noise = 0.007
    object_yaw: Noise = 0.035
    scan: Noise = 0.01
    ranges: Noise = 0.005
    odometry_distance: Noise = 0.01
    odometry_turn: Noise = 0.02
    odometry_heading: Noise = 0.01


class Spell(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """From `begin` to before `end`: s since perception began."""

    begin: Annotated[float, msgspec.Meta(ge=0.0, le=3600.0)]
    end: Annotated[float, msgspec.Meta(ge=0.0, le=3600.0)]

    def __post_init__(self) -> None:
        if not self.begin < self.end:
            raise ValueError(f"begin is {self.begin} s, expected less than end, {self.end} s")


class Scene(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One room and one task in it. Outer walls WALL m thick stand around `bounds`.

    robot, object: where they start; the object's place is that of o. goal: where o is to go.
    default_object: a name of `objects.names()`. blind: when the tracker has lost the object. camera: on the base.
    """

    name: str
    title: str
    bounds: Bounds
    boxes: tuple[BoxObstacle, ...] = ()
    discs: tuple[DiscObstacle, ...] = ()
    robot: Place
    object: Place
    goal: Goal
    default_object: str
    jitter: Jitter = Jitter()
    noise: SensorNoise = SensorNoise()
    blind: tuple[Spell, ...] = ()
    camera: CameraModel = CameraModel()

    def obstacles(self, time: float = 0.0) -> tuple[Shape, ...]:
        """Return the outer walls and the boxes and discs that stand there at `time`, s, as plain shapes, map frame."""
        walls = outer_walls(self.bounds)
        boxes, discs = standing(self.boxes, time), standing(self.discs, time)
        return (*walls, *(box.shape() for box in boxes), *(disc.shape() for disc in discs))

    def changes(self) -> tuple[float, ...]:
        """Return when obstacles come or go, s since the world began, in order."""
        every: list[BoxObstacle | DiscObstacle] = [*self.boxes, *self.discs]
        moments = {moment for one in every for moment in (one.since, one.until)}
        return tuple(sorted(moments - {0.0, FOR_EVER}))


def standing(obstacles: tuple[Obstacle, ...], time: float) -> list[Obstacle]:
    """Return those of `obstacles` that stand there at `time`, s."""
    return [one for one in obstacles if one.since <= time < one.until]


def outer_walls(bounds: Bounds) -> tuple[Box, Box, Box, Box]:
    """Return the walls just outside `bounds`."""
    middle_x, middle_y = (bounds.min_x + bounds.max_x) / 2, (bounds.min_y + bounds.max_y) / 2
    length, width = bounds.max_x - bounds.min_x + 2 * WALL, bounds.max_y - bounds.min_y + 2 * WALL
    return (
        Box(x=middle_x, y=bounds.min_y - WALL / 2, length=length, width=WALL),
        Box(x=middle_x, y=bounds.max_y + WALL / 2, length=length, width=WALL),
        Box(x=bounds.min_x - WALL / 2, y=middle_y, length=WALL, width=width),
        Box(x=bounds.max_x + WALL / 2, y=middle_y, length=WALL, width=width),
    )


def jittered(scene: Scene, generator: np.random.Generator) -> Scene:
    """Return `scene` with starts drawn from its jitter."""
    jitter = scene.jitter
    robot = _shifted(scene.robot, jitter.robot_position, jitter.robot_yaw, generator)
    thing = _shifted(scene.object, jitter.object_position, jitter.object_yaw, generator)
    return msgspec.structs.replace(scene, robot=robot, object=thing)


def _shifted(place: Place, position: float, yaw: float, generator: np.random.Generator) -> Place:
    x, y, turn = generator.uniform(-1.0, 1.0, 3)
    shift_x, shift_y, shift_yaw = position * float(x), position * float(y), yaw * float(turn)
    return Place(x=place.x + shift_x, y=place.y + shift_y, yaw=place.yaw + shift_yaw)


def load(text: str, source: str) -> Scene:
    """Return the scene that TOML `text` describes. `source` names the text in errors.

    Raises:
        SceneError: it is not TOML, a key is unknown or missing, or a value is out of range.
    """
    try:
        return msgspec.toml.decode(text, type=Scene)
    except (msgspec.MsgspecError, ValueError) as error:
        raise SceneError(f"{source}: {error}") from error


def names() -> tuple[str, ...]:
    """Return the names of the scenes that come with the package, sorted."""
    folder = resources.files("drivers.sapien") / "scenes"
    files = (file.name for file in folder.iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in files if name.endswith(".toml")))


def get(name: str) -> Scene:
    """Return the scene called `name`, from the package.

    Raises:
        UnknownScene: there is none.
    """
    known = names()
    if name not in known:
        raise UnknownScene(f"no scene is called {name!r}; known are {', '.join(known)}")
    file = resources.files("drivers.sapien") / "scenes" / f"{name}.toml"
    return load(file.read_text(encoding="utf-8"), f"{name}.toml")
