"""A lens is undone exactly: what a ray is of a pixel, is seen at that pixel."""

from __future__ import annotations

import numpy as np
import pytest

from services.vision.camera import BadCalibration, Camera
from tests.services.tracker.pictures import camera
from tests.services.tracker.scenes import calibration_of


@pytest.mark.parametrize(
    "distortion",
    [(0.0,) * 5, (0.3, 0.1, 0.002, -0.001, 0.0), (-0.3, 0.1, 0.0, 0.0, 0.0), (-0.25, 0.09, 0.001, 0.0, -0.01)],
)
def test_rays_lead_back_to_their_pixels(distortion: tuple[float, ...]) -> None:
    bent = camera(distortion)
    pixels = np.stack(np.meshgrid(np.arange(0.0, 640.0, 21.3), np.arange(0.0, 480.0, 17.1)), axis=-1).reshape(-1, 2)
    np.testing.assert_allclose(bent.project(bent.rays(pixels)), pixels, atol=1e-6)


@pytest.mark.parametrize(("width", "height"), [(0, 0), (640, 0), (1, 1), (4, 480)])
def test_a_picture_of_next_to_nothing_is_no_cameras(width: int, height: int) -> None:
    said = calibration_of(Camera(camera().matrix, np.zeros(5), width, height))
    with pytest.raises(BadCalibration, match=f"{width} x {height} pixels, expected at least 8"):
        Camera.of(said)
