"""ArUco and AprilTag markers in a grey picture."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from services.tracker.edges import sharpen
from services.vision.camera import Camera

GAMMA = 2.2
"""what nearly every camera and renderer encodes its pictures with"""


_SAMPLES, _MARGIN = 8, 0.3
"""samples along a module, and the share at each of its sides that is not looked at, when a marker is read: with 4 and
0.13, which OpenCV takes, small ones were read wrongly (test_tags.py)"""


class UnknownDictionary(ValueError):
    """A dictionary of markers that there is not."""


class NotGrey(ValueError):
    """A picture that is not one of grey bytes."""


@dataclass(frozen=True)
class Tags:
    """The markers of a picture.

    Attributes:
        ids: (N,), ascending.
        corners: (N, 4, 2), pixels, those of the printed black square: upper left, upper right, lower right and lower
            left as the marker is printed. Pixels' middles are whole numbers.
    """

    ids: NDArray[np.int64]
    corners: NDArray[np.float64]


def dictionaries() -> list[str]:
    """Return the names of the dictionaries there are."""
    return sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_"))


def dictionary(name: str) -> cv2.aruco.Dictionary:
    """Return the dictionary of this name, such as DICT_4X4_50 or DICT_APRILTAG_36h11.

    Raises:
        UnknownDictionary: there is none.
    """
    known = dictionaries()
    if name not in known:
        raise UnknownDictionary(f"'{name}' is no dictionary of markers, expected one of {', '.join(known)}")
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


class Finder:
    """Finds the markers of one dictionary."""

    def __init__(self, markers: cv2.aruco.Dictionary, gamma: float = GAMMA) -> None:
        """Look for `markers`, with a black border of one module, in pictures whose values are light ** (1 / gamma)."""
        options = cv2.aruco.DetectorParameters()
        options.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_NONE
        options.perspectiveRemovePixelPerCell = _SAMPLES
        options.perspectiveRemoveIgnoredMarginPerCell = _MARGIN
        self._detector = cv2.aruco.ArucoDetector(markers, options)
        self._modules = int(markers.markerSize) + 2
        self._light = np.linspace(0.0, 1.0, 256) ** gamma

    def find(self, grey: NDArray[np.uint8], camera: Camera | None = None) -> Tags:
        """Return the markers in a picture, (H, W).

        Args:
            grey: (H, W).
            camera: whose lens bends edges; without it they are taken to be straight in the picture.

        Raises:
            NotGrey: the picture is another than (H, W) uint8.
        """
        if grey.ndim != 2 or grey.dtype != np.uint8:
            raise NotGrey(f"the picture is {grey.shape} {grey.dtype}, expected (H, W) uint8")
        rough, ids, _ = self._detector.detectMarkers(grey)
        if ids is None or not len(ids):
            return Tags(np.empty(0, np.int64), np.empty((0, 4, 2)))
        order = np.argsort(ids.ravel(), kind="stable")
        about = np.array(rough, np.float64).reshape(-1, 4, 2)[order]
        corners = sharpen(grey, self._light, about, self._modules, camera)
        # An edge a module away from where the marker was read is that of something else.
        module = np.linalg.norm(np.roll(about, -1, axis=1) - about, axis=2).max(axis=1) / self._modules
        own = np.linalg.norm(corners - about, axis=2).max(axis=1) < np.maximum(module, 2.0)
        return Tags(ids.ravel()[order][own].astype(np.int64), corners[own])


@cache
def finder(name: str) -> Finder:
    """Return the finder for the dictionary of this name, and for pictures as cameras encode them.

    Raises:
        UnknownDictionary: there is none.
    """
    return Finder(dictionary(name))
