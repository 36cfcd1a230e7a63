"""What a mount that is a little off does to places on the floor, against mounts drawn anew."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from services.vision.camera import Mount
from tests.services.tracker.scenes import mount


@pytest.mark.parametrize("point", [(0.4, 0.1, 0.0), (2.0, -0.6, 0.0), (1.2, 0.3, 0.3)])
@pytest.mark.parametrize(("off", "turned"), [(0.004, 0.0), (0.0, 0.004), (0.003, 0.002)])
def test_the_doubt_is_the_spread_over_mounts(point: tuple[float, float, float], off: float, turned: float) -> None:
    """4000 mounts: deviations within 5 % and no correlation off by more than 0.05; by chance they are 1 % off."""
    random, said, at = np.random.default_rng(1), mount(), np.array(point)
    places = []
    for _ in range(4000):
        turn = cv2.Rodrigues(turned * random.standard_normal(3))[0]
        real = Mount(turn @ said.rotation, said.position + off * random.standard_normal(3))
        seen = real.to_camera(at[None])
        places.append(said.on_plane(seen / seen[:, 2:], point[2])[0])
    drawn, told = np.cov(np.array(places).T), said.doubt(at, off, turned)
    spread = np.sqrt(np.diag(drawn))
    assert np.sqrt(np.diag(told)) == pytest.approx(spread, rel=0.05)
    assert told[0, 1] / np.prod(spread) == pytest.approx(drawn[0, 1] / np.prod(spread), abs=0.05)


def test_what_is_not_below_the_camera_has_no_place_on_a_plane() -> None:
    assert not mount().doubt(np.array([1.0, 0.0, 0.9]), 0.01, 0.01).any()
