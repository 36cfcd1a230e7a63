"""Pictures of a marker whose corners are known exactly, and what tests of tags share."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from services.tracker.layout import Layout
from services.tracker.tags import Tags, dictionary
from services.vision.camera import Camera, Mount

Array = NDArray[np.float64]

FINE = 8
"""samples of a pixel along each axis"""


def camera(distortion: tuple[float, ...] = (0.0,) * 5) -> Camera:
    """Return a camera of 640 x 480 pixels that sees 60 degrees from top to bottom."""
    focal = 240.0 / np.tan(np.radians(30.0))
    return Camera(np.array([[focal, 0, 319.5], [0, focal, 239.5], [0, 0, 1.0]]), np.array(distortion), 640, 480)


def mount(pitch: float = 45.0, height: float = 0.9) -> Mount:
    """Return a mount that looks ahead and `pitch`, degrees, down, `height`, m, above the floor."""
    c, s = np.cos(np.radians(pitch)), np.sin(np.radians(pitch))
    return Mount(np.array([[0.0, -s, c], [-1.0, 0.0, 0.0], [0.0, -c, -s]]), np.array([0.1, 0.0, height]))


def facing(turn: tuple[float, float, float]) -> Array:
    """Return the rotation of a tag, to the camera's frame, that is turned from facing the camera by a vector, rad."""
    return np.asarray(cv2.Rodrigues(np.array(turn, np.float64))[0] @ np.diag([1.0, -1.0, -1.0]))


def picture(
    camera: Camera, rotation: Array, position: Array, side: float,
    name: str = "DICT_4X4_50", id: int = 3, blur: float = 0.5, gamma: float = 2.2, noise: float = 0.0,
) -> NDArray[np.uint8]:  # fmt: skip
    """Return a picture of a marker with a quiet zone of one module: what light falls on each pixel's area, encoded.

    Args:
        camera: a window around the marker is drawn, the rest is as the ground.
        rotation, position, side: of the marker, camera frame, m.
        blur: pixels, standard deviation of the lens' blur.
        noise: grey levels.
    """
    markers = dictionary(name)
    modules = markers.markerSize + 2
    print_ = np.pad(markers.generateImageMarker(id, modules, borderBits=1), 1, constant_values=255)
    light = np.full((camera.height, camera.width), 0.2)
    half = side * (0.5 + 1.0 / modules)
    rim = np.array([[x, y, 0.0] for x in (-half, 0, half) for y in (-half, 0, half)])
    seen = camera.project(rim @ rotation.T + position)
    low = np.maximum(np.floor(seen.min(axis=0)).astype(int) - 8, 0)
    high = np.minimum(np.ceil(seen.max(axis=0)).astype(int) + 9, [camera.width, camera.height])
    inside = (np.arange(FINE) + 0.5) / FINE - 0.5
    x, y = ((np.arange(a, b)[:, None] + inside).ravel() for a, b in zip(low, high, strict=True))
    rays = camera.rays(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
    # Where a ray meets the marker's plane, in its frame.
    far = (rotation[:, 2] @ position) / (rays @ rotation[:, 2])
    spot = (rays * far[:, None] - position) @ rotation
    column = np.floor((spot[:, 0] + half) / side * modules).astype(int)
    row = np.floor((half - spot[:, 1]) / side * modules).astype(int)
    on = (column >= 0) & (row >= 0) & (column < modules + 2) & (row < modules + 2)
    flat = np.full(len(rays), 0.2)
    flat[on] = np.where(print_[row[on], column[on]] > 0, 0.8, 0.02)
    fine = flat.reshape(len(y), len(x))
    if blur:
        fine = cv2.GaussianBlur(fine, (0, 0), blur * FINE, borderType=cv2.BORDER_REPLICATE)
    window = fine.reshape(len(y) // FINE, FINE, len(x) // FINE, FINE).mean(axis=(1, 3))
    light[low[1] : high[1], low[0] : high[0]] = window
    grey = 255.0 * light ** (1.0 / gamma) + np.random.default_rng(0).normal(0.0, max(noise, 1e-9), light.shape)
    return np.clip(np.round(grey), 0, 255).astype(np.uint8)


def seen(layout: Layout, pose: Array, camera: Camera, mount: Mount, only: tuple[int, ...] | None = None) -> Tags:
    """Return the tags of an object on the floor that face the camera and are in its picture, exactly.

    Args:
        pose: (3,), x, y, yaw, base frame.
        only: ids; those of all tags without it.
    """
    c, s = np.cos(pose[2]), np.sin(pose[2])
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    ids, corners = [], []
    for tag in layout.tags:
        points = tag.corners() @ turn.T + [pose[0], pose[1], 0.0]
        sight = mount.position - points.mean(axis=0)
        if only is not None and tag.id not in only:
            continue
        if (turn @ tag.rotation[:, 2]) @ sight < 0.2 * np.linalg.norm(sight):
            continue
        pixels = camera.project(mount.to_camera(points))
        if (pixels > 0).all() and (pixels < [camera.width - 1, camera.height - 1]).all():
            ids.append(tag.id)
            corners.append(pixels)
    return Tags(np.array(ids, np.int64), np.array(corners, np.float64).reshape(-1, 4, 2))
