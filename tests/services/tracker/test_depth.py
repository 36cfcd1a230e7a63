"""Planes and things in depths: against closed forms, and against what others labelled in real pictures of a Kinect."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.tracker.circle import smallest_circle
from services.tracker.depth import things
from services.vision.camera import Camera
from services.vision.plane import NoPlane, Plane, find_plane
from services.vision.rising import DepthEye, support
from tests.experiments.slam.shared import SHARED, needed
from tests.services.tracker.scenes import Thing, camera, cast, measured, mount

FRAMES = SHARED / "vision" / "segmentation"
SMALL = camera(320, 240)
EYE = DepthEye.of(SMALL)


@given(st.floats(20.0, 70.0), st.floats(0.4, 1.5), st.integers(0, 9))
@settings(max_examples=20)
def test_an_empty_floor_is_found_as_the_mount_says(pitch: float, height: float, seed: int) -> None:
    on = mount(pitch, height)
    depth, _, _ = cast(SMALL, on, [])
    depth[depth > 4.0] = 0.0
    plane = support(EYE, measured(depth, seed))
    true = Plane.floor(on)
    assert np.degrees(np.arccos(min(1.0, plane.normal @ true.normal))) < 0.2
    assert plane.offset == pytest.approx(height, abs=0.004)
    assert things(EYE, measured(depth, seed), plane) == []


def test_a_mount_that_is_off_is_mended() -> None:
    depth, _, _ = cast(SMALL, mount(46.0, 0.91), [Thing(1.0, 0.0, 0.3)])
    plane = support(EYE, measured(depth, 0), mount())
    true = Plane.floor(mount(46.0, 0.91))
    assert plane.offset == pytest.approx(0.91, abs=0.002)
    assert plane.normal == pytest.approx(true.normal, abs=0.002)


def test_a_wall_that_fills_the_picture_is_not_the_floor() -> None:
    on = mount(30.0)
    depth, _, _ = cast(SMALL, on, [Thing(2.2, 0.0, 2.0, 9.0, height=3.0)])
    plane = support(EYE, measured(depth, 0))
    assert (depth > 0).mean() == 1.0
    assert plane.normal == pytest.approx(Plane.floor(on).normal, abs=0.01)


@given(
    st.floats(0.6, 1.8), st.floats(-0.4, 0.4), st.floats(0.14, 0.4), st.sampled_from([0.0, 0.14, 0.3]),
    st.floats(-3.0, 3.0), st.floats(0.1, 0.3),
)  # fmt: skip
@settings(max_examples=25)
def test_a_thing_of_which_the_top_is_seen_has_its_true_circle(
    x: float, y: float, length: float, width: float, yaw: float, height: float
) -> None:
    thing = Thing(x, y, length, width, yaw, height)
    depth = measured(cast(SMALL, mount(), [thing])[0], 1)
    plane = support(EYE, depth, mount())
    (found,) = things(EYE, depth, plane)
    # Pixels are up to 15 mm apart across and 25 mm along at 1.8 m.
    assert np.hypot(*(found.centre - [x, y])) < 0.02
    assert found.diameter == pytest.approx(thing.diameter, abs=0.035)
    assert found.height == pytest.approx(height, abs=0.02)


def test_things_close_to_each_other_and_behind_one_another_are_told_apart() -> None:
    lying = [Thing(0.8, 0.0, 0.2), Thing(1.1, 0.15, 0.2, 0.2, 0.3), Thing(0.9, -0.26, 0.3, 0.15, 1.0)]
    depth = measured(cast(SMALL, mount(), lying)[0], 2)
    found = things(EYE, depth, support(EYE, depth, mount()))
    assert len(found) == 3
    for thing in lying:
        assert min(np.hypot(*(one.centre - [thing.x, thing.y])) for one in found) < 0.025


def test_what_was_not_measured_does_not_matter() -> None:
    depth, _, _ = cast(SMALL, mount(), [Thing(1.0, 0.1, 0.3)])
    rng = np.random.default_rng(3)
    holes = np.where(
        rng.uniform(size=depth.shape) < 0.2, np.where(rng.uniform(size=depth.shape) < 0.5, 0.0, np.nan), depth
    )
    (found,) = things(EYE, holes, support(EYE, holes, mount()))
    assert found.centre == pytest.approx([1.0, 0.1], abs=0.015)


def test_nothing_measured_has_no_plane() -> None:
    with pytest.raises(NoPlane):
        support(EYE, np.zeros((240, 320)))


@pytest.mark.parametrize("every", [1, 2])
@pytest.mark.parametrize("name", ["learn4", "test8"])
@pytest.mark.shared
@needed(FRAMES)
def test_things_on_a_real_table_are_where_they_are_labelled(name: str, every: int) -> None:
    with np.load(FRAMES / f"{name}.npz") as frame:
        depth, label, matrix = (
            frame["depth_mm"][::every, ::every] / 1000.0,
            frame["label"][::every, ::every],
            frame["K"],
        )
    matrix = matrix / np.array([[every], [every], [1.0]])
    eye = DepthEye.of(Camera(matrix, np.zeros(5), depth.shape[1], depth.shape[0]))
    points = eye.rays * depth[..., None]
    plane = support(eye, depth)
    found = things(eye, depth, plane)
    # The oracle's plane: of least squares through all that is labelled as the table.
    table = points[(label == 1) & (depth > 0)]
    normal = np.linalg.svd(table - table.mean(axis=0), full_matrices=False)[2][2]
    normal *= -np.sign(normal @ table.mean(axis=0))
    assert np.degrees(np.arccos(normal @ plane.normal)) < 0.3
    true = Plane.of(normal, float(-normal @ table.mean(axis=0)))
    assert [one.cut for one in found] == [False, False]
    for value, one in zip((20, 30), found, strict=True):
        labelled = points[(label == value) & (depth > 0)]
        centre, diameter = smallest_circle(labelled @ true.axes.T + true.origin)
        assert np.hypot(*(one.centre - centre)) < 0.01
        assert one.diameter == pytest.approx(diameter, abs=0.01)


def test_three_points_are_needed() -> None:
    with pytest.raises(NoPlane):
        find_plane(np.ones((2, 3)))
