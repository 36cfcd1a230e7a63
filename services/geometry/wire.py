"""The corridor between its message and its geometry."""

from __future__ import annotations

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
    """Return the geometry of a corridor that was found, or None of one that was not."""
    if not message.found:
        return None
    path = np.column_stack([message.path.x, message.path.y])
    clearance = np.array(message.clearance)
    return CorridorGeometry.of(path, message.start, clearance, message.robot_diameter, message.object_diameter)
