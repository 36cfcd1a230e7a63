"""ArUco and AprilTag markers in a grey image, with corners where the printed edges cross.

A corner of a marker is found where the lines through its two sides cross, not where the image looks most like a corner.
Blur and the area of a pixel round a corner towards its dark side, so that a corner refined on the image around it sits
0.1 to 0.5 pixel inside the marker, and a contour of dark pixels sits half a pixel inside, being drawn through their
middles. Either makes a tag look too small, and its range too long by a share that grows with the range. Away from its
ends the edge of a side is moved by neither.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from services.tracker.camera import Camera

Array = NDArray[np.float64]

_POINTS = 25
"""points of a side at which its edge is looked for"""
_STEPS = 15
"""samples across the edge at each"""
_REACH = 3.0
"""pixels looked at on each side of an edge, at most: what a sharp to slightly blurred edge takes"""
_ROUNDED = 1.5
"""pixels at each end of a side that the corner's rounding can reach"""
_ROUNDS = 3
"""times that the edge is looked for, each from where it was found before"""


class UnknownDictionary(ValueError):
    """A dictionary of markers that there is not."""


class NotGrey(ValueError):
    """A picture that is not one of grey bytes."""


@dataclass(frozen=True)
class Tags:
    """The markers of a picture.

    Attributes:
        ids: (N,), ascending.
        corners: (N, 4, 2), pixels: the marker's upper left, upper right, lower right and lower left as it is printed.
    """

    ids: NDArray[np.int64]
    corners: Array


def dictionaries() -> list[str]:
    """Return the names of the dictionaries there are."""
    return sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_"))


def dictionary(name: str) -> cv2.aruco.Dictionary:
    """Return the dictionary of a name, such as DICT_4X4_50 or DICT_APRILTAG_36h11.

    Raises:
        UnknownDictionary: there is none of this name.
    """
    known = dictionaries()
    if name not in known:
        raise UnknownDictionary(f"'{name}' is no dictionary of markers, expected one of {', '.join(known)}")
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


class Finder:
    """Finds the markers of one dictionary."""

    def __init__(self, markers: cv2.aruco.Dictionary, gamma: float = 2.2) -> None:
        """Look for `markers`, with a black border of one module, in pictures whose values are light ** (1 / gamma)."""
        options = cv2.aruco.DetectorParameters()
        options.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_NONE
        self._light = np.linspace(0.0, 1.0, 256) ** gamma
        self._modules = markers.markerSize + 2
        self._detector = cv2.aruco.ArucoDetector(markers, options)

    def find(self, grey: NDArray[np.uint8], camera: Camera | None = None) -> Tags:
        """Return the markers in a picture, (H, W).

        Args:
            grey: brightness, of whatever scale.
            camera: whose lens bent the edges; without it they are taken to be straight in the picture.

        Raises:
            NotGrey: the picture is another than (H, W) uint8.
        """
        if grey.ndim != 2 or grey.dtype != np.uint8:
            raise NotGrey(f"the picture is {grey.shape} {grey.dtype}, expected (H, W) uint8")
        rough, ids, _ = self._detector.detectMarkers(grey)
        if ids is None or not len(ids):
            return Tags(np.empty(0, np.int64), np.empty((0, 4, 2)))
        order = np.argsort(ids.ravel(), kind="stable")
        corners = np.array(rough, np.float64).reshape(-1, 4, 2)[order]
        return Tags(ids.ravel()[order].astype(np.int64), sharpen(self._light[grey], corners, self._modules, camera))


@cache
def finder(name: str) -> Finder:
    """Return the finder of the dictionary of this name.

    Raises:
        UnknownDictionary: there is none of this name.
    """
    return Finder(dictionary(name))


def sharpen(light: Array, corners: Array, modules: int, camera: Camera | None = None) -> Array:
    """Return where the edges of dark squares on light ground cross, (N, 4, 2), pixels.

    Args:
        light: (H, W), proportional to the light that each pixel took in.
        corners: (N, 4, 2), pixels, to about a pixel, clockwise in the picture.
        modules: of a side; dark and light are taken to be alike for one of them on both sides of an edge.
        camera: see `Finder.find`.
    """
    for _ in range(_ROUNDS):
        points, weights = _edges(light, corners, modules)
        if camera is not None and camera.distortion.any():
            straight = camera.rays(points.reshape(-1, 2)).reshape(*points.shape[:3], 3)[..., :2]
            crossed = _crossings(straight, weights)
            rays = np.concatenate([crossed, np.ones((*crossed.shape[:2], 1))], axis=2)
            corners = camera.project(rays.reshape(-1, 3)).reshape(corners.shape)
        else:
            corners = _crossings(points, weights)
    return corners


def _edges(light: Array, corners: Array, modules: int) -> tuple[Array, Array]:
    """Return points on the edges of squares, (N, 4, P, 2), pixels, and their weights, (N, 4, P), the contrast there."""
    following = np.roll(corners, -1, axis=1)
    side = following - corners
    length = np.maximum(np.linalg.norm(side, axis=2, keepdims=True), 1e-9)
    along = side / length
    outward = np.stack([along[..., 1], -along[..., 0]], axis=2)
    # A module's depth is that of the square behind this side, seen as slanting as it is.
    behind = [np.abs(np.sum((np.roll(corners, shift, axis=1) - corners) * outward, axis=2)) for shift in (1, -2)]
    depth = np.minimum(*behind)[..., None] / modules
    reach = np.clip(depth, 1.0, _REACH)
    trim = np.minimum(_ROUNDED, length / 4)
    s = trim + (length - 2 * trim) * np.linspace(0.0, 1.0, _POINTS)
    t = reach * np.linspace(-1.0, 1.0, _STEPS)
    feet = corners[:, :, None] + s[..., None] * along[:, :, None]
    profile = _sampled(light, feet[:, :, :, None] + t[:, :, None, :, None] * outward[:, :, None, None])
    # Outwards it gets lighter; where it gets darker another edge begins.
    rise = np.maximum(np.diff(profile, axis=3), 0.0)
    contrast = rise.sum(axis=3)
    middle = 0.5 * (t[..., 1:] + t[..., :-1])
    offset = (rise * middle[:, :, None]).sum(axis=3) / np.maximum(contrast, 1e-9)
    return feet + offset[..., None] * outward[:, :, None], contrast


def _sampled(light: Array, places: Array) -> Array:
    """Return the light at `places`, (..., 2), pixels, linear between pixels' middles; beyond the rim, the rim's."""
    height, width = light.shape
    x = np.clip(places[..., 0], 0.0, width - 1.001)
    y = np.clip(places[..., 1], 0.0, height - 1.001)
    i, j = x.astype(np.int64), y.astype(np.int64)
    u, v = x - i, y - j
    flat, at = light.ravel(), j * width + i
    upper = (1.0 - u) * flat[at] + u * flat[at + 1]
    lower = (1.0 - u) * flat[at + width] + u * flat[at + width + 1]
    return (1.0 - v) * upper + v * lower


def _crossings(points: Array, weights: Array) -> Array:
    """Return where lines through each side's points, (N, 4, P, 2) with weights (N, 4, P), cross: (N, 4, 2)."""
    weights = np.minimum(weights, np.median(weights, axis=2, keepdims=True))
    lines = _lines(points, weights)
    off = np.abs(np.einsum("nskc,nsc->nsk", points, lines[..., :2]) + lines[..., 2:])
    # What a shadow, dirt or a thing in front bends is left out once.
    stray = off > 3.0 * np.median(off, axis=2, keepdims=True) + 1e-9
    lines = _lines(points, np.where(stray, 0.0, weights))
    crossed = np.cross(np.roll(lines, 1, axis=1), lines)
    return crossed[..., :2] / crossed[..., 2:]


def _lines(points: Array, weights: Array) -> Array:
    """Return the lines a x + b y + c = 0, (N, 4, 3), (a, b) of length 1, of least squares through points."""
    total = np.maximum(weights.sum(axis=2, keepdims=True), 1e-9)
    centre = (points * weights[..., None]).sum(axis=2) / total
    d = points - centre[:, :, None]
    xx, yy, xy = (
        (weights * d[..., a] * d[..., b]).sum(axis=2) for a, b in ((0, 0), (1, 1), (0, 1))
    )
    angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    normal = np.stack([-np.sin(angle), np.cos(angle)], axis=2)
    return np.concatenate([normal, -(normal * centre).sum(axis=2, keepdims=True)], axis=2)
