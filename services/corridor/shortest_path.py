"""The path Q: the cheapest collision-free way from the object to the goal (Sec. 3, 6.1).

A metre costs 1 where there is room enough and more near obstacles, so that Q keeps away from walls where it
can, and passes through narrow places where it must.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from services.corridor.clearance import Clearance
from services.corridor.dijkstra import cheapest, places, widest
from services.corridor.smoothing import SLACK, line_cost, relax, shortcut
from services.geometry.path import resample

Array = NDArray[np.float64]

SPACING = 0.05
"""m between the points of Q (Sec. 6.1)."""

_SWEEPS = 60
_APART = 1e-3


class PlanningError(Exception):
    """There is no path. The message says why."""


class GoalBlocked(PlanningError):
    """The goal is in an obstacle or too near to one."""


class StartBlocked(PlanningError):
    """The start is in an obstacle or too near to one."""


class NoPath(PlanningError):
    """Start and goal are free, but no way between them is wide enough."""


@dataclass(frozen=True, slots=True)
class Room:
    """What the path asks of the clearance."""

    need: float
    """m, least clearance: half the diameter of the larger body"""
    comfort: float
    """m, clearance from which on more room is no better; above `need`"""
    weight: float = 3.0
    """extra cost of a metre at clearance `need`; it falls to 0 at `comfort` with the square"""
    escape: float = 0.0
    """m around the start within which the start's own clearance is enough, if less than `need`"""

    def with_spare(self, spare: float) -> Room:
        """Return what asks for `spare` m more of everything."""
        return replace(self, need=self.need + spare, comfort=self.comfort + spare)


def find(clearance: Clearance, start: Array, goal: Array, room: Room) -> Array:
    """Return Q (N, 2), m, map frame, from `start` to `goal` ((2,), both exact), points at most 0.05 m apart.

    Its clearance is nowhere more than 5 mm below `room.need`, save near the start where `room.escape` says so.

    Raises:
        GoalBlocked, StartBlocked, NoPath: with the clearances found and needed.
    """
    need = room.need
    if np.hypot(*(goal - start)) < _APART:
        raise NoPath(f"start and goal coincide at ({goal[0]:.2f}, {goal[1]:.2f}) m")
    at_goal, at_start = clearance.at(goal[0], goal[1]), clearance.at(start[0], start[1])
    if at_goal < need:
        raise GoalBlocked(_tight("goal", goal, clearance, need))
    if at_start < need and not (room.escape > 0.0 and at_start > 0.0):
        raise StartBlocked(_tight("start", start, clearance, need))
    values, spacing, (x0, y0) = clearance.values, clearance.spacing, clearance.origin
    nx = (values.shape[1] - 1) // 2
    a, b = (_node(clearance, point) for point in (start, goal))
    xs, ys, cs = places(values, spacing, need, start[0] - x0, start[1] - y0, room.escape, min(need, at_start))
    cost, nodes = cheapest(xs, ys, cs, nx, a, b, need, room.comfort, room.weight)
    if not np.isfinite(cost):
        raise NoPath(_narrow(clearance, start, goal, need))
    inner = np.column_stack([xs[nodes] + x0, ys[nodes] + y0])[1:-1]
    raw = _distinct(np.vstack([start, inner[::2], goal]))
    grid = (values, x0, y0, spacing)
    wish = (need, room.comfort, room.weight)
    straight = resample(shortcut(*grid, raw, *wish), SPACING)
    for candidate in (resample(relax(*grid, straight, *wish, _SWEEPS), SPACING), straight):
        if _fits(clearance, candidate, start, room, at_start):
            return candidate
    return resample(_distinct(np.vstack([start, inner, goal])), SPACING)


def cost_along(clearance: Clearance, path: Array, room: Room) -> float:
    """Return what a path, (N, 2), m, map frame, costs; where it is too tight, as at the least clearance."""
    corners = [(float(x), float(y)) for x, y in path]
    grid = (clearance.values, clearance.origin[0], clearance.origin[1], clearance.spacing)
    wish = (room.need, room.comfort, room.weight)
    return sum(line_cost(*grid, *a, *b, *wish, True) for a, b in pairwise(corners))


def _fits(clearance: Clearance, path: Array, start: Array, room: Room, at_start: float) -> bool:
    dense = resample(path, 0.5 * SPACING)
    enough = np.full(len(dense), room.need)
    if at_start < room.need:
        near = np.hypot(*(dense - start).T) <= room.escape + SPACING
        enough[near] = at_start
    return bool((clearance.along(dense) >= enough - SLACK).all())


def _node(clearance: Clearance, point: Array) -> int:
    ny, nx = ((n - 1) // 2 for n in clearance.values.shape)
    i, j = ((point - clearance.origin) // (2.0 * clearance.spacing)).astype(int)
    return int(min(j, ny - 1) * nx + min(i, nx - 1))


def _distinct(path: Array) -> Array:
    """Return `path` without inner points that coincide with the point after or, like the last, before it."""
    keep = np.ones(len(path), np.bool_)
    keep[1:-1] = np.hypot(*np.diff(path[:-1], axis=0).T) > 1e-9
    keep[1:-1] &= np.hypot(*(path[1:-1] - path[-1]).T) > 1e-9
    return np.ascontiguousarray(path[keep])


def _tight(name: str, point: Array, clearance: Clearance, need: float) -> str:
    """Say why a body cannot stand at `point`, (2,), m, map frame."""
    place, found = f"{name} ({point[0]:.2f}, {point[1]:.2f}) m", clearance.at(point[0], point[1])
    needed = f"{need:.3f} m are needed for a diameter of {2 * need:.3f} m"
    (x0, y0), (ny, nx) = clearance.origin, clearance.values.shape
    x1, y1 = x0 + (nx - 1) * clearance.spacing, y0 + (ny - 1) * clearance.spacing
    if found < 0.0:
        return (
            f"{place} is outside of the map, which has x from {x0:.2f} to {x1:.2f} m and y from {y0:.2f} to {y1:.2f} m"
        )
    if found == 0.0:
        return f"{place} is in an obstacle, or where nothing is known; {needed}"
    return f"{place} is {found:.3f} m from the nearest obstacle; {needed}"


def _narrow(clearance: Clearance, start: Array, goal: Array, need: float) -> str:
    ends = f"from ({start[0]:.2f}, {start[1]:.2f}) to ({goal[0]:.2f}, {goal[1]:.2f}) m"
    nx = (clearance.values.shape[1] - 1) // 2
    # Endless need puts every place at the roomiest point of its cell, endless escape admits them all.
    _, _, cs = places(clearance.values, clearance.spacing, np.inf, 0.0, 0.0, np.inf, 0.0)
    found = widest(cs, nx, _node(clearance, start), _node(clearance, goal))
    if found <= 0.0:
        return f"no way {ends}: obstacles part them"
    return f"no way {ends} for a diameter of {2 * need:.3f} m: the widest one takes {2 * found:.3f} m"
