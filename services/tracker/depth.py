"""Things that stand on a floor or table, from a picture of depths.

What rises from the plane is put into pieces by walking from pixel to pixel as long as the places on the plane below
stay close; of each piece the smallest circle around its footprint is taken. A camera that looks down sees the tops of
things, so that their far sides are seen as well; of what is higher than the camera only the near side is.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numba import njit
from numpy.typing import NDArray

from services.tracker.circle import smallest_circle
from services.tracker.region import Region, along_and_across
from services.vision.plane import NOISE, Plane, deviation
from services.vision.rising import LOWEST, DepthEye

Array = NDArray[np.float64]
Labels = NDArray[np.int32]

HIGHEST = 1.0
"""m above the plane"""
GAP = 0.015
"""m on the plane that a thing may have between two pixels, beside what a pixel covers"""
FEWEST = 40
"""pixels of a thing"""
_NEIGHBOURS = 3
"""neighbours that a pixel must have in its piece to count for the footprint: at edges depths are mixed"""


def things(eye: DepthEye, depth: Array, plane: Plane) -> list[Region]:
    """Return what stands on the plane, in the plane's coordinates, nearest first.

    Args:
        depth: (H, W), m, along the camera's axis; 0 or NaN: nothing measured.
    """
    height, x, y, labels = pieces(eye, depth, plane)
    shown = np.flatnonzero(labels)
    order = shown[np.argsort(labels.flat[shown], kind="stable")]
    starts = np.searchsorted(labels.flat[order], np.arange(1, labels.max(initial=0) + 2))
    found = []
    for first, last in pairwise(starts):
        if last - first < FEWEST:
            continue
        at = order[first:last]
        v, u = np.divmod(at, depth.shape[1])
        cut = u.min() == 0 or v.min() == 0 or u.max() == depth.shape[1] - 1 or v.max() == depth.shape[0] - 1
        footprint = np.column_stack([x.flat[at], y.flat[at]])
        centre, diameter = smallest_circle(footprint)
        # The circle rests on its outermost pixels: it is known as well as one of these.
        far = float(np.median(depth.flat[at]))
        pixel = far / eye.camera.matrix[0, 0]
        sigma = float(deviation(np.array(far)))
        away = footprint - plane.origin
        covariance = along_and_across(centre - plane.origin, np.hypot(pixel, 2.0 * sigma), np.hypot(pixel, sigma))
        found.append(
            Region(
                centre, diameter, covariance, float(np.hypot(*away.T).min()),
                0.0, float(height.flat[at].max()),
                len(at), bool(cut),
            )
        )  # fmt: skip
    return sorted(found, key=lambda one: one.nearest)


def pieces(eye: DepthEye, depth: Array, plane: Plane) -> tuple[Array, Array, Array, Labels]:
    """Return for each pixel its height, m, its place (x, y), m, on the plane and its piece, from 1; each (H, W).

    0 for pixels that show no thing, and for those at the edges of one that lie alone.
    """
    rotation = np.vstack([plane.normal, plane.axes])
    return _pieces(
        np.ascontiguousarray(eye.rays), np.ascontiguousarray(depth, np.float64), rotation, plane.offset,
        plane.origin, LOWEST, HIGHEST, GAP, float(eye.camera.matrix[1, 1]), _NEIGHBOURS,
    )  # fmt: skip


@njit("i4(i4[::1],i4)", cache=True)
def _root(parent: Labels, k: int) -> int:
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@njit(
    "Tuple((f8[:,::1],f8[:,::1],f8[:,::1],i4[:,::1]))(f8[:,:,::1],f8[:,::1],f8[:,::1],f8,f8[::1],f8,f8,f8,f8,i8)",
    cache=True,
)
def _pieces(
    rays: Array, depth: Array, rotation: Array, offset: float, origin: Array,
    lowest: float, highest: float, gap: float, focal: float, fewest: int,
) -> tuple[Array, Array, Array, Labels]:  # fmt: skip
    rows, columns = depth.shape
    height, x, y = np.zeros((rows, columns)), np.zeros((rows, columns)), np.zeros((rows, columns))
    parent = np.full(rows * columns, -1, np.int32)
    links = np.zeros(rows * columns, np.int32)
    for v in range(rows):
        for u in range(columns):
            z = depth[v, u]
            if not z > 0.0:
                continue
            a, b = rays[v, u, 0], rays[v, u, 1]
            up = z * (rotation[0, 0] * a + rotation[0, 1] * b + rotation[0, 2]) + offset
            noise = NOISE * z * z
            if up < max(lowest, 4.0 * noise) or up > highest:
                continue
            height[v, u] = up
            x[v, u] = z * (rotation[1, 0] * a + rotation[1, 1] * b + rotation[1, 2]) + origin[0]
            y[v, u] = z * (rotation[2, 0] * a + rotation[2, 1] * b + rotation[2, 2]) + origin[1]
            # A level top at this height, `drop` below the camera, moves on by r^2 / drop each radian.
            drop = max(offset - up, 0.05)
            slant = z * z * (a * a + b * b + 1.0)
            pixel = min(1.2 * slant / (drop * focal), 0.1)
            k = v * columns + u
            parent[k] = k
            # Pixels before it, up to two away: single ones may be missing.
            for dv in range(-2, 1):
                for du in range(-2, 3):
                    if (dv == 0 and du >= 0) or v + dv < 0 or u + du < 0 or u + du >= columns:
                        continue
                    n = k + dv * columns + du
                    if parent[n] < 0:
                        continue
                    dx, dy = x[v, u] - x[v + dv, u + du], y[v, u] - y[v + dv, u + du]
                    step = max(abs(dv), abs(du))
                    if dx * dx + dy * dy > (gap + step * pixel + 4.0 * noise) ** 2:
                        continue
                    if step == 1:
                        links[k] += 1
                        links[n] += 1
                    one, other = _root(parent, k), _root(parent, n)
                    if one < other:
                        parent[other] = one
                    else:
                        parent[one] = other
    labels = np.zeros((rows, columns), np.int32)
    number = np.zeros(rows * columns, np.int32)
    count = 0
    for v in range(rows):
        for u in range(columns):
            k = v * columns + u
            if parent[k] < 0 or links[k] < fewest:
                continue
            root = _root(parent, k)
            if number[root] == 0:
                count += 1
                number[root] = count
            labels[v, u] = number[root]
    return height, x, y, labels
