"""The pose of a tag, or of a board of tags, in any attitude before a camera."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from services.tracker.camera import Camera
from services.tracker.layout import Tag, square

Array = NDArray[np.float64]


def planar(tag: Tag, corners: Array, camera: Camera) -> list[tuple[Array, Array, float]]:
    """Return the two poses of a tag that its corners, (4, 2), pixels, allow, the better first.

    Each is a rotation, (3, 3), and a position, (3,), m, from the tag's frame to the camera's, and the root mean square
    error, pixels. There are fewer where the corners are those of no square.
    """
    _, turns, moves, errors = cv2.solvePnPGeneric(
        square(tag.side),
        np.ascontiguousarray(corners),
        camera.matrix,
        camera.distortion,
        flags=cv2.SOLVEPNP_IPPE_SQUARE,
    )
    found = zip(turns, moves, np.ravel(errors), strict=True)
    poses = [(cv2.Rodrigues(turn)[0], np.ravel(move), float(error)) for turn, move, error in found]
    return [pose for pose in poses if np.isfinite(pose[1]).all()]


def free(points: Array, pixels: Array, camera: Camera) -> tuple[Array, Array, float]:
    """Return the pose of a thing in any attitude: rotation (3, 3), position (3,), m, to the camera's frame, and error.

    Args:
        points: (N, 3), m, the thing's frame, at least 4.
        pixels: (N, 2), where they are seen.

    Returns:
        The error is the root mean square distance, pixels.
    """
    K, D = camera.matrix, camera.distortion
    _, turn, move = cv2.solvePnP(points, pixels, K, D, flags=cv2.SOLVEPNP_SQPNP)
    turn, move = cv2.solvePnPRefineLM(points, pixels, K, D, turn, move)
    rotation, position = cv2.Rodrigues(turn)[0], np.ravel(move)
    off = camera.project(points @ rotation.T + position) - pixels
    return rotation, position, float(np.sqrt((off**2).sum(axis=1).mean()))
