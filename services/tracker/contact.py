"""Where what stands on the floor meets it, along each bearing from the point below the camera."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from services.vision.floor_view import FloorView

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BIN = 0.008
"""rad of bearing, about a pixel of 640 x 480 halved, seen at 0.8 m"""
JUMP = 0.25
"""m by which the contour jumps back from a thing to what stands behind it"""
FEWEST = 30
"""pixels of a thing"""
_BINS = int(2.0 * np.pi / BIN) + 1
_MOST = 64
_SLIVER = 3
"""bins that are no thing of their own: the side of a box that is looked along"""


@dataclass(frozen=True)
class Contour:
    """What is seen of a thing from the point below the camera; N bearings.

    Attributes:
        bearing: (N,), rad, base frame, ascending; near, far: (N,), m, floor seen before it and behind its top.
        left, right: rad, the bearings at which it ends: right < left.
        hidden: (N,), where its near side is not seen: the picture ends there, or the body covers it.
        topless: its top is not told from what stands behind, or is outside the picture; sideways: so is a side.
        count: pixels.
    """

    bearing: Array
    near: Array
    far: Array
    left: float
    right: float
    hidden: Mask
    topless: bool
    sideways: bool
    count: int

    def points(self, distances: Array) -> Array:
        """Return points, (N, 2), m, at the contour's bearings and such distances, (N,), from below the camera."""
        return distances[:, None] * np.column_stack([np.cos(self.bearing), np.sin(self.bearing)])


def contours(view: FloorView, standing: Mask) -> list[Contour]:
    """Return the contours of what stands on the floor.

    What hides a part of something else, a wall for example, is cut out of it where the contour jumps.

    Args:
        standing: (h, w), the view's pixels that do not show floor.
    """
    count, labels, stats, _ = cv2.connectedComponentsWithStats(standing.astype(np.uint8), connectivity=8)
    areas = stats[:, cv2.CC_STAT_AREA].copy()
    areas[0] = 0
    largest = np.argsort(-areas, kind="stable")[:_MOST]
    largest = largest[areas[largest] >= FEWEST]
    row = np.full(count, -1, np.int64)
    row[largest] = np.arange(len(largest))
    outline, ends = _outlines(
        labels, row, len(largest), view.distance, view.bearing, view.step, view.turn, view.hidden, view.edge, view.far
    )
    found: list[Contour] = []
    for k, area in enumerate(areas[largest]):
        seen = np.flatnonzero(outline[k, :, 1] > 0.0)
        pieces = _apart(seen, outline[k, seen, 0], view)
        for piece in pieces:
            near, far, hidden, topless, sideways = outline[k, piece].T
            bearing = np.asarray(-np.pi + (piece + 0.5) * BIN, np.float64)
            right = ends[k, 0] if piece[0] == seen[0] else bearing[0] - BIN / 2
            left = ends[k, 1] if piece[-1] == seen[-1] else bearing[-1] + BIN / 2
            no_top = len(pieces) > 1 or topless.mean() > 0.2
            share = int(area * len(piece) / len(seen))
            found.append(
                Contour(bearing, near, far, float(left), float(right), hidden > 0, no_top, bool(sideways.any()), share)
            )
    return found


def _apart(seen: NDArray[np.int64], near: Array, view: FloorView) -> list[NDArray[np.int64]]:
    """Return the bins of a region, (N,), in pieces between which the near contour, (N,), m, jumps."""
    focal = view.camera.matrix[1, 1]
    pixel = (near[1:] ** 2 + view.camera_height**2) / (view.camera_height * focal)
    at = np.flatnonzero(np.abs(np.diff(near)) > JUMP + 4.0 * pixel) + 1
    pieces = np.split(seen, at)
    return [seen] if any(len(piece) < _SLIVER for piece in pieces) else pieces


@njit(
    "Tuple((f8[:,:,::1],f8[:,::1]))"
    "(i4[:,::1],i8[::1],i8,f8[:,::1],f8[:,::1],f8[:,::1],f8[:,::1],b1[:,::1],b1[:,::1],b1[:,::1])",
    cache=True,
)
def _outlines(
    labels: NDArray[np.int32], row: NDArray[np.int64], count: int, distance: Array, bearing: Array, step: Array,
    turn: Array, hidden: Mask, edge: Mask, beyond: Mask,
) -> tuple[Array, Array]:  # fmt: skip
    """Return for regions and bins near, far, hidden, topless, sideways, (K, B, 5); the regions' ends, (K, 2), rad."""
    outline = np.zeros((count, _BINS, 5))
    ends = np.zeros((count, 2))
    ends[:, 0], ends[:, 1] = np.inf, -np.inf
    for v in range(labels.shape[0]):
        for u in range(labels.shape[1]):
            k = row[labels[v, u]]
            if k < 0:
                continue
            # A pixel counts from its middle; what it shows begins and ends half a pixel from there.
            near, far = distance[v, u] - step[v, u] / 2, distance[v, u] + step[v, u] / 2
            cell = outline[k, int((bearing[v, u] + np.pi) / BIN)]
            if cell[1] == 0.0 or near < cell[0]:
                cell[0] = near
                cell[2] = 1.0 if hidden[v, u] else 0.0
            cell[1] = max(cell[1], far)
            if beyond[v, u]:
                cell[3] = 1.0
            if edge[v, u]:
                cell[4] = 1.0
            # The median over neighbours has rounded the corners, and a blurred edge is half the thing's colour.
            ends[k, 0] = min(ends[k, 0], bearing[v, u] - 0.2 * turn[v, u])
            ends[k, 1] = max(ends[k, 1], bearing[v, u] + 0.2 * turn[v, u])
    return outline, ends
