"""Plane geometry of the pictures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from services.predictive.model import basis

Floats = NDArray[np.float64]


def circle(count: int = 64) -> Floats:
    """(count + 1, 2) closed unit circle."""
    angle = np.linspace(0.0, 2.0 * np.pi, count + 1)
    return np.column_stack([np.cos(angle), np.sin(angle)])


def fan(count: int = 48) -> tuple[Floats, NDArray[np.uint32]]:
    """A filled unit disc: (count + 1, 2) corners, the centre first, and (count, 3) triangles."""
    rim = np.arange(count, dtype=np.uint32)
    triangles = np.column_stack([np.zeros_like(rim), rim + 1, (rim + 1) % count + 1])
    return np.vstack([[[0.0, 0.0]], circle(count)[:-1]]), triangles


def ribbon(path: Floats, half_width: Floats) -> tuple[Floats, NDArray[np.uint32]]:
    """The strip of half width `half_width` (N) along `path` (N, 2): (2 N, 2) corners, (2 N - 2, 3) triangles.

    Every corner lies within half_width[i] of path[i], so the strip never leaves the corridor. Negative widths count
    as zero: there is no corridor there.
    """
    if len(path) < 2:
        return np.empty((0, 2)), np.empty((0, 3), np.uint32)
    along = np.gradient(path, axis=0)
    length = np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-12)
    normal = np.column_stack([-along[:, 1], along[:, 0]]) / length[:, None]
    side = normal * np.maximum(half_width, 0.0)[:, None]
    corners = np.stack([path + side, path - side], axis=1).reshape(-1, 2)
    left = np.arange(0, 2 * len(path) - 2, 2, dtype=np.uint32)
    triangles = np.stack(
        [np.column_stack([left, left + 1, left + 2]), np.column_stack([left + 1, left + 3, left + 2])], axis=1
    )
    return corners, triangles.reshape(-1, 3)


def band(path: Floats, half_width: Floats, stride: int = 4) -> tuple[Floats, NDArray[np.uint32]]:
    """The corridor of half width `half_width` (N) around `path` (N, 2): (M, 2) corners, (K, 3) triangles.

    The ribbon along the path, and discs around every `stride`-th point and the ends: they round the ends off and fill
    what the ribbon leaves open outside of bends. Like the ribbon it never leaves the corridor.
    """
    corners, triangles = ribbon(path, half_width)
    disc, faces = fan()
    points, shapes = [corners], [triangles]
    at = [*range(0, len(path) - 1, stride), len(path) - 1] if len(path) else []
    count = len(corners)
    for index in at:
        if half_width[index] > 0.0:
            points.append(path[index] + half_width[index] * disc)
            shapes.append(faces + np.uint32(count))
            count += len(disc)
    return np.vstack(points), np.vstack(shapes)


def rotated(vectors: Floats, theta: Floats) -> Floats:
    """(N, 2) vectors turned by theta (N), rad."""
    cos, sin = np.cos(theta), np.sin(theta)
    return np.column_stack([cos * vectors[:, 0] - sin * vectors[:, 1], sin * vectors[:, 0] + cos * vectors[:, 1]])


def quaternions(theta: Floats) -> Floats:
    """(N, 4) x, y, z, w of turns about the vertical by theta (N), rad."""
    zero = np.zeros_like(theta)
    return np.column_stack([zero, zero, np.sin(theta / 2.0), np.cos(theta / 2.0)])


def pose_at(times: NDArray[np.int64], pose_times: NDArray[np.int64], poses: Floats) -> Floats:
    """(N, 3) poses x, y, theta at `times` (N, ns), linear between the (K, 3) known ones, the ends held."""
    # Differences of int64 first: nanoseconds of a wall clock do not fit a float.
    since = (times - pose_times[0]).astype(np.float64)
    known = (pose_times - pose_times[0]).astype(np.float64)
    theta = np.unwrap(poses[:, 2])
    return np.column_stack([np.interp(since, known, column) for column in (poses[:, 0], poses[:, 1], theta)])


def corridor_depth(points: Floats, path: Floats, half_width: Floats) -> Floats:
    """(M) how deep `points` (M, 2) lie in the corridor (path (N, 2), half_width (N)), m: max_i (W_i - |x - q_i|).

    Positive inside, negative outside (Definitions 1 and 2).
    """
    distance = np.hypot(points[:, None, 0] - path[None, :, 0], points[:, None, 1] - path[None, :, 1])
    return np.asarray(np.max(half_width[None, :] - distance, axis=1), np.float64)


def psi_push(alpha: Floats, mu: Floats, kappa: Floats) -> Floats:
    """Activation of pushing (Sec. 5.3): the von Mises density of Eq. (11) over its value at mu; 1 at alpha = mu."""
    return np.asarray(np.exp(kappa * (np.cos(alpha - mu) - 1.0)), np.float64)


def activation_lobe(
    o: Floats, t: Floats, mu: Floats, kappa: Floats, radius: Floats, reach: float, count: int = 96
) -> Floats:
    """(N, count + 1, 2) psi_push drawn around the object, map frame, m.

    The curve stands off the object's circle (radius (N)) in the direction in which a robot would stand, by
    psi_push * reach: a robot inside the lobe pushes, beside it relocates. The robot at bearing beta of the object
    sees the push-line (o (N, 2), t (N, 2)) under alpha = theta_ot - (beta - pi) in the push frame (Fig. 6c).
    """
    beta = np.linspace(-np.pi, np.pi, count + 1)[None, :]
    theta_ot = np.arctan2(t[:, 1] - o[:, 1], t[:, 0] - o[:, 0])[:, None]
    psi = psi_push(theta_ot - beta + np.pi, mu[:, None], kappa[:, None])
    r = radius[:, None] + reach * psi
    return o[:, None, :] + np.stack([r * np.cos(beta), r * np.sin(beta)], axis=-1)


def contour_curves(contours: Floats, robot: float, bearings: Floats | None = None) -> tuple[Floats, Floats]:
    """(N, K, 2) where the robot's centre is in touch, and (N, K, 2) where it touches; object's frame, m.

    The distance rho of the centres in touch at a bearing is a spline with the coefficients `contours` (N, C), as in
    `services.predictive.model`. The touch is the robot's radius `robot` along the curve's normal inwards.
    `bearings` are (K), rad; by default a closed round of 97.
    """
    b = np.linspace(-np.pi, np.pi, 97) if bearings is None else bearings
    share, change = basis(b)
    rho, slope = contours @ share.T, contours @ change.T
    radial = np.column_stack([np.cos(b), np.sin(b)])[None]
    tangential = np.column_stack([-np.sin(b), np.cos(b)])[None]
    normal = rho[..., None] * radial - slope[..., None] * tangential
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    reach = rho[..., None] * radial
    return reach, reach - robot * normal
