"""Which of the things that a picture shows is the object that the robot faces."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.tracker.contact import contours
from services.tracker.footprint import footprint
from services.tracker.region import Region
from services.vision.appearance import FloorModel, Picture, unlike
from services.vision.floor_view import FloorView

Array = NDArray[np.float64]


_STRAIGHT = 0.17
"""rad to either side that are straight ahead: who puts a base before an object aims no better"""


@dataclass(frozen=True)
class Sought:
    """What an object can be.

    Attributes:
        smallest, largest: m, diameter: what is larger is a wall or furniture.
        cone: rad to either side of the base's x axis within which the object is looked for at first.
        farthest: m from the base's origin to its centre, at first.
    """

    smallest: float = 0.06
    largest: float = 0.75
    cone: float = 0.5
    farthest: float = 2.7


def by_colour(view: FloorView, model: FloorModel, picture: Picture, free: Array) -> list[Region]:
    """Return what a picture, (H, W, 3) uint8 RGB, shows standing on the floor, nearest first.

    Args:
        model: how the floor looks; it learns from this picture first.
        free: (N, 2), m, base frame, points of the floor that are known to be free and that nothing hides.
    """
    others = unlike(view, model, picture, free)
    if others is None:
        return []
    found = [footprint(view, one) for one in contours(view, others)]
    return sorted(found, key=lambda one: one.nearest)


def faced(regions: list[Region], sought: Sought) -> Region | None:
    """Return the thing that the base faces, if it can be the object and all of it is seen; None: there is none.

    The nearest one straight ahead, and where nothing stands there the nearest one in the cone.
    """
    ahead = [
        one
        for one in regions
        if _fits(one, sought)
        and not one.cut
        and abs(math.atan2(one.centre[1], one.centre[0])) <= sought.cone
        and np.hypot(*one.centre) <= sought.farthest
    ]
    return min(ahead, key=lambda one: (not _straight(one), _far(one)), default=None)


def continued(regions: list[Region], sought: Sought, expected: Array, gate: float) -> Region | None:
    """Return the thing closest to where the object is expected to be, cut or not; None: none is within the gate.

    Args:
        expected: (2,), m, base frame; gate: m.
    """
    near = [one for one in regions if _fits(one, sought) and np.hypot(*(one.centre - expected)) <= gate]
    return min(near, key=lambda one: float(np.hypot(*(one.centre - expected))), default=None)


def _straight(region: Region) -> bool:
    """Return whether a thing stands straight ahead of the base."""
    x, y = (float(one) for one in region.centre)
    return abs(math.atan2(y, x)) <= _STRAIGHT or abs(y) <= region.diameter / 2.0


def _far(region: Region) -> float:
    """Return how far it is from the base's centre to a thing, m."""
    return float(np.hypot(*region.centre)) - region.diameter / 2.0


def _fits(region: Region, sought: Sought) -> bool:
    # What is cut shows less of itself than there is.
    return region.diameter <= sought.largest and (region.cut or region.diameter >= sought.smallest)
