"""How well a scan agrees with a map at a pose, and the pose near another at which it agrees best."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from services.mapping.grid import HITS, MEAN_X, MEAN_Y, OCCUPIED, RESOLUTION, SIDE, VISITS, Indices, Tiles

Array = NDArray[np.float64]

BEFORE = 1.6 * RESOLUTION
"""m before a beam's end that are to be free"""
_NEW = 4.0
"""squared deviations that a beam counts as off where no beam has been: what comes into sight is not drawn towards what
is known beside it, which would hold the robot back"""
_RANDOM = 0.02
"""share of beams that end anywhere: what moves, what is not mapped yet"""


@njit("i8(f4[:,:,:,::1],i4[:,::1],i8,i8)", cache=True)
def occupied(cells: Tiles, index: Indices, i: int, j: int) -> int:
    """Return the tile that the cell (i, j) is in if something is there, else -1."""
    if i < 0 or j < 0 or i >= index.shape[1] * SIDE or j >= index.shape[0] * SIDE:
        return -1
    tile = index[j // SIDE, i // SIDE]
    if tile < 0:
        return -1
    cell = cells[tile, j % SIDE, i % SIDE]
    return tile if cell[VISITS] > 0.0 and cell[HITS] >= OCCUPIED * cell[VISITS] else -1


@njit("b1(f4[:,:,:,::1],i4[:,::1],i8,i8)", cache=True)
def _visited(cells: Tiles, index: Indices, i: int, j: int) -> bool:
    """Return whether a beam has been in the cell (i, j)."""
    if i < 0 or j < 0 or i >= index.shape[1] * SIDE or j >= index.shape[0] * SIDE:
        return False
    tile = index[j // SIDE, i // SIDE]
    return tile >= 0 and cells[tile, j % SIDE, i % SIDE, VISITS] > 0.0


@njit("f8(f4[:,:,:,::1],i4[:,::1],i8,i8,f8[::1],f8[:,::1],f8[::1],f8)", cache=True)
def agreement(
    cells: Tiles, index: Indices, corner_x: int, corner_y: int, pose: Array, ends: Array, start: Array,
    sigma: float,
) -> float:  # fmt: skip
    """Return the log-likelihood of a scan, up to a constant: the mean over its beams, at most 0.

    A beam agrees by the distance of its end from the closest mean of ends in the nine cells around it, of those
    before which the beam comes through free ones (Grisetti's GMapping).

    Args:
        pose: (3,), of the base; ends: (N, 2), m, base frame; start: (2,), the sensor there.
        sigma: m.
    """
    x0, y0 = corner_x * SIDE * RESOLUTION, corner_y * SIDE * RESOLUTION
    c, s = math.cos(pose[2]), math.sin(pose[2])
    ox, oy = pose[0] + c * start[0] - s * start[1], pose[1] + s * start[0] + c * start[1]
    total = 0.0
    for k in range(len(ends)):
        ex = pose[0] + c * ends[k, 0] - s * ends[k, 1]
        ey = pose[1] + s * ends[k, 0] + c * ends[k, 1]
        dx, dy = ex - ox, ey - oy
        length = math.sqrt(dx * dx + dy * dy) + 1e-9
        i, j = int((ex - x0) / RESOLUTION), int((ey - y0) / RESOLUTION)
        bi = int((ex - dx / length * BEFORE - x0) / RESOLUTION) - i
        bj = int((ey - dy / length * BEFORE - y0) / RESOLUTION) - j
        best = np.inf if _visited(cells, index, i, j) else _NEW * sigma * sigma
        for dj in range(-1, 2):
            for di in range(-1, 2):
                u, v = i + di, j + dj
                tile = occupied(cells, index, u, v)
                if tile < 0:
                    continue
                cell = cells[tile, v % SIDE, u % SIDE]
                mx, my = cell[MEAN_X] - ex, cell[MEAN_Y] - ey
                off = mx * mx + my * my
                if off < best and occupied(cells, index, u + bi, v + bj) < 0:
                    best = off
        total += math.log(_RANDOM + (1.0 - _RANDOM) * math.exp(-0.5 * best / (sigma * sigma)))
    return total / max(len(ends), 1)


@njit("f8(f8[::1],f8[::1],f8[:,::1])", cache=True)
def prior(pose: Array, expected: Array, information: Array) -> float:
    """Return the logarithm of a Gaussian at `pose`, (3,), around `expected`, up to a constant."""
    d = np.empty(3)
    d[0], d[1] = pose[0] - expected[0], pose[1] - expected[1]
    d[2] = (pose[2] - expected[2] + math.pi) % (2.0 * math.pi) - math.pi
    total = 0.0
    for a in range(3):
        for b in range(3):
            total -= 0.5 * d[a] * information[a, b] * d[b]
    return total


@njit(
    "f8(f4[:,:,:,::1],i4[:,::1],i8,i8,f8[::1],f8[:,::1],f8[::1],f8,f8,f8[::1],f8[:,::1])",
    cache=True,
)
def belief(
    cells: Tiles, index: Indices, corner_x: int, corner_y: int, pose: Array, ends: Array, start: Array,
    sigma: float, weight: float, expected: Array, information: Array,
) -> float:  # fmt: skip
    """Return the logarithm, up to a constant, of what scan and odometry together make of `pose`.

    Args:
        weight: independent beams that a scan is worth: neighbours are not independent.
        expected, information: (3,) and (3, 3), the odometry's Gaussian.
    """
    scan = agreement(cells, index, corner_x, corner_y, pose, ends, start, sigma)
    return weight * scan + prior(pose, expected, information)


@njit(
    "f8(f4[:,:,:,::1],i4[:,::1],i8,i8,f8[::1],f8[:,::1],f8[::1],f8,f8,f8[::1],f8[:,::1],f8,f8,i8)",
    cache=True,
)
def climb(
    cells: Tiles, index: Indices, corner_x: int, corner_y: int, pose: Array, ends: Array, start: Array,
    sigma: float, weight: float, expected: Array, information: Array,
    step: float, turn: float, halvings: int,
) -> float:  # fmt: skip
    """Change `pose` to where the belief is highest nearby, and return the belief there.

    The best of six steps is taken while there is a better one; then they are halved.

    Args:
        step, turn: m and rad, at first.
    """
    best = belief(cells, index, corner_x, corner_y, pose, ends, start, sigma, weight, expected, information)
    tried, taken = np.empty(3), np.empty(3)
    for _ in range(halvings):
        for _ in range(40):
            found = best
            for way in range(6):
                tried[:] = pose
                tried[way // 2] += (turn if way // 2 == 2 else step) * (1.0 if way % 2 else -1.0)
                value = belief(
                    cells, index, corner_x, corner_y, tried, ends, start, sigma, weight, expected, information
                )
                if value > found:
                    found = value
                    taken[:] = tried
            if found <= best:
                break
            best = found
            pose[:] = taken
        step *= 0.5
        turn *= 0.5
    return best


def likelihood_field(shown: NDArray[np.uint8], sigma: float) -> Tiles:
    """Return exp(-d^2 / (2 sigma^2)) of the distance d to the closest occupied cell, (H, W), float32.

    Args:
        shown: (H, W), 100 where occupied.
        sigma: m.
    """
    distance = cv2.distanceTransform((shown != 100).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.exp(-0.5 * (distance * (RESOLUTION / sigma)) ** 2)


@njit("f8(f4[:,::1],f8[::1],f8[::1],f8,f8)", cache=True)
def _total(field: Tiles, px: Array, py: Array, ox: float, oy: float) -> float:
    """Return the sum of the field over points, (N,) and (N,), moved by (ox, oy), all in cells; 0 beyond the field."""
    h, w = field.shape
    total = 0.0
    for k in range(len(px)):
        fx, fy = px[k] + ox, py[k] + oy
        if 0.0 <= fx < w and 0.0 <= fy < h:
            total += field[int(fy), int(fx)]
    return total


@njit("void(f4[:,::1],f8,f8,f8[::1],f8[:,::1],f8,f8[::1],f8[:,::1],f8,i8,f8,i8)", cache=True)
def search(
    field: Tiles, x0: float, y0: float, pose: Array, ends: Array, weight: float, expected: Array, information: Array,
    step: float, steps: int, turn: float, turns: int,
) -> None:  # fmt: skip
    """Change `pose` to where the belief is highest among all poses of a lattice around it (Olson 2009).

    Args:
        field: (H, W), see `likelihood_field`; x0, y0: m, its corner.
        step, turn: m and rad; steps, turns: of them to either side.
    """
    best, origin, tried = -np.inf, pose.copy(), np.empty(3)
    px, py = np.empty(len(ends)), np.empty(len(ends))
    for a in range(-turns, turns + 1):
        tried[2] = origin[2] + a * turn
        c, s = math.cos(tried[2]), math.sin(tried[2])
        for k in range(len(ends)):
            px[k] = (c * ends[k, 0] - s * ends[k, 1] - x0) / RESOLUTION
            py[k] = (s * ends[k, 0] + c * ends[k, 1] - y0) / RESOLUTION
        for b in range(-steps, steps + 1):
            tried[0] = origin[0] + b * step
            for d in range(-steps, steps + 1):
                tried[1] = origin[1] + d * step
                ox, oy = tried[0] / RESOLUTION, tried[1] / RESOLUTION
                total = _total(field, px, py, ox, oy)
                value = weight * total / max(len(ends), 1) + prior(tried, expected, information)
                if value > best:
                    best = value
                    pose[:] = tried


@njit("f8[:,::1](f4[:,::1],f8,f8,f8[:,::1],f8[:,::1],f8[::1])", cache=True)
def everywhere(field: Tiles, x0: float, y0: float, places: Array, ends: Array, headings: Array) -> Array:
    """Return how well a scan fits at every place and heading, (P, A): the mean of the field over its ends, 0 to 1.

    Args:
        field: see `likelihood_field`; x0, y0: m, its corner.
        places: (P, 2), m; headings: (A,), rad.
    """
    out = np.zeros((len(places), len(headings)))
    px, py = np.empty(len(ends)), np.empty(len(ends))
    for a in range(len(headings)):
        c, s = math.cos(headings[a]), math.sin(headings[a])
        for k in range(len(ends)):
            px[k] = (c * ends[k, 0] - s * ends[k, 1] - x0) / RESOLUTION
            py[k] = (s * ends[k, 0] + c * ends[k, 1] - y0) / RESOLUTION
        for p in range(len(places)):
            total = _total(field, px, py, places[p, 0] / RESOLUTION, places[p, 1] / RESOLUTION)
            out[p, a] = total / max(len(ends), 1)
    return out
