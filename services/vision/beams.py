"""Where the floor is, as the laser says: what its beams pass over is floor, and how it looks can be learned there."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from runtime.messages import LaserScan

Array = NDArray[np.float64]

_FREE, _CLEAR = (0.2, 3.0, 0.1), 0.25
"""m from the laser: first, last and between the places where the floor is looked at; m before what a beam met"""


def passed(scan: LaserScan | None, aside: int = 0) -> Array:
    """Return places on the floor, (N, 2), m, base frame, that beams pass over, 3 m out at most.

    Args:
        scan: None: there are no such places.
        aside: beams to both sides of one that have to pass as far as it: what one hides from the camera, which looks
            from elsewhere, is not taken for floor.
    """
    if scan is None or not scan.ranges:
        return np.empty((0, 2))
    ranges = np.array(scan.ranges)
    angles = np.linspace(scan.start_angle, scan.end_angle, len(ranges))
    turned = scan.pose.orientation
    angles = angles + 2.0 * math.atan2(turned.z, turned.w)
    if aside:
        padded = np.pad(ranges, aside, mode="edge")
        ranges = np.lib.stride_tricks.sliding_window_view(padded, 2 * aside + 1).min(axis=1)
    far = np.arange(_FREE[0], _FREE[1], _FREE[2])
    reach, bearing = np.meshgrid(far, angles, indexing="ij")
    inside = reach < ranges[None, :] - _CLEAR
    start = np.array((scan.pose.position.x, scan.pose.position.y))
    return np.asarray(start + np.column_stack([(reach * np.cos(bearing))[inside], (reach * np.sin(bearing))[inside]]))
