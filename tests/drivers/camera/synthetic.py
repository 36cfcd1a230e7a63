"""Pictures of a board as a camera with known K and D takes them, by the formulas of the model themselves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.camera.board import Board

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]

_FINE = 2
_SIDE = 60


@dataclass(frozen=True)
class Lens:
    """A camera to take pictures with: x right, y down, z forward; pixels count from the middle of the first one."""

    width: int = 640
    height: int = 480
    fx: float = 520.0
    fy: float = 516.0
    cx: float = 326.5
    cy: float = 232.0
    distortion: tuple[float, float, float, float, float] = (-0.21, 0.06, 0.0012, -0.0016, 0.0)

    def bent(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return where the lens puts what would be at x, y (z = 1): Brown's model."""
        k1, k2, p1, p2, k3 = self.distortion
        r = x * x + y * y
        radial = 1 + r * (k1 + r * (k2 + r * k3))
        return (
            x * radial + 2 * p1 * x * y + p2 * (r + 2 * x * x),
            y * radial + p1 * (r + 2 * y * y) + 2 * p2 * x * y,
        )

    def straightened(self, u: Array, v: Array) -> tuple[Array, Array]:
        """Return x, y (z = 1) of pixels, by going backwards until `bent` gives them again."""
        to_x, to_y = (u - self.cx) / self.fx, (v - self.cy) / self.fy
        x, y = to_x, to_y
        for _ in range(30):
            bent_x, bent_y = self.bent(x, y)
            x, y = x + to_x - bent_x, y + to_y - bent_y
        return x, y


@dataclass(frozen=True)
class Pose:
    """Of a board: its middle at `at`, m, camera frame; turned by `turn`, a rotation vector, rad."""

    turn: tuple[float, float, float]
    at: tuple[float, float, float]


VIEWS = [
    Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.30)),
    Pose((0.5, 0.0, 0.0), (0.05, 0.05, 0.34)),
    Pose((-0.5, 0.1, 0.1), (-0.05, -0.04, 0.34)),
    Pose((0.1, 0.5, 0.0), (0.06, -0.05, 0.36)),
    Pose((0.0, -0.5, -0.1), (-0.07, 0.05, 0.36)),
    Pose((0.4, 0.4, 0.2), (0.08, 0.06, 0.42)),
    Pose((-0.4, 0.4, -0.2), (0.09, -0.07, 0.40)),
    Pose((0.4, -0.4, 0.3), (-0.09, 0.06, 0.40)),
    Pose((-0.4, -0.4, 0.0), (-0.09, -0.06, 0.42)),
    Pose((0.3, -0.3, 1.5), (0.0, 0.0, 0.40)),
]
"""A good set: near, tilted every way, into all corners."""


@cache
def rays(lens: Lens) -> tuple[Array, Array]:
    """Return x, y (z = 1) of all the finer pixels of `lens`."""
    step = (np.arange(_FINE) + 0.5) / _FINE - 0.5
    u = (np.arange(lens.width)[:, None] + step).ravel()
    v = (np.arange(lens.height)[:, None] + step).ravel()
    return lens.straightened(*np.meshgrid(u, v))


def photograph(lens: Lens, board: Board, pose: Pose, noise: float = 2.0, seed: int = 1) -> Pixels:
    """Return the picture, (height, width) grey, of a board on a grey wall; every pixel is the mean of finer ones."""
    texture = np.pad(board.drawn(_SIDE), _SIDE, constant_values=255)
    x, y = rays(lens)
    turn = cv2.Rodrigues(np.array(pose.turn))[0]
    # The ray s (x, y, 1) meets the board's plane where its part along the normal is that of the board's middle.
    normal = turn[:, 2]
    s = float(normal @ pose.at) / (normal[0] * x + normal[1] * y + normal[2])
    on_board = np.stack([s * x, s * y, s], axis=-1) - np.array(pose.at)
    middle = np.array([board.columns, board.rows]) * board.square / 2
    place = (on_board @ turn[:, :2] + middle) / board.square * _SIDE + _SIDE - 0.5
    fine = cv2.remap(
        texture,
        place[..., 0].astype(np.float32),
        place[..., 1].astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=120,
    )
    picture = fine.reshape(lens.height, _FINE, lens.width, _FINE).mean(axis=(1, 3))
    picture += np.random.default_rng(seed).normal(0, noise, picture.shape)
    return np.clip(picture, 0, 255).astype(np.uint8)


def in_camera(pose: Pose, board: Board, points: Array) -> Array:
    """Return points, (N, 3), m, board frame with its origin in the board's corner, in the camera's frame."""
    middle = np.array([board.columns, board.rows, 0]) * board.square / 2
    return (points - middle) @ cv2.Rodrigues(np.array(pose.turn))[0].T + np.array(pose.at)
