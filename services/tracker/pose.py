"""Where an object stands on the floor, from the corners of the tags it carries.

The object stands upright, so that three numbers say its pose. One tag alone, seen from afar, fits two poses nearly as
well (Collins and Bartoli, Infinitesimal plane-based pose estimation, 2014). Both are tried: of the two, one commonly
has the object tilted, and fits badly once it has to stand; where both stand, an expected pose decides. Tags that
contradict the others, or that no object standing upright can show, are left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.geometry.angles import difference, wrap
from services.tracker.attitude import planar
from services.tracker.layout import Layout, Tag
from services.tracker.sight import Sight, placed
from services.tracker.tags import Tags
from services.vision.camera import Camera, Mount

Array = NDArray[np.float64]

NOISE = 0.1
"""pixels, standard deviation of a found corner along each axis: 0.05 in rendered pictures with noise of 2 grey levels
and markers of 16 to 90 pixels, 0.15 to 0.3 by the residuals of single tags in photos, whose lens is known less well"""
TOLERANCE = 2.0
"""pixels, root mean square distance from where its corners should be at which a tag contradicts a pose"""
_SAME = math.radians(10.0)
"""rad from the yaw of a start to that of the pose it leads to, at most"""


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
        covariance: (3, 3), of what differs from picture to picture.
        doubt: (3, 3), the same of what stays: where the camera sits is known only so well.
        rms: pixels from the corners found to where they should be, over the tags used.
        used: ids of the tags that the pose is from, ascending.
        dropped: ids of the object's tags that contradict it, ascending.
    """

    pose: Array
    covariance: Array
    doubt: Array
    rms: float
    used: tuple[int, ...]
    dropped: tuple[int, ...]


def standing(
    tags: Tags, layout: Layout, camera: Camera, mount: Mount, expected: Belief | None = None,
    noise: float = NOISE, tolerance: float = TOLERANCE, mount_error: tuple[float, float] = (0.0, 0.0),
) -> Standing | None:  # fmt: skip
    """Return the pose of an object that stands on the floor, or None if no tag of it shows one.

    The expected pose only helps to choose among poses that the tags allow: what comes back is what was measured.

    Args:
        tags: found in a picture, of this object or not.
        noise, tolerance: pixels.
        mount_error: m and rad, of the mount, standard deviations along and about each axis.
    """
    own = layout.by_id()
    seen = [k for k, id in enumerate(tags.ids.tolist()) if id in own]
    if not seen:
        return None
    sight = Sight(
        np.array([own[int(tags.ids[k])].corners() for k in seen]),
        camera.rays(tags.corners[seen].reshape(-1, 2))[:, :2].reshape(-1, 4, 2),
        np.array([camera.matrix[0, 0], camera.matrix[1, 1]]),
        mount,
    )
    starts = [
        (n, _on_floor(own[int(tags.ids[k])], mount.rotation @ rotation, mount.to_base(position[None])[0]))
        for n, k in enumerate(seen)
        for rotation, position, _ in planar(own[int(tags.ids[k])], tags.corners[k], camera)
    ]
    found: list[tuple[Array, NDArray[np.bool_]]] = []
    best, least = None, np.inf
    for n, start in starts:
        # What another tag has led to already is not looked for again.
        if any(used[n] and abs(difference(start[2], pose[2])) < _SAME for pose, used in found):
            continue
        settled = sight.settle(start, n, tolerance)
        if settled is None:
            continue
        found.append(settled)
        pose, used = settled
        off = sight.errors(pose)
        # A tag left out costs as much as one at the limit, so that most tags agree with the best.
        cost = float(np.where(used, (off**2).sum(axis=(1, 2)), 4.0 * tolerance**2).sum()) / noise**2
        if expected is not None:
            cost += _distance(pose, expected)
        if cost < least:
            best, least = settled, cost
    if best is None:
        return None
    pose, used = best
    ids = tags.ids[seen]
    covariance, doubt, rms = sight.certainty(pose, used, noise, *mount_error)
    pose[2] = wrap(float(pose[2]))
    return Standing(pose, covariance, doubt, rms, tuple(ids[used].tolist()), tuple(ids[~used].tolist()))


def _on_floor(tag: Tag, rotation: Array, position: Array) -> Array:
    """Return the upright pose, (3,), base frame, closest to that of a tag in any attitude.

    Args:
        rotation, position: (3, 3) and (3,), m, from the tag's frame to the base's.
    """
    turned = rotation @ tag.rotation.T
    # The rotation about z that is closest to `turned`.
    yaw = math.atan2(turned[1, 0] - turned[0, 1], turned[0, 0] + turned[1, 1])
    off = placed(tag.position, np.array([0.0, 0.0, yaw]))
    return np.array([position[0] - off[0], position[1] - off[1], yaw])


def _distance(pose: Array, expected: Belief) -> float:
    """Return the squared distance of a pose from an expected one, in its standard deviations."""
    d = pose - expected.pose
    d[2] = difference(float(pose[2]), float(expected.pose[2]))
    return float(d @ np.linalg.solve(expected.covariance, d))
