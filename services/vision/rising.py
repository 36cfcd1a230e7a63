"""What rises from the floor in a picture of depths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.vision.camera import Camera, Mount
from services.vision.floor_view import SHRINK, FloorView
from services.vision.plane import NOISE, Plane, find_plane, refined

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LOWEST = 0.015
"""m above the plane"""
_MOUNT_SLACK = 0.06
"""m that the floor may be off where the mount has it"""


@dataclass(frozen=True)
class DepthEye:
    """A depth camera and the directions of its pixels, (H, W, 3), camera frame, z = 1."""

    camera: Camera
    rays: Array

    @classmethod
    def of(cls, camera: Camera) -> DepthEye:
        """Return the eye of a camera."""
        v, u = np.mgrid[: camera.height, : camera.width]
        rays = camera.rays(np.column_stack([u.ravel(), v.ravel()]).astype(np.float64))
        return cls(camera, rays.reshape(camera.height, camera.width, 3))


def support(eye: DepthEye, depth: Array, mount: Mount | None = None) -> Plane:
    """Return the plane that things stand on.

    Args:
        depth: (H, W), m, along the camera's axis; 0 or NaN: nothing measured.
        mount: the floor is near where it says; None: it is the largest plane that does not stand upright.

    Raises:
        NoPlane: too little was measured, and there is no mount.
    """
    # Every second row and column are enough for a plane.
    coarse = depth[::2, ::2]
    measured = coarse > 0.0
    points = eye.rays[::2, ::2][measured] * coarse[measured][:, None]
    if mount is None:
        return Plane.of(*find_plane(points))
    prior = Plane.floor(mount)
    return Plane.of(*refined(points, prior.normal, prior.offset, _MOUNT_SLACK), mount)


def rising(view: FloorView, eye: DepthEye, depth: Array) -> tuple[Mask, Mask]:
    """Return which of the view's pixels, (h, w), show what rises from the floor, and which show anything.

    Args:
        depth: (H, W), m, along the camera's axis; 0 or NaN: nothing measured. Where too little is, the floor is taken
            to be where the mount has it.
    """
    plane = support(eye, depth, view.mount)
    measured = depth > 0.0
    height = depth * (eye.rays @ plane.normal) + plane.offset
    up = measured & (height > np.maximum(LOWEST, 4.0 * NOISE * depth**2))
    h, w = view.looked.shape
    blocks = (slice(0, h * SHRINK), slice(0, w * SHRINK))
    # A pixel of the view shows what half of its own show.
    counts = [mask[blocks].reshape(h, SHRINK, w, SHRINK).sum(axis=(1, 3)) for mask in (up, measured)]
    return (2 * counts[0] > counts[1]) & view.looked, (counts[1] > 0) & view.looked
