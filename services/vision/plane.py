"""The floor or table that things stand on, found in what a depth camera measures.

The deviation of a measured depth grows with the square of the depth (Khoshelham and Elberink 2012, for Kinect).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.vision.camera import Mount

Array = NDArray[np.float64]

NOISE = 0.0015
"""Deviation of a depth over its square, 1/m: 1.5 mm at 1 m, as the tables of the Kinect's frames in the tests."""
_HYPOTHESES = 100
_SAMPLE = 800
_REFINED = 6000
_ROUNDS = 4
_UPRIGHT = 0.3
"""The least upward part, in the picture, of a floor's normal. A wall's is sideways, or down for a camera that looks
down."""


class NoPlane(ValueError):
    """Too little was measured to find a plane."""


@dataclass(frozen=True)
class Plane:
    """A plane and coordinates on it.

    Attributes:
        normal: (3,), unit length, up, camera frame; offset: m, the camera's height above the plane.
        axes: (2, 3), x and y on the plane, camera frame.
        origin: (2,), m, the coordinates of the point below the camera.
    """

    normal: Array
    offset: float
    axes: Array
    origin: Array

    @classmethod
    def of(cls, normal: Array, offset: float, mount: Mount | None = None) -> Plane:
        """Return the plane on which normal @ p + offset = 0.

        Its coordinates are the base's, dropped onto it; without a mount x is forward and y left of the point below
        the camera.
        """
        forward = np.array([0.0, 0.0, 1.0]) if mount is None else mount.rotation.T @ np.array([1.0, 0.0, 0.0])
        x = forward - (forward @ normal) * normal
        x /= np.linalg.norm(x)
        axes = np.array([x, np.cross(normal, x)])
        origin = np.zeros(2) if mount is None else -axes @ mount.to_camera(np.zeros((1, 3)))[0]
        return cls(normal, offset, axes, origin)

    @classmethod
    def floor(cls, mount: Mount) -> Plane:
        """Return the floor as the mount has it."""
        return cls.of(mount.rotation.T @ np.array([0.0, 0.0, 1.0]), float(mount.position[2]), mount)


def deviation(depth: Array) -> Array:
    """Return the deviation of depths, m."""
    return np.asarray(NOISE * depth**2 + 1e-4)


def find_plane(points: Array, seed: int = 0) -> tuple[Array, float]:
    """Return normal, (3,), and offset, m, of the plane that most points, (N, 3), camera frame, m, lie on.

    RANSAC (Fischler and Bolles 1981) over a sample; planes that stand upright in the picture are left out.

    Raises:
        NoPlane: there is none.
    """
    if len(points) < 3:
        raise NoPlane(f"{len(points)} points measured, expected at least 3")
    sample = points[:: max(1, len(points) // _SAMPLE)]
    chosen = np.random.default_rng(seed).integers(0, len(sample), (_HYPOTHESES, 3))
    a, b, c = sample[chosen[:, 0]], sample[chosen[:, 1]], sample[chosen[:, 2]]
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    whole = lengths > 1e-6
    normals, a = normals[whole] / lengths[whole, None], a[whole]
    offsets = -(normals * a).sum(axis=1)
    normals, offsets = normals * np.sign(offsets)[:, None], np.abs(offsets)
    upright = -normals[:, 1] > _UPRIGHT
    if not upright.any():
        raise NoPlane("no points lie on a plane that can be a floor")
    normals, offsets = normals[upright], offsets[upright]
    off = (sample @ normals.T + offsets) / (3.0 * deviation(sample[:, 2]))[:, None]
    best = int(np.argmin(np.minimum(off**2, 1.0).sum(axis=0)))
    return refined(points, normals[best], float(offsets[best]))


def refined(points: Array, normal: Array, offset: float, slack: float = 0.0) -> tuple[Array, float]:
    """Return the plane of least squares through the points, (N, 3), close to a plane.

    Args:
        slack: m, how far off the plane may be at first; where too few points are close it is left as it is.
    """
    points = points[:: max(1, len(points) // _REFINED)]
    sigma = deviation(points[:, 2])
    for k in range(_ROUNDS):
        close = np.abs(points @ normal + offset) < 3.0 * sigma + slack / 4**k
        if close.sum() < 100:
            return normal, offset
        weight = 1.0 / sigma[close] ** 2
        mean = weight @ points[close] / weight.sum()
        spread = points[close] - mean
        _, vectors = np.linalg.eigh((spread * weight[:, None]).T @ spread)
        normal = vectors[:, 0] * np.sign(-(vectors[:, 0] @ mean))
        offset = float(-(normal @ mean))
    return normal, offset
