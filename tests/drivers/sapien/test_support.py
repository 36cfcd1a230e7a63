from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.sapien.shapes import Box, Disc
from drivers.sapien.support import Area, SupportError, area, loads


def test_disc_quadrature_has_the_area_and_gyration_of_a_disc() -> None:
    covered = area((Disc(x=0.1, y=-0.2, radius=0.15),))
    assert covered.weight.sum() == pytest.approx(np.pi * 0.15**2)
    assert covered.centroid() == pytest.approx([0.1, -0.2])
    assert covered.gyration() == pytest.approx(0.15 / np.sqrt(2))


def test_box_quadrature_has_the_area_and_gyration_of_a_box() -> None:
    covered = area((Box(x=0.1, y=-0.2, yaw=0.7, length=0.3, width=0.1),))
    assert covered.weight.sum() == pytest.approx(0.03)
    assert covered.centroid() == pytest.approx([0.1, -0.2])
    assert covered.gyration() == pytest.approx(np.sqrt((0.3**2 + 0.1**2) / 12))


def test_overlapping_parts_count_the_floor_once() -> None:
    """A plus of two bars: 0.3 x 0.1 twice, less the middle square."""
    plus = (Box(length=0.3, width=0.1), Box(length=0.1, width=0.3))
    assert area(plus).weight.sum() == pytest.approx(0.05, rel=0.15)
    assert area(plus).centroid() == pytest.approx([0.0, 0.0], abs=1e-12)


@given(st.floats(-0.1, 0.1), st.floats(-0.06, 0.06))
def test_loads_carry_the_weight_at_the_centre_of_mass(x: float, y: float) -> None:
    covered = area((Box(length=0.3, width=0.2),))
    centre = np.array([x, y])
    share = loads(covered, centre)
    assert share.min() >= 0
    assert share.sum() == pytest.approx(1.0)
    assert share @ covered.position == pytest.approx(centre, abs=1e-8)


def test_loads_of_a_centred_mass_are_uniform_pressure() -> None:
    covered = area((Disc(radius=0.2),))
    assert loads(covered, np.zeros(2)) == pytest.approx(covered.weight / covered.weight.sum())


def test_loads_of_three_wheels_are_those_of_statics() -> None:
    """Moments about the axle of the front wheels and about the long axis leave one answer."""
    wheels = Area(np.array([[0.1, 0.1], [0.1, -0.1], [-0.2, 0.0]]), np.ones(3))
    assert loads(wheels, np.array([0.04, 0.0])) == pytest.approx([0.4, 0.4, 0.2])
    assert loads(wheels, np.array([0.1, 0.05])) == pytest.approx([0.75, 0.25, 0.0], abs=1e-9)


@pytest.mark.parametrize("centre", [(0.16, 0.0), (0.0, -0.11), (1.0, 1.0)])
def test_centre_of_mass_outside_the_support_is_refused(centre: tuple[float, float]) -> None:
    with pytest.raises(SupportError, match="outside the hull"):
        loads(area((Box(length=0.3, width=0.2),)), np.array(centre))
