"""Ways to find the object in a picture: by its tags, by its depth, or because it looks other than the floor."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from services.tracker.camera import Camera, Mount
from services.tracker.config import TrackerConfig
from services.tracker.layout import cube
from services.tracker.pose import Belief, standing
from services.tracker.sight import placed
from services.tracker.tags import dictionary, finder

Array = NDArray[np.float64]
Picture = NDArray[np.uint8] | NDArray[np.uint16]

_LEAST = 0.002
"""m, of the layout and the calibration: tags in full view say less than a millimetre"""
_LEAST_YAW = 0.01
"""rad"""


@dataclass(frozen=True)
class Hint:
    """Where the object should be, base frame.

    Attributes:
        place: (2,), m; covariance: (2, 2), m^2.
        yaw: rad; None if it was never seen. yaw_variance: rad^2.
        diameter: m.
        age: s since it was seen.
    """

    place: Array
    covariance: Array
    yaw: float | None
    yaw_variance: float
    diameter: float
    age: float


@dataclass(frozen=True)
class View:
    """From where a picture was taken.

    Attributes:
        hint: None before the object was seen.
        free: (N, 2), m, base frame: places that are floor.
    """

    camera: Camera
    mount: Mount
    hint: Hint | None
    free: Array


@dataclass(frozen=True)
class Sighting:
    """An object as a picture shows it, base frame.

    Attributes:
        place: (2,), m, o. covariance: (2, 2), m^2.
        yaw: rad; None where it cannot be seen. yaw_variance: rad^2.
        diameter: m; 0 where it cannot be seen.
        outlines: (N, 2) each, pixels, around what was found.
    """

    place: Array
    covariance: Array
    yaw: float | None = None
    yaw_variance: float = 0.0
    diameter: float = 0.0
    outlines: list[Array] = field(default_factory=list)


class TagFinder:
    """Finds an object that bears a cube of tags."""

    decoding = cv2.IMREAD_GRAYSCALE

    def __init__(self, config: TrackerConfig) -> None:
        self._finder = finder(config.dictionary)
        modules = dictionary(config.dictionary).markerSize + 2
        side = config.cube * modules / (modules + 2)  # a quiet zone of a module on each side
        self._layout = cube(range(config.first_tag, config.first_tag + 5), config.cube, side, config.height)

    def find(self, picture: Picture, view: View) -> Sighting | None:
        """Return the object in a grey picture, (H, W), uint8; None if no tag of it shows where it is."""
        tags = self._finder.find(np.asarray(picture, np.uint8), view.camera)
        found = standing(tags, self._layout, view.camera, view.mount, _belief(view.hint))
        if found is None:
            return None
        covariance = found.covariance + np.diag([_LEAST**2, _LEAST**2, _LEAST_YAW**2])
        own = self._layout.by_id()
        outlines = []
        for name in found.used:
            corners = view.mount.to_camera(placed(own[name].corners(), found.pose))
            outlines.append(view.camera.project(corners))
        return Sighting(
            found.pose[:2], covariance[:2, :2], float(found.pose[2]), float(covariance[2, 2]), outlines=outlines
        )


def _belief(hint: Hint | None) -> Belief | None:
    """Return what is expected, loosely: it is to choose between two poses of a tag, not to hold the object back."""
    if hint is None or hint.yaw is None:
        return None
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = hint.covariance + np.eye(2) * 0.05**2
    covariance[2, 2] = hint.yaw_variance + 0.2**2
    return Belief(np.array([*hint.place, hint.yaw]), covariance)
