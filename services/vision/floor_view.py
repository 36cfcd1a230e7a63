"""Where on the floor each pixel of a camera looks, as seen from the point below the camera.

An upright edge is seen along one bearing from there: it is under the camera's own vertical. So a thing with upright
sides takes the same bearings in the picture as its footprint does on the floor, whatever its height, and along each
of them the nearest pixel is where it meets the floor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.vision.camera import Camera, Mount

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_FOLDED = 0.02
"""m, beside two pixels, that a pixel may look away from a place that is projected to it"""
SHRINK = 2
"""Pixels of the picture, along each side, that are looked at as one."""


@dataclass(frozen=True)
class Body:
    """The robot's own body, an upright disc around the base's origin: radius and height, m."""

    radius: float
    height: float


@dataclass(frozen=True)
class FloorView:
    """What the pixels of a shrunken picture see of the floor.

    Attributes:
        below: (2,), m, base frame, the point below the camera; camera_height: m.
        distance, bearing: (h, w), m and rad, of the floor at each pixel, from that point, base frame; 0: not looked at.
        step, turn: (h, w), m and rad that a pixel covers along distance and bearing.
        looked: (h, w), whether the pixel shows floor that is near enough and not hidden by the body.
        hidden: (h, w), those of them beside the body or at the picture's bottom: what is nearer is not seen.
        edge: (h, w), those of them at the picture's sides; far: at its top or where looking ends.
    """

    camera: Camera
    mount: Mount
    below: Array
    camera_height: float
    distance: Array
    bearing: Array
    step: Array
    turn: Array
    looked: Mask
    hidden: Mask
    edge: Mask
    far: Mask

    @classmethod
    def of(cls, camera: Camera, mount: Mount, body: Body, furthest: float) -> FloorView:
        """Return the view of a camera on a base; what is farther than `furthest`, m, from below it is not looked at."""
        h, w = camera.height // SHRINK, camera.width // SHRINK
        v, u = np.mgrid[:h, :w] * float(SHRINK) + (SHRINK - 1) / 2.0
        floor = mount.on_plane(camera.rays(np.column_stack([u.ravel(), v.ravel()])))
        away = (floor - mount.position[:2]).reshape(h, w, 2)
        distance, bearing = np.hypot(away[..., 0], away[..., 1]), np.arctan2(away[..., 1], away[..., 0])
        ahead = np.nan_to_num(distance, nan=np.inf) < furthest
        # The body's top is seen on the floor behind it, grown by what it is nearer to the camera.
        growth = mount.position[2] / max(mount.position[2] - body.height, 1e-3)
        grown = np.hypot(*(away / growth + mount.position[:2]).transpose(2, 0, 1))
        covered = np.nan_to_num(np.minimum(grown, np.hypot(*floor.T).reshape(h, w)), nan=np.inf) < body.radius
        looked = ahead & ~covered
        step, turn = _change(distance), _change(np.unwrap(bearing, axis=1) if np.isfinite(bearing).all() else bearing)
        sides, top, bottom = (np.zeros((h, w), bool) for _ in range(3))
        sides[:, 0] = sides[:, -1] = True
        top[0] = bottom[-1] = True
        return cls(
            camera, mount, mount.position[:2], float(mount.position[2]),
            np.where(looked, distance, 0.0), np.where(looked, bearing, 0.0), np.where(looked, step, 0.0),
            np.where(looked, turn, 0.0), looked, looked & (bottom | _beside(covered)), looked & sides,
            looked & (top | _beside(~ahead)),
        )  # fmt: skip

    def pixels_of(self, floor: Array) -> NDArray[np.int64]:
        """Return the rows and columns, (M, 2), of the pixels that look at floor points, (N, 2), m, base frame."""
        at, seen = self.looks_at(floor)
        return np.asarray(at[seen])

    def looks_at(self, floor: Array) -> tuple[NDArray[np.int64], Mask]:
        """Return row and column, (N, 2), of the pixel that looks at each floor point, (N, 2), m, base frame.

        And whether there is one, (N,); the others' are 0.
        """
        points = self.mount.to_camera(np.column_stack([floor, np.zeros(len(floor))]))
        before = points[:, 2] > 0.05
        at = np.full((len(floor), 2), -1, np.int64)
        at[before] = np.floor((self.camera.project(points[before]) + 0.5) / SHRINK).astype(np.int64)[:, ::-1]
        h, w = self.looked.shape
        seen = (at >= 0).all(axis=1) & (at[:, 0] < h) & (at[:, 1] < w)
        at[~seen] = 0
        v, u = at.T
        # Far outside of its field a lens's polynomial folds back into the picture: the pixel has to look there as well.
        away = self.distance[v, u, None] * np.column_stack([np.cos(self.bearing[v, u]), np.sin(self.bearing[v, u])])
        off = np.hypot(*(self.below + away - floor).T)
        pixel = np.hypot(self.step[v, u], self.turn[v, u] * self.distance[v, u])
        return at, seen & self.looked[v, u] & (off < _FOLDED + 2.0 * pixel)


def _change(values: Array) -> Array:
    """Return how much (h, w) values change from one pixel to the next, at most along either side."""
    with np.errstate(invalid="ignore"):
        rows, columns = np.gradient(values)
    return np.nan_to_num(np.hypot(rows, columns))


def _beside(mask: Mask) -> Mask:
    """Return the pixels that have one of `mask` among their 8 neighbours."""
    padded = np.pad(mask, 1, mode="edge")
    h, w = mask.shape
    return np.asarray(np.any([padded[i : i + h, j : j + w] for i in range(3) for j in range(3)], axis=0))
