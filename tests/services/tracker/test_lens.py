"""A lens is undone exactly: what a ray is of a pixel, is seen at that pixel."""

from __future__ import annotations

import numpy as np
import pytest

from tests.services.tracker.pictures import camera


@pytest.mark.parametrize(
    "distortion",
    [(0.0,) * 5, (0.3, 0.1, 0.002, -0.001, 0.0), (-0.3, 0.1, 0.0, 0.0, 0.0), (-0.25, 0.09, 0.001, 0.0, -0.01)],
)
def test_rays_lead_back_to_their_pixels(distortion: tuple[float, ...]) -> None:
    bent = camera(distortion)
    pixels = np.stack(np.meshgrid(np.arange(0.0, 640.0, 21.3), np.arange(0.0, 480.0, 17.1)), axis=-1).reshape(-1, 2)
    np.testing.assert_allclose(bent.project(bent.rays(pixels)), pixels, atol=1e-6)
