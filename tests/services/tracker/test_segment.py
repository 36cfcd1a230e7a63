"""Which thing is taken for the object: rules on regions made by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.tracker.region import Region, along_and_across
from services.tracker.segment import Sought, continued, faced

SOUGHT = Sought()


def region(x: float, y: float, diameter: float = 0.3, cut: bool = False) -> Region:
    return Region(np.array([x, y]), diameter, np.eye(2) * 1e-4, math.hypot(x, y) - diameter / 2, 0.0, 0.2, 500, cut)


def test_what_is_straight_ahead_is_the_object() -> None:
    far, near, aside = region(2.0, 0.0), region(1.2, 0.3), region(0.5, 0.8)
    assert faced([near, aside, far], SOUGHT) is far
    # Nobody aims to the centimetre.
    assert faced([region(2.0, 0.0), near_by := region(1.0, 0.1)], SOUGHT) is near_by


def test_of_two_ahead_the_nearer_one_is_by_the_side_that_faces_the_robot() -> None:
    small, large = region(1.0, 0.0, 0.14), region(1.1, 0.02, 0.6)
    assert faced([small, large], SOUGHT) is large


@pytest.mark.parametrize(
    "other",
    [region(1.0, 0.0, 0.8), region(1.0, 0.0, 0.05), region(1.0, 0.0, cut=True), region(1.0, 0.6), region(2.8, 0.0)],
    ids=["too large", "too small", "cut", "outside the cone", "too far"],
)
def test_what_cannot_be_the_object_is_left(other: Region) -> None:
    assert faced([other], SOUGHT) is None
    behind = region(2.5, 0.0)
    assert faced([other, behind], SOUGHT) is behind


def test_the_expected_one_goes_before_the_nearest() -> None:
    near, held = region(0.8, 0.0), region(1.5, 0.4)
    assert continued([near, held], SOUGHT, np.array([1.45, 0.4]), 0.2) is held


def test_a_cut_one_can_be_continued() -> None:
    cut = region(0.5, 0.0, 0.05, cut=True)
    assert continued([cut], SOUGHT, np.array([0.45, 0.0]), 0.2) is cut


def test_outside_the_gate_there_is_none() -> None:
    assert continued([region(1.0, 0.0)], SOUGHT, np.array([1.0, 0.21]), 0.2) is None
    assert continued([region(1.0, 0.0, 0.9)], SOUGHT, np.array([1.0, 0.0]), 0.2) is None
    assert continued([], SOUGHT, np.zeros(2), 0.2) is None
    assert faced([], SOUGHT) is None


@given(st.lists(st.tuples(st.floats(-3, 3), st.floats(-3, 3)), max_size=8), st.floats(-3, 3), st.floats(-3, 3))
def test_the_one_continued_is_the_closest(places: list[tuple[float, float]], x: float, y: float) -> None:
    found = continued([region(*at) for at in places], SOUGHT, np.array([x, y]), 1.0)
    off = [math.dist(at, (x, y)) for at in places]
    if not off or min(off) > 1.0:
        assert found is None
    else:
        assert found is not None
        assert math.dist(found.centre, (x, y)) == pytest.approx(min(off))


@given(st.floats(-3.1, 3.1), st.floats(0.01, 1.0), st.floats(0.01, 1.0))
def test_a_covariance_has_its_deviations_along_and_across(angle: float, along: float, across: float) -> None:
    towards = 2.0 * np.array([math.cos(angle), math.sin(angle)])
    covariance = along_and_across(towards, along, across)
    e, n = towards / 2.0, np.array([-towards[1], towards[0]]) / 2.0
    assert e @ covariance @ e == pytest.approx(along**2)
    assert n @ covariance @ n == pytest.approx(across**2)
    assert e @ covariance @ n == pytest.approx(0.0, abs=1e-12)
