"""How well a trajectory agrees with another: by relative displacements (Kuemmerle et al. 2009)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.geometry.pose import between

Array = NDArray[np.float64]
Pairs = Sequence[tuple[int, int]]

REVISIT, APART = 2.0, 30.0
"""m between places that are the same again, and m of path at least since they were left"""


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
