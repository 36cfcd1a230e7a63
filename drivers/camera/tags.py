"""The five tags of the cube that stands on a pushed object, as sheets to print."""

from __future__ import annotations

import cv2
import numpy as np

from drivers.camera.picture import Pixels
from drivers.camera.sheet import INCH
from runtime.errors import PushlaneError

FACES = ("top", "front", "left", "back", "right")
"""The faces of the cube in the order of their ids: front is where the object's x points."""
MODULES = 8
"""of a face: six of the marker, and a white one around"""
_LARGEST = 30_000


class BadTags(PushlaneError):
    """Tags that cannot be drawn."""


def face(number: int, dictionary: str, cube: float, resolution: float) -> tuple[Pixels, float]:
    """Return a face with a thin frame to cut along, and the pixels that a metre has.

    Args:
        number: id of the tag. cube: m, side of the face. resolution: dots an inch, kept to a whole pixel a module.

    Raises:
        BadTags: there is no such dictionary or tag, or the picture would be too small or too large.
    """
    kind = getattr(cv2.aruco, dictionary, None)
    if not dictionary.startswith("DICT_") or not isinstance(kind, int):
        raise BadTags(f"no dictionary is called '{dictionary}'; expected one of OpenCV's, as DICT_4X4_50")
    markers = cv2.aruco.getPredefinedDictionary(kind)
    if int(markers.markerSize) + 4 != MODULES:
        raise BadTags(f"dictionary '{dictionary}' has markers of {markers.markerSize + 2} modules, expected 6")
    if not 0 <= number < len(markers.bytesList):
        raise BadTags(f"'{dictionary}' has no tag {number}; expected 0 to {len(markers.bytesList) - 1}")
    module = round(cube / MODULES / INCH * resolution)
    if module < 2 or module * MODULES > _LARGEST:
        raise BadTags(f"a face of {cube} m has {module * MODULES} pixels at {resolution:g} dots an inch")
    drawn = np.pad(cv2.aruco.generateImageMarker(markers, number, 6 * module), module, constant_values=255)
    for edge in (drawn[0], drawn[-1], drawn[:, 0], drawn[:, -1]):
        edge[:] = 128
    return drawn, module * MODULES / cube
