"""Where an object stands on the floor, from the corners of the tags it carries.

The object stands upright, so that three numbers say its pose. One tag alone, seen from afar, fits two poses nearly as
well (Collins and Bartoli, Infinitesimal plane-based pose estimation, 2014). Both are tried: of the two, one commonly has
the object tilted, and fits badly once it has to stand; where both stand, an expected pose decides. Tags that contradict
the others, or that no object standing upright can show, are left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.geometry.angles import difference, wrap
from services.tracker.camera import Camera, Mount
from services.tracker.layout import Layout, Tag, square
from services.tracker.tags import Tags

Array = NDArray[np.float64]

NOISE = 0.1
"""pixels, standard deviation of a found corner along each axis"""
TOLERANCE = 2.0
"""pixels, root mean square distance from where its corners should be at which a tag contradicts a pose"""
_ROUNDS = 12
"""steps of a minimisation, at most"""
_APART = math.radians(4.0)
"""rad between two yaws from which a minimisation would lead to the same"""
_UNUSUAL = 3.0
"""times the expected variance at which the residuals speak against the constant noise"""


@dataclass(frozen=True)
class Belief:
    """A pose on the floor, expected.

    Attributes:
        pose: (3,), x, y, yaw, m, m, rad, base frame.
        covariance: (3, 3).
    """

    pose: Array
    covariance: Array


@dataclass(frozen=True)
class Standing:
    """A pose on the floor, measured.

    Attributes:
        pose: (3,), x, y, yaw, m, m, rad, base frame.
        covariance: (3, 3).
        rms: pixels from the corners found to where they should be, over the tags used.
        used: ids of the tags that the pose is from, ascending.
        dropped: ids of the object's tags that contradict it, ascending.
    """

    pose: Array
    covariance: Array
    rms: float
    used: tuple[int, ...]
    dropped: tuple[int, ...]


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


def standing(
    tags: Tags, layout: Layout, camera: Camera, mount: Mount, expected: Belief | None = None,
    noise: float = NOISE, tolerance: float = TOLERANCE,
) -> Standing | None:  # fmt: skip
    """Return the pose of an object that stands on the floor, or None if no tag of it shows one.

    The expected pose only helps to choose among poses that the tags allow: what comes back is what was measured.

    Args:
        tags: found in a picture, of this object or not.
        noise, tolerance: pixels.
    """
    own = layout.by_id()
    seen = [k for k, id in enumerate(tags.ids.tolist()) if id in own]
    if not seen:
        return None
    sight = _Sight(
        np.array([own[int(tags.ids[k])].corners() for k in seen]),
        camera.rays(tags.corners[seen].reshape(-1, 2))[:, :2].reshape(-1, 4, 2),
        np.array([camera.matrix[0, 0], camera.matrix[1, 1]]),
        mount,
    )
    starts: list[tuple[int, Array]] = []
    for n, k in enumerate(seen):
        tag = own[int(tags.ids[k])]
        for rotation, position, _ in planar(tag, tags.corners[k], camera):
            pose = _on_floor(tag, mount.rotation @ rotation, mount.to_base(position[None])[0])
            if all(abs(difference(pose[2], other[2])) > _APART for m, other in starts if m == n):
                starts.append((n, pose))
    best, least = None, np.inf
    for n, start in starts:
        pose, used = sight.settle(start, n, tolerance)
        if pose is None:
            continue
        off = sight.errors(pose)
        # A tag left out costs as much as one at the limit, so that most tags agree with the best.
        cost = float(np.where(used, (off**2).sum(axis=(1, 2)), 4.0 * tolerance**2).sum()) / noise**2
        if expected is not None:
            cost += _distance(pose, expected)
        if cost < least:
            best, least = (pose, used), cost
    if best is None:
        return None
    pose, used = best
    ids = tags.ids[seen]
    covariance, rms = sight.certainty(pose, used, noise)
    pose[2] = wrap(float(pose[2]))
    return Standing(pose, covariance, rms, tuple(ids[used].tolist()), tuple(ids[~used].tolist()))


@dataclass(frozen=True)
class _Sight:
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
        camera = self.mount.to_camera(_placed(self.points, pose))
        with np.errstate(divide="ignore", invalid="ignore"):
            off = (camera[..., :2] / camera[..., 2:] - self.rays) * self.focal
        return np.where(camera[..., 2:] > 0.0, off, np.inf)

    def slopes(self, pose: Array) -> Array:
        """Return the derivatives of `errors` by x, y, yaw: (N, 4, 2, 3)."""
        placed = _placed(self.points, pose)
        camera = self.mount.to_camera(placed)
        moved = np.zeros((*placed.shape, 3))
        moved[..., 0, 0] = moved[..., 1, 1] = 1.0
        moved[..., 0, 2], moved[..., 1, 2] = pose[1] - placed[..., 1], placed[..., 0] - pose[0]
        moved = np.einsum("ji,nkjm->nkim", self.mount.rotation, moved)
        depth = camera[..., 2:, None]
        return np.asarray(
            (moved[..., :2, :] - camera[..., :2, None] / depth * moved[..., 2:, :]) / depth * self.focal[:, None]
        )

    def settle(self, pose: Array, own: int, tolerance: float) -> tuple[Array | None, NDArray[np.bool_]]:
        """Return the pose near `pose` that fits best, and the tags that agree with it, (N,); None if not even `own`."""
        used = np.arange(len(self.points)) == own
        # The start is no better than its one tag: others join as soon as they agree roughly.
        for limit in (np.inf, 10.0 * tolerance, tolerance):
            pose = self.fit(pose, used)
            now = self.agree(pose, limit if limit < np.inf else 10.0 * tolerance)
            if not now[own]:
                if limit < np.inf:
                    return None, used
                continue
            used = now
        pose = self.fit(pose, used)
        agree = self.agree(pose, tolerance)
        return (pose, used) if agree[used].all() else (None, used)

    def agree(self, pose: Array, limit: float) -> NDArray[np.bool_]:
        """Return which tags are within `limit`, pixels, of where they should be, (N,)."""
        return np.asarray((self.errors(pose) ** 2).sum(axis=2).mean(axis=1) < limit**2)

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

    def certainty(self, pose: Array, used: NDArray[np.bool_], noise: float) -> tuple[Array, float]:
        """Return the covariance of a pose, (3, 3), and its error, root mean square, pixels."""
        J, r = self.slopes(pose)[used].reshape(-1, 3), self.errors(pose)[used].ravel()
        spread = float(r @ r) / (len(r) - 3)
        variance = spread if spread > _UNUSUAL * noise**2 else noise**2
        return variance * np.linalg.inv(J.T @ J), math.sqrt(2.0 * float(r @ r) / len(r))


def _placed(points: Array, pose: Array) -> Array:
    """Return points, (..., 3), m, object's frame, of an object at `pose`, in the base's frame."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x, y = points[..., 0], points[..., 1]
    return np.stack([pose[0] + c * x - s * y, pose[1] + s * x + c * y, points[..., 2]], axis=-1)


def _on_floor(tag: Tag, rotation: Array, position: Array) -> Array:
    """Return the upright pose, (3,), base frame, closest to that of a tag in any attitude, from its frame to the base's."""
    turned = rotation @ tag.rotation.T
    # The rotation about z that is closest to `turned`.
    yaw = math.atan2(turned[1, 0] - turned[0, 1], turned[0, 0] + turned[1, 1])
    off = _placed(tag.position, np.array([0.0, 0.0, yaw]))
    return np.array([position[0] - off[0], position[1] - off[1], yaw])


def _distance(pose: Array, expected: Belief) -> float:
    """Return the squared distance of a pose from an expected one, in its standard deviations."""
    d = pose - expected.pose
    d[2] = difference(float(pose[2]), float(expected.pose[2]))
    return float(d @ np.linalg.solve(expected.covariance, d))
