"""Corners of dark squares on light ground, to a hundredth of a pixel: where the lines through their edges cross.

Three things make a square look too small, and its range too long by a share that grows with the range, if its corners
are looked for where the picture looks most like a corner:

- A contour of dark pixels runs through their middles, half a pixel inside the edge.
- Blur, and the area that a pixel takes light from, round a corner towards its dark side: 0.1 to 0.5 pixel. An edge away
  from its ends is moved by neither. So lines are fitted to edges, and their ends are left out.
- A picture's values are a power of the light, so that a pixel half dark, half light is no mean of the two and the dark
  side looks smaller: 0.2 pixel at each edge. So edges are looked for in the light.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from services.vision.camera import Camera

Array = NDArray[np.float64]
Grey = NDArray[np.uint8]

_POINTS = 20
"""points of a side at which its edge is looked for"""
_STEPS = 13
"""samples across the edge at each"""
_REACH = 3.0
"""pixels looked at on each side of an edge, at most: what a sharp to slightly blurred edge takes"""
_ROUNDED = 1.5
"""pixels at each end of a side that the corner's rounding can reach"""
_ROUNDS = 4
"""times that the edges are looked for, at most, each time from where they were found before"""
_SETTLED = 0.02
"""pixels that a corner moves in the last round, at most"""


def sharpen(grey: Grey, light: Array, corners: Array, modules: int, camera: Camera | None = None) -> Array:
    """Return where the edges of dark squares on light ground cross, (N, 4, 2), pixels.

    Args:
        grey: (H, W).
        light: (256,), what each value of a pixel means, proportional to the light it took in.
        corners: (N, 4, 2), pixels, to a pixel or two, clockwise in the picture.
        modules: of a side. For one module, dark and light are alike on both sides of an edge.
        camera: whose lens bends edges; without it they are taken to be straight in the picture.
    """
    for _ in range(_ROUNDS):
        points, contrast = _edges(grey, light, corners, modules)
        if camera is None or not camera.distortion.any():
            found = _crossings(points, contrast)
        else:
            straight = camera.rays(points.reshape(-1, 2))[:, :2].reshape(points.shape)
            crossed = _crossings(straight, contrast).reshape(-1, 2)
            found = camera.project(np.column_stack([crossed, np.ones(len(crossed))])).reshape(corners.shape)
        moved = np.abs(found - corners).max(initial=0.0)
        corners = found
        if moved < _SETTLED:
            break
    return corners


def _edges(grey: Grey, light: Array, corners: Array, modules: int) -> tuple[Array, Array]:
    """Return points on the edges of squares, (N, 4, P, 2), pixels, and the contrast at each, (N, 4, P)."""
    side = np.roll(corners, -1, axis=1) - corners
    length = np.maximum(np.hypot(side[..., 0], side[..., 1])[..., None], 1e-9)
    along = side / length
    outward = np.stack([along[..., 1], -along[..., 0]], axis=2)
    # What is one module deep is as deep in the picture as the square behind this side slants.
    behind = [np.abs(((np.roll(corners, by, axis=1) - corners) * outward).sum(axis=2)) for by in (1, -2)]
    reach = np.clip(np.minimum(*behind)[..., None] / modules, 1.0, _REACH)
    trim = np.minimum(_ROUNDED, 0.25 * length)
    s = trim + (length - 2.0 * trim) * np.linspace(0.0, 1.0, _POINTS)
    t = reach * np.linspace(-1.0, 1.0, _STEPS)
    feet = corners[:, :, None] + s[..., None] * along[:, :, None]
    across = t[..., None] * outward[:, :, None]
    x, y = (feet[..., None, i] + across[:, :, None, :, i] for i in (0, 1))
    # Outwards it gets lighter; where it gets darker another edge begins.
    rise = np.maximum(np.diff(_sampled(grey, light, x, y), axis=3), 0.0)
    contrast = rise.sum(axis=3)
    middle = 0.5 * (t[..., 1:] + t[..., :-1])
    offset = np.einsum("nspt,nst->nsp", rise, middle) / np.maximum(contrast, 1e-9)
    return feet + offset[..., None] * outward[:, :, None], contrast


def _sampled(grey: Grey, light: Array, x: Array, y: Array) -> Array:
    """Return the light at places, pixels, linear between pixels' middles; beyond the rim, the rim's."""
    height, width = grey.shape
    x, y = np.clip(x, 0.0, width - 1.001), np.clip(y, 0.0, height - 1.001)
    i, j = x.astype(np.int64), y.astype(np.int64)
    u, v = x - i, y - j
    flat, at = grey.ravel(), j * width + i
    near, right, below, opposite = (light[flat[at + step]] for step in (0, 1, width, width + 1))
    upper, lower = near + u * (right - near), below + u * (opposite - below)
    return np.asarray(upper + v * (lower - upper))


def _crossings(points: Array, contrast: Array) -> Array:
    """Return where lines through each side's points, (N, 4, P, 2), cross: (N, 4, 2)."""
    weights = np.minimum(contrast, np.median(contrast, axis=2, keepdims=True))
    lines = _lines(points, weights)
    off = np.abs((points * lines[:, :, None, :2]).sum(axis=3) + lines[..., 2:])
    # Where a shadow, dirt or a thing in front bends the edge it is left out.
    stray = off > 3.0 * np.median(off, axis=2, keepdims=True) + 1e-9
    lines = _lines(points, np.where(stray, 0.0, weights))
    crossed = np.cross(np.roll(lines, 1, axis=1), lines)
    return np.asarray(crossed[..., :2] / crossed[..., 2:])


def _lines(points: Array, weights: Array) -> Array:
    """Return the lines a x + b y + c = 0, (N, 4, 3), (a, b) of length 1, closest to points in least squares."""
    total = np.maximum(weights.sum(axis=2), 1e-9)[..., None]
    centre = (points * weights[..., None]).sum(axis=2) / total
    dx, dy = np.moveaxis(points - centre[:, :, None], 3, 0)
    xx, yy, xy = ((weights * product).sum(axis=2) for product in (dx * dx, dy * dy, dx * dy))
    angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    normal = np.stack([-np.sin(angle), np.cos(angle)], axis=2)
    return np.concatenate([normal, -(normal * centre).sum(axis=2, keepdims=True)], axis=2)
