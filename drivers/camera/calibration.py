"""Intrinsics from views of a board: Zhang's method (2000) as OpenCV has it, with the distortion k1, k2, p1, p2, k3."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.camera.board import Sighting
from runtime.errors import PushlaneError

Array = NDArray[np.float64]

FEWEST = 5
"""Views. Three settle the five numbers of K; the distortion and a check want more."""

_STILL = 0.01
_WRONG = 4.0
_SURELY_RIGHT = 0.5


class TooFewViews(PushlaneError):
    """The pictures do not show the board often enough to calibrate."""

    exit_code = 1


@dataclass(frozen=True)
class View:
    """The board in one picture."""

    name: str
    seen: Sighting


@dataclass(frozen=True)
class Calibration:
    """What came out.

    Attributes:
        width, height: of the pictures, pixels.
        matrix: (3, 3), K, pixels, counted from the middle of the first one.
        distortion: (5,), k1, k2, p1, p2, k3.
        deviations: (9,), standard deviations of fx, fy, cx, cy and the distortion; 0 of what was not estimated.
        error: root mean square of the distances between corners and where the calibration expects them, pixels.
        errors: the same by view.
        normals: (N, 3), the board's normal by view, camera frame, towards the camera's back: z > 0.
        views: that were used.
        left_out: (name, reason) of views that did not fit.
    """

    width: int
    height: int
    matrix: Array
    distortion: Array
    deviations: Array
    error: float
    errors: Array
    normals: Array
    views: list[View]
    left_out: list[tuple[str, str]] = field(default_factory=list)


def calibrate(views: Sequence[View], size: tuple[int, int], wide: bool = False) -> Calibration:
    """Return the camera that saw `views`. A view that fits much worse than the others is left out.

    Args:
        size: (width, height) of all pictures, pixels.
        wide: estimate k3 as well. Without a wide lens there is nothing to see of it, and it is better 0.

    Raises:
        TooFewViews: fewer than `FEWEST`.
    """
    used, left_out = list(views), list[tuple[str, str]]()
    while True:
        if len(used) < FEWEST:
            reasons = "".join(f"; {name}: {reason}" for name, reason in left_out)
            raise TooFewViews(f"{len(used)} usable views of the board, expected at least {FEWEST}{reasons}")
        found = _fit(used, size, wide)
        worst = int(np.argmax(found.errors))
        limit = max(_SURELY_RIGHT, _WRONG * float(np.median(found.errors)))
        if found.errors[worst] <= limit:
            found.left_out.extend(left_out)
            return found
        reason = f"off by {found.errors[worst]:.2f} pixels, most views by {np.median(found.errors):.2f}"
        left_out.append((used.pop(worst).name, reason))


def moved(before: Sighting, after: Sighting, width: int) -> bool:
    """Return whether the board was moved between two pictures: one seen twice counts twice and tells nothing new."""
    if len(before.points) != len(after.points) or not np.array_equal(before.points, after.points):
        return True
    return float(np.abs(before.pixels - after.pixels).max()) > _STILL * width


def _fit(views: list[View], size: tuple[int, int], wide: bool) -> Calibration:
    flags = 0 if wide else cv2.CALIB_FIX_K3
    error, matrix, distortion, turns, _, deviations, _, errors = cv2.calibrateCameraExtended(
        [view.seen.points.astype(np.float32) for view in views],
        [view.seen.pixels.astype(np.float32).reshape(-1, 1, 2) for view in views],
        size,
        np.zeros((3, 3)),
        np.zeros(5),
        flags=flags,
    )
    normals = np.array([cv2.Rodrigues(turn)[0][:, 2] for turn in turns])
    return Calibration(
        width=size[0],
        height=size[1],
        matrix=np.asarray(matrix, np.float64),
        distortion=np.asarray(distortion, np.float64).ravel()[:5],
        deviations=np.asarray(deviations, np.float64).ravel()[:9],
        error=float(error),
        errors=np.asarray(errors, np.float64).ravel(),
        normals=normals * np.where(normals[:, 2:] < 0, -1.0, 1.0),
        views=list(views),
    )
