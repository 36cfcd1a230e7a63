import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.geometry.angles import DegenerateDirection, difference, direction, wrap

finite = st.floats(-1e4, 1e4)


@given(finite)
def test_wrap_keeps_the_direction_and_the_range(angle: float) -> None:
    wrapped = wrap(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


@given(finite)
def test_wrap_is_idempotent(angle: float) -> None:
    assert wrap(wrap(angle)) == wrap(angle)


@pytest.mark.parametrize(
    ("angle", "wrapped"), [(math.pi, math.pi), (-math.pi, math.pi), (0.0, 0.0), (math.tau, 0.0), (1.0, 1.0)]
)
def test_wrap_at_its_ends(angle: float, wrapped: float) -> None:
    assert wrap(angle) == wrapped


@given(finite, finite)
def test_difference_is_the_angle_of_the_quotient_of_phasors(a: float, b: float) -> None:
    quotient = np.exp(1j * a) / np.exp(1j * b)
    assert np.exp(1j * difference(a, b)) == pytest.approx(quotient, abs=1e-9)


def test_direction_of_a_point_to_itself_is_refused() -> None:
    assert direction(np.zeros(2), np.array((0.0, 2.0))) == pytest.approx(math.pi / 2)
    assert direction(np.zeros(2), np.array((-1.0, -0.0))) == math.pi
    with pytest.raises(DegenerateDirection):
        direction(np.ones(2), np.ones(2))
