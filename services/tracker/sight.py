"""How far the corners of tags are from where an object's pose on the floor would have them, and the pose that fits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.vision.camera import Mount

Array = NDArray[np.float64]

_ROUNDS = 12
"""steps of a minimisation, at most"""
_NEAR = 10.0
"""times the tolerance within which a tag is from the pose of another alone, if they agree"""
_UNUSUAL = 3.0
"""times the expected variance at which the residuals speak against the constant noise"""


@dataclass(frozen=True)
class Sight:
    """What is seen of an object.

    Attributes:
        points: (N, 4, 3), m, object's frame, the corners of N tags.
        rays: (N, 4, 2), where they are seen, camera frame, z = 1.
        focal: (2,), pixels.
        mount: of the camera.
    """

    points: Array
    rays: Array
    focal: Array
    mount: Mount

    def errors(self, pose: Array) -> Array:
        """Return where corners should be less where they are, (N, 4, 2), pixels of a lens without distortion."""
        camera = self.mount.to_camera(placed(self.points, pose))
        with np.errstate(divide="ignore", invalid="ignore"):
            off = (camera[..., :2] / camera[..., 2:] - self.rays) * self.focal
        return np.where(camera[..., 2:] > 0.0, off, np.inf)

    def slopes(self, pose: Array) -> Array:
        """Return the derivatives of `errors` by x, y, yaw: (N, 4, 2, 3)."""
        at = placed(self.points, pose)
        camera = self.mount.to_camera(at)
        moved = np.zeros((*at.shape, 3))
        moved[..., 0, 0] = moved[..., 1, 1] = 1.0
        moved[..., 0, 2], moved[..., 1, 2] = pose[1] - at[..., 1], at[..., 0] - pose[0]
        moved = np.einsum("ji,nkjm->nkim", self.mount.rotation, moved)
        depth = camera[..., 2:, None]
        return np.asarray(
            (moved[..., :2, :] - camera[..., :2, None] / depth * moved[..., 2:, :]) / depth * self.focal[:, None]
        )

    def settle(self, start: Array, own: int, tolerance: float) -> tuple[Array, NDArray[np.bool_]] | None:
        """Return the pose near `start` that fits best, and the tags that agree with it, (N,).

        Args:
            start: (3,), base frame, from one tag.
            own: that tag. If it contradicts every pose near the start, there is none.
            tolerance: pixels, see `standing`.
        """
        used = np.arange(len(self.points)) == own
        pose = self.fit(start, used)
        distance = self.distances(pose)
        if not distance[own] < tolerance:
            return None
        used |= distance < _NEAR * tolerance
        while True:
            pose = self.fit(pose, used)
            distance = np.where(used, self.distances(pose), 0.0)
            if distance.max() < tolerance:
                return pose, used
            distance[own] = 0.0
            if not distance.any():
                return None
            used[np.argmax(distance)] = False

    def distances(self, pose: Array) -> Array:
        """Return how far tags are from where they should be, root mean square, pixels, (N,)."""
        return np.asarray(np.sqrt((self.errors(pose) ** 2).sum(axis=2).mean(axis=1)))

    def fit(self, pose: Array, used: NDArray[np.bool_]) -> Array:
        """Return the pose near `pose` of least squares over the tags used (Levenberg, Marquardt)."""
        damping, cost = 1e-3, float((self.errors(pose)[used] ** 2).sum())
        for _ in range(_ROUNDS):
            if not math.isfinite(cost):
                break
            J, r = self.slopes(pose)[used].reshape(-1, 3), self.errors(pose)[used].ravel()
            information = J.T @ J
            step = np.linalg.solve(information + damping * np.diag(np.diag(information)), J.T @ r)
            tried = pose - step
            found = float((self.errors(tried)[used] ** 2).sum())
            if found <= cost:
                pose, cost, damping = tried, found, 0.1 * damping
            else:
                damping *= 10.0
            if np.abs(step).max() < 1e-9:
                break
        return pose

    def certainty(
        self, pose: Array, used: NDArray[np.bool_], noise: float, off: float, turned: float
    ) -> tuple[Array, Array, float]:
        """Return how well a pose is known.

        Corners farther from where they should be than their noise and the mount explain widen the first covariance.

        Args:
            noise: pixels, of a corner.
            off, turned: m and rad, what the mount is off along and about each axis of the base, standard deviations.

        Returns:
            Covariance, (3, 3), by noise, which differs from picture to picture; by the mount, which stays; and the
            error of the corners, root mean square, pixels.
        """
        J, r = self.slopes(pose)[used].reshape(-1, 3), self.errors(pose)[used].ravel()
        by_mount = self._by_mount(pose, used) * np.repeat((off, turned), 3)
        inverse = np.linalg.inv(J.T @ J)
        moved = inverse @ (J.T @ by_mount)
        # What the mount puts between corners and pose, and the pose does not take up.
        left = float(((by_mount - J @ moved) ** 2).sum()) / (len(r) - 3)
        spread = float(r @ r) / (len(r) - 3)
        variance = spread - left if spread > _UNUSUAL * (noise**2 + left) else noise**2
        return np.asarray(variance * inverse), moved @ moved.T, math.sqrt(2.0 * float(r @ r) / len(r))

    def _by_mount(self, pose: Array, used: NDArray[np.bool_]) -> Array:
        """Return the derivatives of `errors` by the mount's place and turn, along and about base's axes: (8 N, 6)."""
        away = placed(self.points[used], pose) - self.mount.position
        camera = (away @ self.mount.rotation)[..., None, :]
        along = np.broadcast_to(np.eye(3), (*away.shape, 3))
        # The camera moved or turned, what it sees moves the other way; the sign is nobody's concern here.
        moved = np.concatenate([along, np.cross(np.eye(3), away[..., None, :])], axis=-2) @ self.mount.rotation
        depth = camera[..., 2:]
        slopes = (moved[..., :2] - camera[..., :2] / depth * moved[..., 2:]) / depth * self.focal
        return np.asarray(np.swapaxes(slopes, -1, -2).reshape(-1, 6))


def placed(points: Array, pose: Array) -> Array:
    """Return points, (..., 3), m, object's frame, of an object at `pose`, in the base's frame."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x, y = points[..., 0], points[..., 1]
    return np.stack([pose[0] + c * x - s * y, pose[1] + s * x + c * y, points[..., 2]], axis=-1)
