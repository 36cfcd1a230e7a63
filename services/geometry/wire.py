"""The corridor between its message and its geometry."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from runtime.messages import Corridor, Polyline, Vector2
from services.geometry.corridor import CorridorGeometry


def vector(point: Vector2) -> NDArray[np.float64]:
    """Return `point` as (2,) float64."""
    return np.array((point.x, point.y))


def polyline(points: NDArray[np.float64]) -> Polyline:
    """Return `points` (N, 2) as a message."""
    return Polyline(x=points[:, 0].tolist(), y=points[:, 1].tolist())


def geometry(message: Corridor) -> CorridorGeometry | None:
    """Return the geometry of a corridor that was found, or None of one that was not. It is shared: do not change it."""
    if not message.found:
        return None
    return _geometry(
        np.column_stack([message.path.x, message.path.y]).tobytes(),
        np.array(message.clearance).tobytes(),
        message.start,
        message.robot_diameter,
        message.object_diameter,
    )


@lru_cache(maxsize=8)
def _geometry(path: bytes, clearance: bytes, start: int, d_r: float, d_o: float) -> CorridorGeometry:
    # Building the field takes 2 ms, and four services in one process want it, again after each snapshot.
    points = np.frombuffer(path).reshape(-1, 2)
    return CorridorGeometry.of(points.copy(), start, np.frombuffer(clearance).copy(), d_r, d_o)
