"""What the tracker saw, as lines on the picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from google.protobuf.timestamp_pb2 import Timestamp
from numpy.typing import NDArray

from runtime.messages import ImageAnnotations, PointsAnnotation
from services.vision.camera import Camera, Mount

Array = NDArray[np.float64]

_COLOUR = (0.0, 0.62, 0.45, 1.0)
_THICKNESS = 2.0
_POINTS = 48


def circle(centre: Array, diameter: float, camera: Camera, mount: Mount) -> Array:
    """Return a circle on the floor, (N, 2), pixels.

    Args:
        centre: (2,), m, base frame. diameter: m.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, _POINTS, endpoint=False)
    rim = centre + 0.5 * diameter * np.column_stack([np.cos(angle), np.sin(angle)])
    points = mount.to_camera(np.column_stack([rim, np.zeros(_POINTS)]))
    return camera.project(points[points[:, 2] > 0.01])


def lines(outlines: Sequence[Array], stamp: Timestamp) -> ImageAnnotations:
    """Return closed lines through `outlines`, (N, 2) each, pixels."""
    found = ImageAnnotations()
    for outline in outlines:
        if not len(outline):
            continue
        line = found.points.add(type=PointsAnnotation.LINE_LOOP, thickness=_THICKNESS)
        line.timestamp.CopyFrom(stamp)
        line.outline_color.r, line.outline_color.g, line.outline_color.b, line.outline_color.a = _COLOUR
        for u, v in outline:
            line.points.add(x=u, y=v)
    return found
