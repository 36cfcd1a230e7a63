"""The drawing that /sensorimage gives: bumper and infra-red sensors from above, front up, as a PNG."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, sin

import cv2
import numpy as np

from drivers.robotino.infrared import bearings

_SIZE = 240
_BODY = 60
_SCALE = 120.0
"""pixels per m, of what the sensors see"""


def drawn(distances: Sequence[float], bumper: bool) -> bytes:
    """Return the drawing.

    Args:
        distances: (9,) m, the first one in front, the others counter-clockwise.
        bumper: pressed; the ring is red then.
    """
    image = np.full((_SIZE, _SIZE, 3), 255, np.uint8)
    middle = _SIZE // 2
    for bearing, distance in zip(bearings(), distances, strict=True):
        ends = [
            (round(middle - radius * sin(bearing)), round(middle - radius * cos(bearing)))
            for radius in (_BODY, _BODY + _SCALE * distance)
        ]
        cv2.line(image, ends[0], ends[1], (200, 120, 0), 3)
    cv2.circle(image, (middle, middle), _BODY, (0, 0, 220) if bumper else (90, 90, 90), 4)
    return bytes(cv2.imencode(".png", image)[1])
