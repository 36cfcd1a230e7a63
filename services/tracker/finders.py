"""Ways to find the object in a picture: by its tags, by its depth, or because it looks other than the floor."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from services.tracker.config import TrackerConfig
from services.tracker.depth import things
from services.tracker.footprint import placed_by_top
from services.tracker.layout import cube
from services.tracker.outline import circle
from services.tracker.pose import Belief, standing
from services.tracker.region import Region, along_and_across
from services.tracker.segment import Sought, by_colour, continued, faced
from services.tracker.sight import placed
from services.tracker.tags import dictionary, finder
from services.vision.appearance import FloorModel
from services.vision.camera import Camera, Mount
from services.vision.derived import Derived
from services.vision.floor_view import Body, FloorView
from services.vision.plane import NoPlane
from services.vision.rising import DepthEye, support

Array = NDArray[np.float64]
Picture = NDArray[np.uint8] | NDArray[np.uint16]

_SHADOW = 0.3
"""m around the object where the floor is not learned: its top hides what is behind it"""
_GATE, _RUN = 0.12, 0.3
"""m that a thing may be off where the object should be, and m/s that it may be off more while it is not seen"""
_PART = 0.6
"""of its diameter from which on as much is seen of what is cut that it need not be placed by its top"""
_ALONG, _ACROSS = 0.03, 0.015
"""m, deviations of what is cut but of which nothing seems missing"""
_RIM = 0.01
"""m around the robot's own body that is taken for it in pictures of depths"""
_RESIZED = 0.12
"""m, of a diameter that is not believed"""
_SHARE = 0.1
"""of a picture in what is known of the object's height, at least"""
_LEAST, _LEAST_YAW = 0.0005, 0.002
"""m and rad, of one picture's tags: in full view they say less"""


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
        robot_diameter: d_r, m.
    """

    camera: Camera
    mount: Mount
    hint: Hint | None
    free: Array
    robot_diameter: float


@dataclass(frozen=True)
class Sighting:
    """An object as a picture shows it, base frame.

    Attributes:
        place: (2,), m, o. covariance: (2, 2), m^2.
        yaw: rad; None where it cannot be seen. yaw_variance: rad^2.
        diameter: m; 0 where it cannot be seen.
        doubt: (2, 2), m^2, what place may be off in picture after picture, since the mount and the tags are not exactly
            where they are said to be; yaw_doubt: rad^2.
        outlines: (N, 2) each, pixels, around what was found.
    """

    place: Array
    covariance: Array
    yaw: float | None = None
    yaw_variance: float = 0.0
    diameter: float = 0.0
    doubt: Array = field(default_factory=lambda: np.zeros((2, 2)))
    yaw_doubt: float = 0.0
    outlines: list[Array] = field(default_factory=list)


@dataclass
class Memory:
    """What a finder learns.

    Attributes:
        floor: how it looks.
        height: m, of the object, from `heights` pictures; 0: not known.
    """

    floor: FloorModel = field(default_factory=FloorModel)
    height: float = 0.0
    heights: int = 0


class TagFinder:
    """Finds an object that bears a cube of tags."""

    decoding = cv2.IMREAD_GRAYSCALE
    kind: tuple[object, ...] = (np.dtype(np.uint8),)

    def __init__(self, config: TrackerConfig) -> None:
        self._finder = finder(config.dictionary)
        modules = dictionary(config.dictionary).markerSize + 2
        side = config.cube * modules / (modules + 2)  # a quiet zone of a module on each side
        self._config = config
        ids = range(config.first_tag, config.first_tag + 5)
        self._layout = cube(ids, config.cube, side, config.height, config.cube_at)

    def find(self, picture: Picture, view: View, memory: Memory) -> Sighting | None:  # noqa: ARG002, all finders alike
        """Return the object in a grey picture, (H, W), uint8; None if no tag of it shows where it is."""
        tags = self._finder.find(np.asarray(picture, np.uint8), view.camera)
        config = self._config
        mount_error = (config.mount_off, config.mount_turned)
        found = standing(tags, self._layout, view.camera, view.mount, _belief(view.hint), mount_error=mount_error)
        if found is None:
            return None
        covariance = found.covariance + np.diag([_LEAST**2, _LEAST**2, _LEAST_YAW**2])
        own, (x, y, _) = self._layout.by_id(), config.cube_at
        outlines = []
        for name in found.used:
            corners = view.mount.to_camera(placed(own[name].corners(), found.pose))
            outlines.append(view.camera.project(corners))
        return Sighting(
            found.pose[:2],
            covariance[:2, :2],
            float(found.pose[2]),
            float(covariance[2, 2]),
            doubt=found.doubt[:2, :2] + np.eye(2) * (config.cube_off**2 + (x * x + y * y) * config.cube_turned**2),
            yaw_doubt=float(found.doubt[2, 2]) + config.cube_turned**2,
            outlines=outlines,
        )


class AppearanceFinder:
    """Finds an object without tags, because it looks other than the floor, which it learns where the laser passes."""

    decoding = cv2.IMREAD_COLOR
    kind: tuple[object, ...] = (3, np.dtype(np.uint8))

    def __init__(self, config: TrackerConfig) -> None:
        self._config = config
        self._sought = _sought(config)
        self._floor = Derived(self._made)

    def find(self, picture: Picture, view: View, memory: Memory) -> Sighting | None:
        """Return the object in a picture, (H, W, 3), uint8, BGR; None if nothing is where it can be."""
        floor = self._floor.of(view.camera, view.mount, view.robot_diameter)
        rgb = np.ascontiguousarray(np.asarray(picture, np.uint8)[..., ::-1])
        free = view.free
        if view.hint is not None:
            # Behind the object the laser passes over nothing of the floor that the camera sees.
            free = free[np.hypot(*(free - view.hint.place).T) > 0.5 * view.hint.diameter + _SHADOW]
        regions = by_colour(floor, memory.floor, rgb, free)
        region = _chosen(regions, self._sought, view.hint)
        if region is None:
            return None
        hint = view.hint
        hidden = region.cut and hint is not None and region.diameter < _PART * hint.diameter
        if hint is not None and hidden and memory.height > 0.0:
            region = placed_by_top(floor, region, memory.height, hint.diameter)
        elif region.height > 0.0 and not region.cut:
            share = max(_SHARE, 1.0 / (memory.heights + 1))
            memory.height += share * (region.height - memory.height)
            memory.heights += 1
        if hint is not None and not hidden:
            region = replace(region, centre=region.centre + _resized(region, hint, floor.below))
            if region.cut:
                region = replace(region, covariance=_of_part(region, hint, floor.below))
        return _sighting(region, view, self._config)

    def _made(self, camera: Camera, mount: Mount, diameter: float) -> FloorView:
        """Return what the pixels see of the floor."""
        return FloorView.of(camera, mount, Body(0.5 * diameter, self._config.base_height), self._config.furthest)


class DepthFinder:
    """Finds an object without tags in a picture of depths."""

    decoding = cv2.IMREAD_UNCHANGED
    kind: tuple[object, ...] = (np.dtype(np.uint16),)

    def __init__(self, config: TrackerConfig) -> None:
        self._config = config
        self._sought = _sought(config)
        self._eye = Derived(self._made)

    def find(self, picture: Picture, view: View, memory: Memory) -> Sighting | None:  # noqa: ARG002, all finders alike
        """Return the object in a picture of millimetres, (H, W), uint16; None if nothing is where it can be."""
        eye, body = self._eye.of(view.camera, view.mount, view.robot_diameter)
        depth = np.where(body, 0.0, np.asarray(picture, np.float64) / 1000.0)
        try:
            plane = support(eye, depth, view.mount)
        except NoPlane:
            return None
        region = _chosen(things(eye, depth, plane), self._sought, view.hint)
        return None if region is None else _sighting(region, view, self._config)

    def _made(self, camera: Camera, mount: Mount, diameter: float) -> tuple[DepthEye, NDArray[np.bool_]]:
        """Return the eye, and which pixels, (H, W), show the top of the robot's own body."""
        eye = DepthEye.of(camera)
        top = mount.on_plane(eye.rays.reshape(-1, 3), self._config.base_height)
        body = np.hypot(*top.T) < 0.5 * diameter + _RIM
        return eye, body.reshape(eye.rays.shape[:2])


def finder_of(config: TrackerConfig) -> TagFinder | AppearanceFinder | DepthFinder:
    """Return the finder that `config` asks for."""
    if config.finds == "tags":
        return TagFinder(config)
    return DepthFinder(config) if config.finds == "depth" else AppearanceFinder(config)


def _sought(config: TrackerConfig) -> Sought:
    return Sought(largest=config.largest)


def _chosen(regions: list[Region], sought: Sought, hint: Hint | None) -> Region | None:
    """Return the object among the things of a picture."""
    if hint is None:
        return faced(regions, sought)
    spread = 3.0 * math.sqrt(float(np.linalg.eigvalsh(hint.covariance)[-1]))
    return continued(regions, sought, hint.place, _GATE + spread + _RUN * hint.age)


def _resized(region: Region, hint: Hint, below: Array) -> Array:
    """Return how far the centre is off, (2,), m, if the object is as large as it was in many pictures before.

    Its near side is what a picture shows best, and how far behind that the other one is hangs on the height.
    """
    more = hint.diameter - region.diameter
    if region.cut:
        more = min(more, 0.0)  # what is hidden makes it smaller
    away = region.centre - below
    return np.asarray(0.5 * min(max(more, -_RESIZED), _RESIZED) * away / max(float(np.hypot(*away)), 1e-6))


def _of_part(region: Region, hint: Hint, below: Array) -> Array:
    """Return the covariance, (2, 2), m^2, of a thing of which a part is hidden, as large as it was seen before.

    What is missing of it may be at either side of what is seen.
    """
    missing = max(hint.diameter - region.diameter, 0.0) / 2.0
    return along_and_across(region.centre - below, math.hypot(_ALONG, missing), math.hypot(_ACROSS, missing))


def _sighting(region: Region, view: View, config: TrackerConfig) -> Sighting:
    outline = circle(region.centre, region.diameter, view.camera, view.mount)
    diameter = 0.0 if region.cut else region.diameter
    doubt = view.mount.doubt(np.array([*region.centre, 0.0]), config.mount_off, config.mount_turned)
    return Sighting(region.centre, region.covariance, diameter=diameter, doubt=doubt, outlines=[outline])


def _belief(hint: Hint | None) -> Belief | None:
    """Return what is expected, loosely: it is to choose between two poses of a tag, not to hold the object back."""
    if hint is None or hint.yaw is None:
        return None
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = hint.covariance + np.eye(2) * 0.05**2
    covariance[2, 2] = hint.yaw_variance + 0.2**2
    return Belief(np.array([*hint.place, hint.yaw]), covariance)
