"""What a calibration cannot know from its pictures, and which pictures would tell."""

from __future__ import annotations

from math import radians, sin

import numpy as np
from numpy.typing import NDArray

from drivers.camera.calibration import Calibration

Array = NDArray[np.float64]

TILT = radians(15)
"""A board seen flatter than this says little about the focal length: nearer and longer look alike."""
_TILTED = 3
_ROWS = ("top", "middle", "bottom")
_COLUMNS = ("left", "middle", "right")
_UNSURE = 0.01
_POOR = 1.0


def advice(found: Calibration) -> list[str]:
    """Return what is doubtful, a line each; nothing if all is well."""
    lines = []
    empty = uncovered(np.concatenate([view.seen.pixels for view in found.views]), found.width, found.height)
    if empty:
        lines.append(f"no corner was seen in the picture's {', '.join(empty)}: the distortion there is a guess")
    lines += _tilts(found.normals)
    focal, deviation = found.matrix[[0, 1], [0, 1]], found.deviations[:2]
    if (deviation > _UNSURE * focal).any():
        percent = 100 * float((deviation / focal).max())
        lines.append(f"the focal length is known to {percent:.1f} % only: take more views, nearer and more tilted")
    if found.error > _POOR:
        lines.append(
            f"the error of {found.error:.2f} pixels is large: is the board flat and stiff, are the pictures sharp, and "
            "are squares, columns and rows as said?"
        )
    return lines


def uncovered(pixels: Array, width: int, height: int) -> list[str]:
    """Return the ninths of a picture in which none of the corners, (N, 2), lies."""
    column = np.clip(3 * pixels[:, 0] // width, 0, 2)
    row = np.clip(3 * pixels[:, 1] // height, 0, 2)
    seen = set(zip(row.astype(int).tolist(), column.astype(int).tolist(), strict=True))
    return [_region(i, j) for i in range(3) for j in range(3) if (i, j) not in seen]


def _region(row: int, column: int) -> str:
    if (row, column) == (1, 1):
        return "middle"
    return " ".join(dict.fromkeys((_ROWS[row], _COLUMNS[column])))


def _tilts(normals: Array) -> list[str]:
    """Return what the views' tilts lack: the board's normals are (N, 3), z > 0."""
    about_vertical = int((np.abs(normals[:, 0]) > sin(TILT)).sum())
    about_level = int((np.abs(normals[:, 1]) > sin(TILT)).sum())
    lines = []
    for count, way in ((about_vertical, "to the left or right"), (about_level, "up or down")):
        if count < _TILTED:
            degrees = np.degrees(TILT)
            lines.append(
                f"in {count} views the board is tilted {way} by {degrees:.0f} degrees or more, expected {_TILTED}: "
                "the focal length is doubtful"
            )
    return lines
