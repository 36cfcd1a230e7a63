"""Rooms that change while the robot pushes (Sec. 6.3.4): two things are put into the corridor, one is taken away."""

from __future__ import annotations

import math

import msgspec
import numpy as np
from numpy.typing import NDArray

from drivers.sapien.objects import ObjectBody
from drivers.sapien.occupancy import rasterise
from drivers.sapien.scene import BoxObstacle, DiscObstacle, Scene
from runtime.errors import PushlaneError
from services.corridor.corridor import build
from services.corridor.shortest_path import PlanningError
from services.geometry.corridor import CorridorGeometry

Array = NDArray[np.float64]

_FASTEST = 0.3
"""m/s that the object may advance"""
_AHEAD = 1.0
"""m before the object at least, however fast it came there, where something is put down"""
_RADIUS = (0.08, 0.16)
"""m, of what is put down"""
_MOMENTS = ((1.5, 4.0), (3.0, 7.0), (2.0, 8.0))
"""s since the beginning, between which the first and the second come, and one goes"""
_SMALL = 0.6
"""m, of what can be taken away"""
_TRIES = 400


class NoRoomToChange(PushlaneError):
    """A scene in which nothing can be put into the corridor that leaves a way."""


def changing(scene: Scene, body: ObjectBody, base_diameter: float, seed: int) -> Scene:
    """Return `scene` with two things that come to lie in the corridor, and one that goes.

    They come where the robot is not yet, and leave a way from where the object started: whether one is left from
    where it is by then is up to the push.

    Raises:
        NoRoomToChange: no such places were found.
    """
    generator = np.random.Generator(np.random.PCG64(seed))
    corridor = _corridor(scene, 0.0, body, base_diameter)
    if corridor is None:
        raise NoRoomToChange(f"scene '{scene.name}' has no corridor to begin with")
    length = float(corridor.arc[-1] - corridor.arc[corridor.start])
    for _ in range(_TRIES):
        moments = [float(generator.uniform(*one)) for one in _MOMENTS]
        added = []
        for moment in moments[:2]:
            least, most = _FASTEST * moment + _AHEAD, length - 0.5
            if least >= most:
                break
            along = float(generator.uniform(least, most))
            added.append(_within(corridor, along, moment, generator))
        tried = _without_one(msgspec.structs.replace(scene, discs=scene.discs + tuple(added)), moments[2], generator)
        if len(added) == 2 and tried is not None and _corridor(tried, max(moments), body, base_diameter) is not None:
            return tried
    raise NoRoomToChange(f"in scene '{scene.name}', with {body.name}, nothing fits into the corridor and leaves a way")


def _corridor(scene: Scene, time: float, body: ObjectBody, base_diameter: float) -> CorridorGeometry | None:
    grid = rasterise(scene, time=time)
    r, o, g = (np.array((one.x, one.y)) for one in (scene.robot, scene.object, scene.goal))
    try:
        return build(grid.cells, grid.resolution, np.array(grid.origin), r, o, g, base_diameter, body.diameter)
    except PlanningError:
        return None


def _within(corridor: CorridorGeometry, along: float, moment: float, generator: np.random.Generator) -> DiscObstacle:
    """Return something in the corridor so many m along Q from o, that comes at `moment`."""
    k = int(np.searchsorted(corridor.arc, corridor.arc[corridor.start] + along))
    k = min(max(k, 1), len(corridor.path) - 1)
    ahead = corridor.path[k] - corridor.path[k - 1]
    heading = math.atan2(ahead[1], ahead[0]) + math.pi / 2
    aside = float(generator.uniform(-1.0, 1.0)) * float(corridor.width_push[k])
    radius = float(generator.uniform(*_RADIUS))
    x, y = corridor.path[k] + aside * np.array((math.cos(heading), math.sin(heading)))
    return DiscObstacle(
        x=round(float(x), 3), y=round(float(y), 3), radius=round(radius, 3), height=0.3, label="put down",
        colour="#d04090", since=round(moment, 2),
    )  # fmt: skip


def _without_one(scene: Scene, moment: float, generator: np.random.Generator) -> Scene | None:
    """Return `scene` without one of its small things from `moment` on; None if it has none."""
    small: list[BoxObstacle | DiscObstacle] = [one for one in scene.boxes if max(one.length, one.width) < _SMALL]
    small += [one for one in scene.discs if 2 * one.radius < _SMALL and one.since == 0.0]
    if not small:
        return None
    gone = small[int(generator.integers(len(small)))]
    until = round(moment, 2)

    boxes = tuple(msgspec.structs.replace(one, until=until) if one is gone else one for one in scene.boxes)
    discs = tuple(msgspec.structs.replace(one, until=until) if one is gone else one for one in scene.discs)
    return msgspec.structs.replace(scene, boxes=boxes, discs=discs)
