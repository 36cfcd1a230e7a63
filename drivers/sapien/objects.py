"""The objects that can be pushed: ranges of what one may be like, and one drawn from them.

The reference point o of an object is the centre of its bounding circle, whose diameter is d_o.
"""

from __future__ import annotations

from functools import cache
from importlib import resources
from typing import Annotated

import msgspec
import numpy as np

from drivers.sapien.friction import GRAVITY, Floor
from drivers.sapien.shapes import Colour, Coordinate, Disc, Shape, Size, Yaw, bounding_circle, moved
from drivers.sapien.support import Area, SupportError, area, loads
from runtime.errors import PushlaneError

Mass = Annotated[float, msgspec.Meta(gt=0.0, le=100.0)]
Friction = Annotated[float, msgspec.Meta(ge=0.0, le=2.0)]
Positive = Annotated[float, msgspec.Meta(gt=0.0, le=1000.0)]

# A ball stands on a small patch, so that its spin about the vertical dies out.
_PATCH_RADIUS = 0.01
_PATCH_POINTS = 3
_BALL_ROLLING = 7 / 5
_BALL_SPIN = 2 / 5


class UnknownObject(PushlaneError):
    """No object of this name exists; the message lists those that do."""


class ObjectError(PushlaneError):
    """An object's description is wrong; the message names the file, the key and what was expected."""


class Wheel(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where a wheel touches the floor, m, and the direction it rolls in, rad, both in the object's frame."""

    x: Coordinate
    y: Coordinate
    yaw: Yaw = 0.0


class ObjectModel(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A kind of object: its shape, and ranges (low, high) for what differs between two of the kind.

    parts: shapes in a frame of the author's choice. rolls: it is a ball, and `friction` is its rolling
    resistance. friction: between area and floor; unused where there are wheels. offset_x, offset_y: m, centre
    of mass from the middle of the floor area. along, across: friction of every wheel in and across its
    rolling direction. rim: friction between its sides and robot or walls. height: m, and colour: which only
    cameras see.
    """

    name: str
    title: str
    parts: Annotated[tuple[Shape, ...], msgspec.Meta(min_length=1)]
    mass: tuple[Mass, Mass]
    friction: tuple[Friction, Friction]
    offset_x: tuple[Coordinate, Coordinate] = (0.0, 0.0)
    offset_y: tuple[Coordinate, Coordinate] = (0.0, 0.0)
    wheels: tuple[Wheel, ...] = ()
    along: tuple[Friction, Friction] = (0.0, 0.0)
    across: tuple[Friction, Friction] = (0.0, 0.0)
    rim: tuple[Friction, Friction] = (0.2, 0.4)
    rolls: bool = False
    height: Size = 0.2
    colour: Colour = "#c08030"

    def __post_init__(self) -> None:
        for key in ("mass", "friction", "offset_x", "offset_y", "along", "across", "rim"):
            low, high = getattr(self, key)
            if low > high:
                raise ValueError(f"{self.name}: {key} is [{low}, {high}], expected [low, high]")


class ObjectBody(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One object in numbers. Its frame has the origin o, the centre of the bounding circle.

    diameter: d_o, m. inertial_mass: kg, what a push has to accelerate, 7/5 of the mass for a ball. inertia:
    kg m^2 about the vertical through the centre of mass. centre_x, centre_y: m, centre of mass.
    friction, along, across, rim, rolls, height, colour: see ObjectModel.
    """

    name: str
    parts: Annotated[tuple[Shape, ...], msgspec.Meta(min_length=1)]
    diameter: Positive
    mass: Mass
    inertial_mass: Positive
    inertia: Positive
    friction: Friction
    centre_x: Coordinate
    centre_y: Coordinate
    wheels: tuple[Wheel, ...]
    along: Friction
    across: Friction
    rim: Friction
    rolls: bool
    height: Size = 0.2
    colour: Colour = "#c08030"


def names() -> tuple[str, ...]:
    """Return the names of all objects, in the order of the file."""
    return tuple(_models())


def get(name: str) -> ObjectModel:
    """Return the object called `name`.

    Raises:
        UnknownObject: there is none.
    """
    models = _models()
    if name not in models:
        raise UnknownObject(f"no object is called {name!r}; known are {', '.join(models)}")
    return models[name]


def draw(model: ObjectModel, generator: np.random.Generator) -> ObjectBody:
    """Return one object of the kind `model`, every range drawn evenly.

    Raises:
        ObjectError: the centre of mass drawn lies outside what the object stands on.
    """
    mass, friction, offset_x, offset_y, along, across, rim = (
        float(generator.uniform(low, high))
        for low, high in (
            model.mass, model.friction, model.offset_x, model.offset_y, model.along, model.across, model.rim,
        )
    )  # fmt: skip
    x, y, radius = bounding_circle(model.parts)
    parts = tuple(moved(part, -x, -y, 0.0) for part in model.parts)
    wheels = tuple(msgspec.structs.replace(wheel, x=wheel.x - x, y=wheel.y - y) for wheel in model.wheels)
    covered = area(parts)
    centre = covered.centroid()
    body = ObjectBody(
        name=model.name,
        parts=parts,
        diameter=2 * radius,
        mass=mass,
        inertial_mass=mass * _BALL_ROLLING if model.rolls else mass,
        inertia=mass * (_BALL_SPIN * radius**2 if model.rolls else covered.gyration() ** 2),
        friction=friction,
        centre_x=float(centre[0]) + offset_x,
        centre_y=float(centre[1]) + offset_y,
        wheels=wheels,
        along=along,
        across=across,
        rim=rim,
        rolls=model.rolls,
        height=model.height,
        colour=model.colour,
    )
    try:
        floor(body)
    except SupportError as error:
        raise ObjectError(f"{model.name}: {error}") from error
    return body


def floor(body: ObjectBody) -> Floor:
    """Return what the floor can do to `body`, about its centre of mass.

    Raises:
        SupportError: the centre of mass is outside what the object stands on.
    """
    centre = np.array([body.centre_x, body.centre_y])
    along, across = (body.along, body.across) if body.wheels else (body.friction, body.friction)
    if body.wheels:
        standing = Area(np.array([[one.x, one.y] for one in body.wheels]), np.ones(len(body.wheels)))
    elif body.rolls:
        angle = 2 * np.pi * np.arange(_PATCH_POINTS) / _PATCH_POINTS
        patch = _PATCH_RADIUS * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        standing = Area(centre + patch, np.ones(_PATCH_POINTS))
    else:
        standing = area(body.parts)
    load = loads(standing, centre) * body.mass * GRAVITY
    yaw = np.array([one.yaw for one in body.wheels]) if body.wheels else np.zeros(len(load))
    return Floor(
        position=np.ascontiguousarray(standing.position - centre),
        limit=np.ascontiguousarray(np.stack([load * along, load * across], axis=1)),
        axis=np.ascontiguousarray(np.stack([np.cos(yaw), np.sin(yaw)], axis=1)),
        isotropic=not body.wheels,
    )


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    object: tuple[ObjectModel, ...]


def load(text: str, source: str) -> dict[str, ObjectModel]:
    """Return the objects that TOML `text` describes, by name. `source` names the text in errors.

    Raises:
        ObjectError: it is not TOML, a key is unknown or missing, a value is out of range, or a ball is no disc.
    """
    try:
        models = {one.name: one for one in msgspec.toml.decode(text, type=_File).object}
    except (msgspec.MsgspecError, ValueError) as error:
        raise ObjectError(f"{source}: {error}") from error
    for model in models.values():
        if model.rolls and not (len(model.parts) == 1 and isinstance(model.parts[0], Disc)):
            raise ObjectError(f"{source}: {model.name}: rolls = true expects one disc as parts")
    return models


@cache
def _models() -> dict[str, ObjectModel]:
    source = resources.files("drivers.sapien") / "objects.toml"
    return load(source.read_text(encoding="utf-8"), "objects.toml")
