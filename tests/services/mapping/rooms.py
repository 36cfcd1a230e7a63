"""A room to be mapped: what a laser would measure in it, by where its beams cross the walls."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from services.mapping.scan import Scan

Array = NDArray[np.float64]

# An L, 6 m by 4 m, with a pillar: nothing in it is symmetric.
WALLS = np.array(
    [
        [(0.0, 0.0), (6.0, 0.0)], [(6.0, 0.0), (6.0, 4.0)], [(6.0, 4.0), (2.5, 4.0)], [(2.5, 4.0), (2.5, 2.8)],
        [(2.5, 2.8), (0.0, 2.8)], [(0.0, 2.8), (0.0, 0.0)],
        [(4.2, 2.2), (4.6, 2.2)], [(4.6, 2.2), (4.6, 2.7)], [(4.6, 2.7), (4.2, 2.7)], [(4.2, 2.7), (4.2, 2.2)],
    ]
)  # fmt: skip
ANGLES = np.linspace(-math.pi, math.pi, 360, endpoint=False)
ROUND = [(0.8, 0.8), (3.4, 0.8), (5.2, 1.0), (5.2, 3.2), (3.4, 3.2), (3.4, 1.4), (0.8, 1.6), (0.8, 0.8)]
"""m, places on a round through the room"""
MOUNT = np.array([0.1, 0.0, 0.0])


def ranges_at(pose: Array, walls: Array = WALLS) -> Array:
    """Return what the laser measures, (360,), m, with the base at `pose`, (3,): the nearest crossing of each beam."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    origin = pose[:2] + np.array([c * MOUNT[0], s * MOUNT[0]])
    bearing = ANGLES + pose[2]
    d = np.column_stack([np.cos(bearing), np.sin(bearing)])[:, None, :]
    a, e = walls[None, :, 0] - origin, walls[:, 1] - walls[:, 0]
    cross = d[..., 0] * e[:, 1] - d[..., 1] * e[:, 0]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        along = (a[..., 0] * e[:, 1] - a[..., 1] * e[:, 0]) / cross
        place = (a[..., 0] * d[..., 1] - a[..., 1] * d[..., 0]) / cross
    good = (along > 0.0) & (place >= 0.0) & (place <= 1.0)
    return np.where(good, along, np.inf).min(axis=1)


def scan_at(pose: Array, noise: float = 0.0, generator: np.random.Generator | None = None) -> Scan:
    """Return the scan at `pose`, with noise of so many m."""
    ranges = ranges_at(pose)
    if generator is not None:
        ranges = ranges + noise * generator.standard_normal(len(ranges))
    return Scan.of(ranges, ANGLES, MOUNT, 20.0, 79.0)
