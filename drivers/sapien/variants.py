"""A scene or object changed for an experiment: corridor width, where the base starts, size, mass and friction."""

from __future__ import annotations

from math import atan2, cos, hypot, pi, radians, sin, tan

import msgspec
import numpy as np

from drivers.angles import wrap
from drivers.sapien.objects import ObjectBody
from drivers.sapien.scene import Bounds, BoxObstacle, Place, Scene
from drivers.sapien.shapes import Box, Disc, Shape
from runtime.errors import PushlaneError

STARTS = ("scene", "behind", "beside", "front")
"""Where the base starts, seen along the first push: as the scene says, behind, beside, or in front of the object."""

START_GAP = 0.12
"""m between base and object for every start but the scene's own; more than the default jitter can close."""

_BEARINGS = 200
"""that are tried"""
_TURNS = {"behind": (0.0,), "beside": (pi / 2, -pi / 2), "front": (pi,)}


class CannotScale(PushlaneError):
    """The scene is no synthetic corridor, or its walls would close; the message says which."""


class CannotAlter(PushlaneError):
    """The object does not slide, so no floor friction of it can be set; the message says which."""


class NoRoomToStart(PushlaneError):
    """The base does not fit where it is to start."""


class _Corridor(msgspec.Struct, frozen=True):
    """half: m, from the middle of the passage to its walls. away: label -> where its boxes go, a metre of widening."""

    half: float
    away: dict[str, tuple[float, float]]


# A bend's walls stay parallel to its path if inner and outer corner both move by 1 / cos(turn / 2) along the
# bisector. For a right angle that is (1, 1); for corridor 2, which turns by 50 degrees, it is (tan 25, 1).
_LEAN = tan(radians(25.0))
_CORRIDORS = {
    "corridor-1": _Corridor(0.9, {"inner wall": (-1.0, 1.0)}),
    "corridor-2": _Corridor(0.94, {"upper wall": (-_LEAN, 1.0), "lower wall": (_LEAN, -1.0)}),
    "corridor-3": _Corridor(0.9, {"upper wall": (-1.0, 1.0), "lower wall": (1.0, -1.0)}),
}


def scalable() -> tuple[str, ...]:
    """Return the scenes whose corridor can be scaled."""
    return tuple(_CORRIDORS)


def widened(scene: Scene, factor: float, robot_diameter: float) -> Scene:
    """Return `scene` with the half width W_p of its pushing corridor times `factor`: all walls move, Q stays.

    Args:
        robot_diameter: d_r, m. W_p is what the middle of the robot may use: half the passage less d_r/2.

    Raises:
        CannotScale: see there.
    """
    if factor == 1.0:
        return scene
    corridor = _CORRIDORS.get(scene.name)
    if corridor is None:
        raise CannotScale(
            f"sim.width is {factor:g}, but scene '{scene.name}' cannot be scaled; "
            f"expected one of {', '.join(scalable())}"
        )
    shift = (factor - 1.0) * (corridor.half - robot_diameter / 2)
    old = scene.bounds
    new = Bounds(min_x=old.min_x - shift, min_y=old.min_y - shift, max_x=old.max_x + shift, max_y=old.max_y + shift)
    boxes = []
    for box in scene.boxes:
        x, y = corridor.away[box.label]
        moved = _reaching(msgspec.structs.replace(box, x=box.x + shift * x, y=box.y + shift * y), box, old, new)
        if min(moved.length, moved.width) <= 0.0:
            raise CannotScale(f"sim.width is {factor:g}: the {box.label} of scene '{scene.name}' would vanish")
        boxes.append(moved)
    return msgspec.structs.replace(scene, bounds=new, boxes=tuple(boxes))


def started(scene: Scene, start: str, robot_diameter: float, object_diameter: float, seed: int) -> Scene:
    """Return `scene` with the base at `start`, one of STARTS, facing the object as the scene's own start does.

    The direction of the first push is that from the scene's own start to the object. Behind, beside and in front
    differ in nothing but the bearing: the gap to the object is START_GAP.

    Args:
        seed: draws the side of `beside`; where the base fits on one side only, it is that one.

    Raises:
        NoRoomToStart: see there.
    """
    if start == "scene":
        return scene
    robot, thing = scene.robot, scene.object
    bearing = atan2(robot.y - thing.y, robot.x - thing.x)
    distance = (robot_diameter + object_diameter) / 2 + START_GAP
    turns = _TURNS[start]
    if np.random.default_rng(seed).random() < 0.5:
        turns = turns[::-1]
    for turn in turns:
        x, y = thing.x + distance * cos(bearing + turn), thing.y + distance * sin(bearing + turn)
        room = min(_distance(shape, x, y) for shape in scene.obstacles()) - robot_diameter / 2
        if _inside(scene.bounds, x, y) and room > scene.jitter.robot_position:
            return msgspec.structs.replace(scene, robot=Place(x=x, y=y, yaw=robot.yaw + turn))
    raise NoRoomToStart(
        f"sim.start is '{start}', but in scene '{scene.name}' a base of {robot_diameter:g} m does not fit there"
    )


def distanced(scene: Scene, distance: float, robot_diameter: float, seed: int) -> Scene:
    """Return `scene` with the base `distance` m from the object, facing it, with nothing between; 0: as it is.

    Args:
        seed: draws the bearing, of those at which the base has room and sees the object.

    Raises:
        NoRoomToStart: there is none.
    """
    if distance == 0.0:
        return scene
    thing = scene.object
    for bearing in np.random.default_rng(seed).uniform(-pi, pi, _BEARINGS):
        c, s = cos(bearing), sin(bearing)
        way = np.linspace(0.0, distance, max(2, int(distance / 0.05)))
        clear = min(
            _distance(shape, thing.x + c * part, thing.y + s * part) for shape in scene.obstacles() for part in way
        )
        x, y = thing.x + distance * c, thing.y + distance * s
        if _inside(scene.bounds, x, y) and clear > robot_diameter / 2 + scene.jitter.robot_position:
            return msgspec.structs.replace(scene, robot=Place(x=x, y=y, yaw=wrap(float(bearing) + pi)))
    raise NoRoomToStart(
        f"sim.distance is {distance:g} m, but in scene '{scene.name}' no base of {robot_diameter:g} m sees the object "
        "from there"
    )


def altered(body: ObjectBody, diameter: float = 0.0, mass: float = 0.0, friction: float = 0.0) -> ObjectBody:
    """Return `body` with another size, mass or floor friction, each alone; what is 0 stays.

    Args:
        diameter: d_o, m. Everything that has a place grows in proportion; the mass stays.
        mass: kg. Its distribution stays.
        friction: between floor and object.

    Raises:
        CannotAlter: see there.
    """
    if friction and (body.wheels or body.rolls):
        raise CannotAlter(
            f"sim.object_friction is {friction:g}, but object '{body.name}' {'rolls' if body.rolls else 'has wheels'}; "
            "expected an object that slides"
        )
    scale = diameter / body.diameter if diameter else 1.0
    heavier = mass / body.mass if mass else 1.0
    if scale != 1.0:
        body = msgspec.structs.replace(
            body,
            parts=tuple(_scaled(part, scale) for part in body.parts),
            diameter=diameter,
            inertia=body.inertia * scale**2,
            centre_x=body.centre_x * scale,
            centre_y=body.centre_y * scale,
            wheels=tuple(msgspec.structs.replace(one, x=one.x * scale, y=one.y * scale) for one in body.wheels),
        )
    if heavier != 1.0:
        body = msgspec.structs.replace(
            body, mass=mass, inertial_mass=body.inertial_mass * heavier, inertia=body.inertia * heavier
        )
    return msgspec.structs.replace(body, friction=friction) if friction else body


def _scaled(shape: Shape, scale: float) -> Shape:
    x, y = shape.x * scale, shape.y * scale
    if isinstance(shape, Disc):
        return msgspec.structs.replace(shape, x=x, y=y, radius=shape.radius * scale)
    return msgspec.structs.replace(shape, x=x, y=y, length=shape.length * scale, width=shape.width * scale)


def _reaching(moved: BoxObstacle, box: BoxObstacle, old: Bounds, new: Bounds) -> BoxObstacle:
    """Return `moved` drawn out to the outer walls that `box` touched."""
    if box.yaw != 0.0:
        return moved
    ends = []
    for axis, size in (("x", "length"), ("y", "width")):
        low, high = _ends(moved, axis, size)
        was_low, was_high = _ends(box, axis, size)
        # Walls stand exactly on the bounds; the slack is for the four decimals of the files.
        if was_low < getattr(old, f"min_{axis}") + 1e-3:
            low = getattr(new, f"min_{axis}")
        if was_high > getattr(old, f"max_{axis}") - 1e-3:
            high = getattr(new, f"max_{axis}")
        ends += [(low + high) / 2, high - low]
    x, length, y, width = ends
    return msgspec.structs.replace(moved, x=x, length=length, y=y, width=width)


def _ends(box: BoxObstacle, axis: str, size: str) -> tuple[float, float]:
    middle, extent = getattr(box, axis), getattr(box, size)
    return middle - extent / 2, middle + extent / 2


def _inside(bounds: Bounds, x: float, y: float) -> bool:
    return bounds.min_x < x < bounds.max_x and bounds.min_y < y < bounds.max_y


def _distance(shape: Shape, x: float, y: float) -> float:
    """Return the distance from a point to `shape`, m; 0 inside."""
    if isinstance(shape, Disc):
        return max(hypot(x - shape.x, y - shape.y) - shape.radius, 0.0)
    assert isinstance(shape, Box)
    c, s = cos(shape.yaw), sin(shape.yaw)
    dx, dy = x - shape.x, y - shape.y
    return hypot(max(abs(c * dx + s * dy) - shape.length / 2, 0.0), max(abs(c * dy - s * dx) - shape.width / 2, 0.0))
