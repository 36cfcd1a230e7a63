"""What plans and the law need to know of corridor, base and object, from the messages that say it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from runtime.messages import PushResponse, RobotStatus
from services.geometry.corridor import CorridorGeometry
from services.geometry.path import resample
from services.predictive.model import ACCELERATION, BASE, LAG, RADIUS, prior_contour, prior_response

Array = NDArray[np.float64]

SPACING = 0.05
"""m between the points of a lane"""


@dataclass(frozen=True)
class Lane:
    """A corridor's path, evenly spaced from the object's start to the goal, with its half widths W_p."""

    path: Array
    width: Array

    def nearest(self, x: float, y: float) -> int:
        """Return the index of the point of the path closest to (x, y)."""
        return int(np.argmin(np.hypot(self.path[:, 0] - x, self.path[:, 1] - y)))

    @classmethod
    def of(cls, corridor: CorridorGeometry) -> Lane:
        """Return the lane of `corridor`."""
        own = corridor.path[corridor.start :]
        path = resample(own, SPACING)
        arc = corridor.arc[corridor.start :] - corridor.arc[corridor.start]
        width = np.interp(SPACING * np.arange(len(path)), arc, corridor.width_push[corridor.start :])
        return cls(path, width)


def base_of(status: RobotStatus) -> Array:
    """Return the base's numbers for the model, (BASE,)."""
    base = np.empty(BASE)
    base[ACCELERATION], base[LAG], base[RADIUS] = status.limits.acceleration, status.limits.lag, 0.5 * status.diameter
    return base


def known(message: PushResponse | None, robot_diameter: float, object_diameter: float) -> tuple[Array, Array]:
    """Return contour and response as learned, or as they are before anything is."""
    if message is None:
        return prior_contour(robot_diameter, object_diameter), prior_response(object_diameter)
    return np.array(message.contour), np.array(message.response)
