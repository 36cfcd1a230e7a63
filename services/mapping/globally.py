"""Finds where a scan was taken on a known map, from nothing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from services.geometry.pose import placed
from services.mapping.grid import RESOLUTION, Maps
from services.mapping.matching import agreement, climb, everywhere, likelihood_field
from services.mapping.scan import Scan

Array = NDArray[np.float64]

_COARSE, _MIDDLE, _FINE = 0.25, 0.12, 0.05
"""m, deviations of beams' ends over all places, nearby, and in the match"""
_APART, _TURN = 0.2, np.pi / 36
"""m and rad between the poses that are tried"""
_KEPT = 200
"""poses that are looked at more closely"""
_BEAMS = (60, 180)
"""beams that are looked at over all places, and in the match"""
_EXPLAINED = 2
"""cells from what stands on the map within which a beam ends at it"""
_ALONE = 0.3
"""m within which two poses are one"""


def locate(maps: Maps, scan: Scan, count: int = 1) -> tuple[Array, Array]:
    """Return the poses at which `scan` fits best, (N, 3), best first, and how well, (N,), at most 0; N <= `count`.

    Args:
        maps: of which the first particle's is searched, wherever it is free.
    """
    shown, corner = maps.picture(0)
    rows, columns = np.nonzero(shown == 0)
    every = max(1, round(_APART / RESOLUTION))
    chosen = (rows % every == 0) & (columns % every == 0)
    if not chosen.any():
        chosen[:] = True
    places = corner + (np.column_stack([columns, rows])[chosen] + 0.5) * RESOLUTION
    headings = np.arange(0.0, 2.0 * np.pi, _TURN)
    if not len(places) or not scan.returned.any():
        return np.empty((0, 3)), np.empty(0)
    few, many = scan.thinned(_BEAMS[0]), scan.thinned(_BEAMS[1])
    fits = everywhere(likelihood_field(shown, _COARSE), *corner, places, few, headings)
    order = np.argsort(-fits, axis=None, kind="stable")[:_KEPT]
    seen = (maps.cells, maps.index[0], *maps.corner)
    anywhere = np.zeros((3, 3))
    found: list[tuple[float, Array]] = []
    for one in order:
        place, heading = np.unravel_index(one, fits.shape)
        pose = np.array([*places[place], headings[heading]])
        for sigma, step, turn in ((_MIDDLE, 0.08, 0.04), (_FINE, 0.02, 0.01)):
            climb(*seen, pose, many, scan.start, sigma, 1.0, pose.copy(), anywhere, step, turn, 4)
        found.append((agreement(*seen, pose, many, scan.start, _FINE), pose))
    found.sort(key=lambda one: -one[0])
    apart: list[tuple[float, Array]] = []
    for value, pose in found:
        if all(np.hypot(*(pose - other)[:2]) > _ALONE for _, other in apart):
            apart.append((value, pose))
    return np.array([pose for _, pose in apart[:count]]), np.array([value for value, _ in apart[:count]])


def explained(maps: Maps, scan: Scan, pose: Array) -> float:
    """Return the share of a scan's beams that end where the first particle's map has something, to two cells, 0 to 1.

    Args:
        pose: (3,), of the base. 0 where no beam meets anything.
    """
    ends = scan.ends[scan.returned]
    return float(maps.stands(0, placed(ends, pose), _EXPLAINED).mean()) if len(ends) else 0.0
