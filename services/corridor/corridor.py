"""Finds the pushing corridor on a map: the path Q, its clearances C and widths (Sec. 3.1)."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from services.corridor.clearance import Cells, Clearance, measure
from services.corridor.shortest_path import SPACING, GoalBlocked, PlanningError, Room, cost_along, find
from services.corridor.smoothing import SLACK
from services.geometry.corridor import CorridorGeometry
from services.geometry.field import depth
from services.geometry.path import resample

__all__ = ["CorridorGeometry", "build"]

Array = NDArray[np.float64]

LEAD_IN_MARGIN = 0.1
"""m inside the corridor from o to g at which the robot needs no lead-in."""

STANDING, STANDING_REACH = 0.05, 0.2
"""m of width that the pushing corridor has at least where robot and object stand, and m around them, on a map that
sensors made: it is off by up to a cell, and they stand there without touching anything. Not in the paper."""

_BETTER = 0.8
"""Share of the cost of a known way that another may cost to be taken: else two that are alike would take turns."""

_HARDLY = 0.02
_COMFORT_MARGIN = 0.2
_OBJECT_ESCAPE = 0.4
"""m around an object that stands closer to an obstacle than the path needs, in which no more room is asked for"""
_ROBOT_ESCAPE = 0.3


def build(
    cells: Cells, resolution: float, origin: Array, r: Array, o: Array, g: Array, d_r: float, d_o: float,
    *, weight: float = 3.0, cap: float = 1.5, object_margin: float = 0.05,
    spare: float = 0.0, apart: bool = False, doubtful: NDArray[np.bool_] | None = None,
    known: Array | None = None,
) -> CorridorGeometry:  # fmt: skip
    """Return the corridor from `o` to `g`, with a lead-in from `r` where the robot stands outside of it.

    The robot starts behind the object, where the union of discs along o-g need not reach. So Q begins with a
    collision-free path from r to o, unless the robot is at least LEAD_IN_MARGIN inside without. Not in the
    paper, which leaves open how the robot's start is within the corridor.

    Args:
        cells: (H, W) uint8, row y first; 0 free, 100 occupied, 255 unknown.
        resolution: m per cell.
        origin: (2,), m, map frame, the outer corner of cell (0, 0).
        r, o, g: (2,), m, map frame: robot, object, goal.
        d_r, d_o: m, diameters of the robot and of the object's bounding circle.
        weight: how much the path keeps away from obstacles where there is room; 0 is the shortest path.
        cap: m, clearances beyond this count as this. A corridor in a hall stays a corridor, and obstacles that
            are far away do not change it.
        object_margin: m around the object's bounding circle within which occupied cells are the object.
        spare: m of clearance beyond what is needed that the path keeps if any way has it: a map that is off by
            centimetres, and still grows, moves the edges of a tight passage under a robot that is in it.
        apart: the map has neither object nor robot: whatever is near them is an obstacle. Else a wall beside the object
            would be taken for the object, and the path led through it.
        doubtful: (H, W), whether a cell is only taken to be free, since nobody has seen it: a metre through it costs as
            much as one through the narrowest passage. The corridor is as wide as if it were free.

        known: (N, 2), m, map frame, a way that ends in g and begins near o: it is kept while it is roomy enough, unless
            another costs clearly less.

    Raises:
        services.corridor.clearance.BadGrid: the grid cannot be used.
        services.corridor.shortest_path.PlanningError: GoalBlocked, StartBlocked or NoPath.
    """
    discs = np.array([[o[0], o[1], 0.5 * d_o + object_margin], [r[0], r[1], 0.5 * d_r]])
    # Even on a map without the robot a wall may be a cell too thick; the robot stands there, so it is not in a wall.
    clearance = measure(cells, resolution, origin, discs[1:] if apart else discs)
    need = 0.5 * max(d_r, d_o)
    comfort = max(min(d_r + d_o + _COMFORT_MARGIN, cap), need + _COMFORT_MARGIN)
    room = Room(need, comfort, weight, escape=_OBJECT_ESCAPE if apart else 0.0)
    path = _roomiest(clearance, o, g, room, spare, doubtful)
    if known is not None:
        path = _steady(clearance, path, np.vstack([o, known]), room, spare, doubtful)
    width = np.minimum(clearance.along(path), cap) - 0.5 * d_r
    start = 0
    if depth(r[0], r[1], path, width) < LEAD_IN_MARGIN:
        lead_in = _lead_in(clearance, r, o, d_r, weight)
        start = len(lead_in) - 1
        path = np.vstack([lead_in[:-1], path])
    found = np.minimum(clearance.along(path), cap)
    if apart:
        near = np.minimum(np.hypot(*(path - r).T), np.hypot(*(path - o).T)) <= STANDING_REACH
        found[near] = np.maximum(found[near], 0.5 * d_r + STANDING)
    return CorridorGeometry.of(path, start, found, d_r, d_o)


def _roomiest(
    clearance: Clearance, o: Array, g: Array, room: Room, spare: float, doubtful: NDArray[np.bool_] | None
) -> Array:
    """Return the path with `spare` m more clearance than needed, or where there is none, without.

    If there is none then, one through what is as much too tight as a map of sensors may be off.
    """
    refused = PlanningError()
    for more in (spare, 0.0, -STANDING) if spare > 0.0 else (0.0,):
        try:
            asked = room.with_spare(more)
            return find(_doubted(clearance, doubtful, asked.need), o, g, asked)
        except PlanningError as error:
            refused = error if more == 0.0 else refused
    raise refused


def _steady(
    clearance: Clearance, path: Array, known: Array, room: Room, spare: float, doubtful: NDArray[np.bool_] | None
) -> Array:
    """Return the known way, or `path` if that is clearly better, or the known one has become tight."""
    known = resample(known, SPACING)
    roomy = room.with_spare(spare)
    way = _doubted(clearance, doubtful, roomy.need)
    far = np.hypot(*(known - known[0]).T) > room.escape
    if (way.along(known[far]) < roomy.need - SLACK).any() or not (clearance.along(known) > 0.5 * room.need).all():
        return path
    return path if cost_along(way, path, roomy) < _BETTER * cost_along(way, known, roomy) else known


def _doubted(clearance: Clearance, doubtful: NDArray[np.bool_] | None, need: float) -> Clearance:
    """Return clearances that are hardly above `need`, m, where a cell is doubtful; as they are if none is."""
    if doubtful is None:
        return clearance
    ny, nx = doubtful.shape
    there = np.zeros(clearance.values.shape, np.bool_)
    for j in range(3):
        for i in range(3):
            there[j : j + 2 * ny - 1 : 2, i : i + 2 * nx - 1 : 2] |= doubtful
    values = np.where(there, np.minimum(clearance.values, need + _HARDLY), clearance.values)
    return replace(clearance, values=values)


def _lead_in(clearance: Clearance, r: Array, o: Array, d_r: float, weight: float) -> Array:
    """Return a path for the robot alone from `r` to `o`. It may start tight: the robot does stand there."""
    room = Room(0.5 * d_r, 0.5 * d_r + _COMFORT_MARGIN, weight, escape=_ROBOT_ESCAPE)
    try:
        try:
            return find(clearance, r, o, room)
        except GoalBlocked:
            # An object beside a wall: the end may be tight then, and not the start; or both, by what a map may be off.
            with suppress(GoalBlocked):
                return find(clearance, o, r, room)[::-1]
            return find(clearance, o, r, room.with_spare(-STANDING))[::-1]
    except PlanningError as error:
        raise type(error)(f"from the robot to the object: {error}") from error
