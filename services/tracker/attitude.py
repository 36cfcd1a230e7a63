"""The pose of a tag, or of a board of tags, in any attitude before a camera."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from services.tracker.layout import Tag, square
from services.vision.camera import Camera

Array = NDArray[np.float64]


def planar(tag: Tag, corners: Array, camera: Camera) -> list[tuple[Array, Array, float]]:
    """Return the two poses of a tag that its corners, (4, 2), pixels, allow, the better first; at least one.

    Each is a rotation, (3, 3), and a position, (3,), m, from the tag's frame to the camera's, and the root mean square
    distance of the corners, pixels.
    """
    pixels = np.ascontiguousarray(corners)
    # OpenCV's solver loses solutions that are turned by half a turn from the camera's axes, which tags that face the
    # camera are. So the tag is described in axes of its own that are within an eighth of a turn of the camera's.
    x, y = pixels[1] - pixels[0]
    quarters = round(math.atan2(y, x) / (0.5 * math.pi))
    c, s = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarters % 4]
    axes = np.array([[c, s, 0.0], [s, -c, 0.0], [0.0, 0.0, -1.0]])
    points = square(tag.side) @ axes.T
    _, turns, moves, _ = cv2.solvePnPGeneric(points, pixels, camera.matrix, camera.distortion, flags=cv2.SOLVEPNP_IPPE)
    poses = []
    for turn, move in zip(turns, moves, strict=True):
        if np.isfinite(turn).all() and np.isfinite(move).all():
            rotation, position, error = _settled(points, pixels, camera, turn, move)
            poses.append((rotation @ axes, position, error))
    # Noise makes it rare, but corners that are symmetric to the last digit lose one or both.
    if len(poses) < 2:
        rotation, position, error = free(points, pixels, camera)
        poses.append((rotation @ axes, position, error))
    return sorted(poses, key=lambda pose: pose[2])


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
    return _settled(points, pixels, camera, turn, move)


def _settled(points: Array, pixels: Array, camera: Camera, turn: Array, move: Array) -> tuple[Array, Array, float]:
    """Return the pose of least squares near the one of a rotation vector and a position: see `free`."""
    turn, move = cv2.solvePnPRefineLM(points, pixels, camera.matrix, camera.distortion, turn, move)
    rotation, position = cv2.Rodrigues(turn)[0], np.ravel(move)
    off = camera.project(points @ rotation.T + position) - pixels
    return rotation, position, float(np.sqrt((off**2).sum(axis=1).mean()))
