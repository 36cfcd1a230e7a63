"""How well a trajectory agrees with another, by relative displacements (Kuemmerle et al. 2009), and with its scans."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from services.geometry.pose import between, placed
from services.mapping.scan import Scan

Array = NDArray[np.float64]
Pairs = Sequence[tuple[int, int]]

REVISIT, APART = 2.0, 30.0
"""m between places that are the same again, and m of path at least since they were left"""
_GAP, _SPACING = 0.4, 0.01
"""m between ends of neighbouring beams up to which a wall is taken to be between them, and between points on it"""
_SAME = 0.3
"""m from the walls of the scan before up to which an end is taken to be of one of them"""


@dataclass(frozen=True)
class Agreement:
    """Errors of relative displacements: means and standard deviations, m and rad.

    Attributes:
        pairs: how many they are of.
    """

    pairs: int
    mean: float
    deviation: float
    mean_turn: float
    deviation_turn: float


def agreement(poses: Array, reference: Array, pairs: Pairs) -> Agreement:
    """Return how `poses` agree with `reference`, both (K, 3), over `pairs` (at least one): Eq. 2 of the paper.

    The error of a pair is that of the displacement from one to the other, in the frame of the first, so that where the
    trajectories begin plays no part.
    """
    errors = np.array([between(between(reference[i], reference[j]), between(poses[i], poses[j])) for i, j in pairs])
    place, turn = np.hypot(errors[:, 0], errors[:, 1]), np.abs(errors[:, 2])
    return Agreement(len(pairs), float(place.mean()), float(place.std()), float(turn.mean()), float(turn.std()))


def successive(count: int) -> Pairs:
    """Return each scan with the next."""
    return [(k, k + 1) for k in range(count - 1)]


def revisits(reference: Array) -> Pairs:
    """Return the pairs of scans at places that were left and come to again."""
    steps = np.hypot(*np.diff(reference[:, :2], axis=0).T)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    return [
        (i, j)
        for i in range(len(reference))
        for j in range(i + 1, len(reference))
        if way[j] - way[i] > APART and math.dist(reference[i, :2], reference[j, :2]) < REVISIT
    ]


def apart(scans: Sequence[Scan], poses: Array) -> Array:
    """Return how far the ends of each scan's beams lie from the walls that the scan before saw, (K - 1), m: medians.

    This takes no other trajectory: of two, the one that lays scans closer together has the better steps. NaN where no
    end is near such a wall.

    Args:
        scans: K of them, beams in order of their angles. poses: (K, 3).
    """
    out = np.full(len(scans) - 1, np.nan)
    for k, (first, second) in enumerate(pairwise(scans)):
        walls, ends = _walls(first), second.ends[second.returned]
        if not len(walls) or not len(ends):
            continue
        off, _ = KDTree(walls).query(placed(ends, between(poses[k], poses[k + 1])))
        if (off < _SAME).any():
            out[k] = np.median(off[off < _SAME])
    return out


def _walls(scan: Scan) -> Array:
    """Return points along the walls between ends of neighbouring beams, (N, 2), m, base frame."""
    ends = scan.ends[scan.returned]
    steps = np.diff(ends, axis=0)
    wall = np.hypot(*steps.T) < _GAP
    shares = np.linspace(0.0, 1.0, round(_GAP / _SPACING), endpoint=False)
    return np.asarray((ends[:-1][wall][:, None] + shares[:, None] * steps[wall][:, None]).reshape(-1, 2))
