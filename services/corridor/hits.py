"""Where sensor beams ended, as points on the map."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from runtime.messages import LaserScan, RangeArray

Array = NDArray[np.float64]
Pose = tuple[float, float, float]

_NO_RETURN = 0.999
"""Share of the longest reading in a scan from which on a beam counts as one that met nothing."""


def of_scan(scan: LaserScan, robot: Pose, maximum: float) -> Array:
    """Return the end points (M, 2), m, map frame, of the beams that met something.

    Args:
        robot: x, y, theta, map frame, m and rad, at the time of the scan.
        maximum: m, readings from here on, and of 0, met nothing.
    """
    ranges = np.array(scan.ranges)
    bearing = np.linspace(scan.start_angle, scan.end_angle, len(ranges))
    met = (ranges > 0.0) & (ranges < _NO_RETURN * maximum)
    x = scan.pose.position.x + ranges[met] * np.cos(bearing[met])
    y = scan.pose.position.y + ranges[met] * np.sin(bearing[met])
    return _to_map(x, y, robot)


def of_ranges(ranges: RangeArray, robot: Pose) -> Array:
    """Return the end points (M, 2), m, map frame, of the sensors that saw something."""
    distance, bearing = np.array(ranges.distance), np.array(ranges.bearing)
    met = distance < _NO_RETURN * ranges.maximum
    reach = ranges.ring_radius + distance[met]
    return _to_map(reach * np.cos(bearing[met]), reach * np.sin(bearing[met]), robot)


def _to_map(x: Array, y: Array, robot: Pose) -> Array:
    c, s = math.cos(robot[2]), math.sin(robot[2])
    return np.column_stack([robot[0] + c * x - s * y, robot[1] + s * x + c * y])
