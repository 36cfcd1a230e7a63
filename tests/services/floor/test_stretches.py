"""Stretches of floor in pictures that are made by following each pixel's ray: where the floor is, by equation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from services.floor.stretches import STEP, TURN, Fan, Stretches, stretches
from services.vision.camera import Camera
from services.vision.floor_view import Body, FloorView
from services.vision.rising import DepthEye, rising
from tests.services.tracker.scenes import Thing, camera, cast, measured, mount

CAMERA, MOUNT = camera(), mount()
HEIGHT = 0.9
FURTHEST = 2.5
VIEW = FloorView.of(CAMERA, MOUNT, Body(0.225, 0.25), FURTHEST)
FAN = Fan.of(VIEW, FURTHEST)


def seen(things: list[Thing]) -> Stretches:
    """Return the stretches around things, told from the floor without fault."""
    shown = cast(CAMERA, MOUNT, things)[1]
    return stretches(FAN, shown[::2, ::2] > 0, VIEW.looked)


def ends(found: Stretches) -> NDArray[np.float64]:
    """Return where something is met, (N, 2), m, base frame."""
    way = np.column_stack([np.cos(found.bearing), np.sin(found.bearing)])
    return np.asarray((VIEW.below + found.last[:, None] * way)[found.met])


def straight(found: Stretches) -> list[tuple[float, float, bool]]:
    """Return first, last and met of the stretches straight ahead."""
    k = np.abs(found.bearing) < TURN
    ahead = found.bearing[k].min()
    k = found.bearing == ahead
    return [(float(a), float(b), bool(m)) for a, b, m in zip(found.first[k], found.last[k], found.met[k], strict=True)]


def test_an_empty_floor_is_seen_as_far_as_is_looked_and_meets_nothing() -> None:
    found = seen([])
    assert not found.met.any()
    assert straight(found)[-1][1] == pytest.approx(FURTHEST, abs=2 * STEP)


def test_a_thing_is_met_at_its_foot_and_the_floor_begins_anew_behind_its_picture() -> None:
    near, far, height = 0.8, 1.0, 0.2
    first, second = straight(seen([Thing(0.9, 0.0, 0.2, 0.2, height=height)]))
    below = float(VIEW.below[0])
    assert first[1] == pytest.approx(near - below, abs=1.5 * STEP)
    assert first[2]
    # Its top's far edge is seen on the floor 1 / (1 - h / H) times as far from below the camera.
    assert second[0] == pytest.approx((far - below) / (1.0 - height / HEIGHT), abs=2.5 * STEP)
    assert not second[2]


def test_what_stands_behind_a_low_thing_is_seen_over_it() -> None:
    low, behind = Thing(0.7, 0.0, 0.25, height=0.25), Thing(1.7, 0.0, 0.2, height=0.3)
    met = ends(seen([low, behind]))
    off = np.hypot(*(met - [behind.x, behind.y]).T)
    assert (np.abs(off - 0.1) < 0.03).sum() >= 4
    # A beam close to the floor, at the height of a laser, ends at the low one: it is wider, seen from the base.
    assert math.atan2(0.1, 1.6) < math.atan2(0.125, 0.7)


@settings(deadline=None)
@example(0.6015625, 0.0, 0.080078125, 0.5, -1.6171875, 0.4375)
@given(
    st.floats(0.6, 2.2), st.floats(-0.8, 0.8), st.floats(0.08, 0.5), st.floats(0.08, 0.5), st.floats(-3.0, 3.0),
    st.floats(0.05, 0.6),
)  # fmt: skip
def test_no_floor_is_seen_in_a_thing_and_what_is_met_is_its_outline(
    x: float, y: float, length: float, width: float, yaw: float, height: float
) -> None:
    found = seen([Thing(x, y, length, width, yaw, height)])
    c, s = math.cos(yaw), math.sin(yaw)

    def inside(at: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far in the thing places, (N, 2), are, m."""
        own = np.abs((at - [x, y]) @ np.array([[c, -s], [s, c]]))
        return np.asarray(np.minimum(length / 2 - own[:, 0], width / 2 - own[:, 1]))

    way = np.column_stack([np.cos(found.bearing), np.sin(found.bearing)])
    pixel = 2.0 * (FURTHEST**2 + HEIGHT**2) / (HEIGHT * float(CAMERA.matrix[1, 1]))
    for share in np.linspace(0.0, 1.0, 9):
        along = found.first + share * (found.last - found.first)
        # A place is drawn where the pixel is that looks at it.
        assert inside(VIEW.below + along[:, None] * way).max(initial=-1.0) < pixel
    off, far = np.abs(inside(ends(found))), found.last[found.met]
    # At an upright edge, seen along one bearing at either side, it may be met farther off: at most where the floor is
    # seen past its top, which is at near / (1 - h / H).
    assert (off < max(0.16, height / HEIGHT) * far + STEP).all()
    assert (off >= pixel + STEP).sum() <= 2


def test_pixels_told_wrongly_one_by_one_are_no_thing() -> None:
    shown = np.zeros_like(VIEW.looked)
    shown[::7, ::5] = True
    assert not stretches(FAN, shown, VIEW.looked).met.any()
    # Nor is what is seen of the floor between two things that touch each other in the picture a way between them.
    lines = np.ones_like(VIEW.looked)
    lines[::7] = False
    assert not len(stretches(FAN, lines, VIEW.looked).bearing)


def test_depths_show_the_same_as_ideal_eyes_do() -> None:
    things = [Thing(0.9, 0.2, 0.25, 0.3, 0.4, height=0.2), Thing(1.6, -0.3, 0.3, height=0.5)]
    depth = measured(cast(CAMERA, MOUNT, things)[0], 3)
    up, shown = rising(VIEW, DepthEye.of(CAMERA), depth)
    found, ideal = ends(stretches(FAN, up, shown)), ends(seen(things))
    apart = np.hypot(*(found[:, None] - ideal[None]).transpose(2, 0, 1))
    assert np.quantile(apart.min(axis=1), 0.95) < 2 * STEP
    assert np.quantile(apart.min(axis=0), 0.95) < 2 * STEP


def test_where_no_depth_is_measured_nothing_is_said() -> None:
    depth = measured(cast(CAMERA, MOUNT, [])[0], 3)
    depth[:, :320] = 0.0
    up, shown = rising(VIEW, DepthEye.of(CAMERA), depth)
    found = stretches(FAN, up, shown)
    assert found.bearing.max() < 0.05  # the left half of the picture is to the left
    assert not found.met.any()
    up, shown = rising(VIEW, DepthEye.of(CAMERA), np.zeros_like(depth))
    assert not len(stretches(FAN, up, shown).bearing)


@pytest.mark.parametrize(
    "lens", [(-0.1, 0.0, 0.0, 0.0, 0.0), (0.1, -0.25, 0.0, 0.0, 0.0), (-0.35, 0.13, 0.0, 0.0, -0.02)]
)
def test_what_a_lens_folds_back_into_the_picture_is_not_seen(lens: tuple[float, ...]) -> None:
    matrix = np.array([[307.0, 0.0, 319.5], [0.0, 307.0, 239.5], [0.0, 0.0, 1.0]])
    view = FloorView.of(Camera(matrix, np.array(lens), 640, 480), MOUNT, Body(0.225, 0.25), FURTHEST)
    fan = Fan.of(view, FURTHEST)
    bearing, distance = view.bearing[fan.rows, fan.columns], view.distance[fan.rows, fan.columns]
    off = np.hypot(
        distance * np.cos(bearing) - fan.distances * np.cos(fan.bearings)[:, None],
        distance * np.sin(bearing) - fan.distances * np.sin(fan.bearings)[:, None],
    )
    assert off[fan.seen].max() < 0.25  # of pixels at the rim; what is folded is metres off
    assert fan.seen.sum() > 5000
