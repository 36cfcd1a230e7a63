"""What mapping makes of stretches of floor: where they end, and which of them end at the pushed object."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from runtime.messages import SeenFloor, Vector2
from services.mapping.floor import BadFloor, Seen

BELOW = Vector2(x=0.12, y=0.03)


def seen(*rows: tuple[float, float, float, bool]) -> Seen:
    """Return stretches of bearing, first, last and met."""
    bearing, first, last, met = zip(*rows, strict=True)
    return Seen.of(SeenFloor(position=BELOW, bearing=bearing, first=first, last=last, met=met))


def test_columns_that_do_not_fit_together_are_refused() -> None:
    with pytest.raises(BadFloor, match=r"\[2, 1, 1, 1\]"):
        Seen.of(SeenFloor(position=BELOW, bearing=[0.1, 0.2], first=[0.1], last=[1.0], met=[True]))
    for first, last in ((1.0, 0.5), (-0.1, 0.5)):
        with pytest.raises(BadFloor, match="begins"):
            seen((0.0, first, last, True))
    with pytest.raises(BadFloor, match="1e\\+06 m from the base"):
        seen((0.0, 1.0, 1e6, False))
    with pytest.raises(BadFloor, match="99 m from the base"):
        Seen.of(SeenFloor(position=Vector2(x=-99.0)))


@given(st.floats(-3.0, 3.0), st.floats(0.1, 1.0), st.floats(0.0, 1.5), st.floats(-3.0, 3.0), st.floats(0.1, 0.5))
def test_stretches_end_on_the_map_where_they_end(
    bearing: float, first: float, length: float, theta: float, by: float
) -> None:
    assume(abs(length - by) > 1e-6)  # the message's numbers are of 32 bits
    one = seen((bearing, first, first + length, True))
    x, y = BELOW.x + (first + length) * math.cos(bearing), BELOW.y + (first + length) * math.sin(bearing)
    c, s = math.cos(theta), math.sin(theta)
    expected = [[1.0 + c * x - s * y, 2.0 + s * x + c * y]]
    assert np.allclose(one.on_map(np.array((1.0, 2.0, theta))), expected, atol=1e-6)
    less = one.shortened(np.array([True]), by)
    assert len(less.met) == (length > by)
    for last, begun in zip(less.lasts, less.firsts, strict=True):
        assert math.dist(last, begun) == pytest.approx(length - by, abs=1e-6)
    assert not less.met.any()
    kept = one.shortened(np.array([False]), by)
    assert np.array_equal(kept.lasts, one.lasts)
    assert kept.met.all()


@given(st.floats(0.35, 0.8), st.floats(-0.3, 0.3), st.floats(0.05, 0.3), st.floats(0.0, 1.0), st.floats(0.0, 0.35))
def test_a_thing_and_the_picture_of_its_top_are_told_from_what_stands_behind(
    distance: float, bearing: float, radius: float, share: float, height: float
) -> None:
    """Of a thing below a camera 1 m high: its outline, and its top, which is seen 1 / (1 - h) times as far."""
    way = np.array([math.cos(bearing), math.sin(bearing)])
    centre = (BELOW.x, BELOW.y) + distance * way
    turn = math.tau * share
    rim = centre + radius * np.array([math.cos(turn), math.sin(turn)])
    off = (rim - (BELOW.x, BELOW.y)) / (1.0 - height)
    far, towards = float(np.hypot(*off)), math.atan2(off[1], off[0])
    behind = 1.7 * (distance + radius) + 0.05
    found = seen((towards, 0.0, far, True), (bearing, 0.0, behind, True), (bearing + math.pi, 0.0, 0.4, True))
    assert found.of_thing(centre, radius + 1e-4).tolist() == [True, False, radius > distance + 0.4 - 1e-4]
