"""Things told from the floor by colour, and the circles around them: on pictures of which the truth is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from runtime.state import decode, encode
from services.tracker.config import TrackerConfig
from services.tracker.contact import Contour, contours
from services.tracker.finders import AppearanceFinder, Hint, Memory, View
from services.tracker.footprint import footprint, placed_by_top
from services.tracker.region import Region
from services.tracker.segment import Sought, by_colour, continued, faced
from services.vision.appearance import FloorModel, colours, floor_colours, learn, standing
from services.vision.floor_view import SHRINK, Body, FloorView
from tests.services.tracker.scenes import Thing, camera, cast, free_floor, mount, picture, wood

CAMERA, MOUNT = camera(), mount()
VIEW = FloorView.of(CAMERA, MOUNT, Body(0.225, 0.25), 4.0)
FLOOR = wood(CAMERA, MOUNT)


def seen(things: list[Thing], seed: int = 0, floor: np.ndarray = FLOOR) -> list[Region]:
    return by_colour(VIEW, FloorModel(), picture(CAMERA, MOUNT, things, seed, floor), free_floor(things, seed))


def shown(things: list[Thing]) -> np.ndarray:
    """Which shrunken pixels show things, by their rays, with none of the colours."""
    truth = (cast(CAMERA, MOUNT, things)[1] > 0).reshape(240, SHRINK, 320, SHRINK).mean(axis=(1, 3))
    return (truth >= 0.5) & VIEW.looked


@given(st.floats(0.4, 3.0), st.floats(-0.5, 0.5))
def test_floor_points_are_found_in_the_pixels_that_look_at_them(x: float, y: float) -> None:
    (at,) = VIEW.pixels_of(np.array([[x, y]]))
    v, u = at
    place = VIEW.below + VIEW.distance[v, u] * np.array([np.cos(VIEW.bearing[v, u]), np.sin(VIEW.bearing[v, u])])
    # Not farther than the corner of a pixel.
    assert np.hypot(*(place - [x, y])) < np.hypot(VIEW.step[v, u], VIEW.turn[v, u] * VIEW.distance[v, u])


@given(st.floats(0.6, 2.0), st.floats(-0.5, 0.5), st.floats(0.0, 0.4))
def test_an_upright_edge_keeps_its_bearing_and_grows_by_its_height(x: float, y: float, height: float) -> None:
    point = MOUNT.to_camera(np.array([[x, y, height]]))
    floor = MOUNT.on_plane(CAMERA.rays(CAMERA.project(point)))[0]
    foot = np.array([x, y]) - VIEW.below
    assert floor - VIEW.below == pytest.approx(foot / (1.0 - height / 0.9), abs=1e-9)


def test_the_robots_own_body_is_not_looked_at() -> None:
    body = Body(0.35, 0.4)
    view = FloorView.of(CAMERA, MOUNT, body, 4.0)
    # A cylinder as the body: its pixels are those left out.
    covered = cast(CAMERA, MOUNT, [Thing(0.0, 0.0, 2 * body.radius, height=body.height)])[1] > 0
    middle = covered.reshape(240, 2, 320, 2).all(axis=(1, 3))
    touched = covered.reshape(240, 2, 320, 2).any(axis=(1, 3))
    assert middle.sum() > 1000
    assert not (view.looked & middle).any()
    assert (view.looked | touched | ~VIEW.looked).all()
    assert not (view.hidden & ~view.looked).any()


def test_boards_with_grain_and_light_that_changes_are_floor() -> None:
    assert seen([]) == []


@pytest.mark.parametrize("colour", [(170, 40, 40), (40, 90, 160), (60, 60, 60), (225, 225, 225), (60, 130, 60)])
def test_pixels_of_a_thing_are_told_from_the_floors(colour: tuple[int, int, int]) -> None:
    things = [Thing(1.0, 0.1, 0.3, colour=colour), Thing(1.6, -0.4, 0.3, 0.2, 0.5, colour=colour)]
    image = picture(CAMERA, MOUNT, things, 1, FLOOR)
    model, bins = FloorModel(), colours(image)
    learn(model, bins, VIEW.pixels_of(free_floor(things)))
    found, truth = standing(VIEW, bins, floor_colours(model)), shown(things)
    assert (found & truth).sum() / (found | truth).sum() > 0.97


@given(
    st.floats(0.6, 1.5), st.floats(-0.4, 0.4), st.floats(0.14, 0.5), st.floats(0.1, 0.3), st.integers(0, 99)
)  # fmt: skip
@settings(max_examples=15)
def test_the_circle_of_a_disc_is_its_own(
    distance: float, bearing: float, diameter: float, height: float, seed: int
) -> None:
    x, y = 0.1 + distance * math.cos(bearing), distance * math.sin(bearing)
    disc = Thing(x, y, diameter, height=height)
    (found,) = seen([disc], seed)
    assert np.hypot(*(found.centre - [x, y])) < 0.025
    assert found.diameter == pytest.approx(diameter, abs=0.025)
    assert found.nearest == pytest.approx(distance - diameter / 2, abs=0.03)
    error = found.centre - [x, y]
    assert error @ np.linalg.solve(found.covariance, error) < 9.0


@given(
    st.floats(0.6, 1.4), st.floats(-0.3, 0.3), st.floats(0.14, 0.35), st.floats(0.14, 0.35), st.floats(-3.0, 3.0),
    st.floats(0.1, 0.3),
)  # fmt: skip
@settings(max_examples=15)
def test_the_circle_of_a_box_takes_in_its_far_side(
    x: float, y: float, length: float, width: float, yaw: float, height: float
) -> None:
    box = Thing(x, y, length, width, yaw, height)
    (found,) = seen([box])
    assert np.hypot(*(found.centre - [x, y])) < 0.12
    assert found.diameter == pytest.approx(box.diameter, abs=0.2)


def test_boxes_are_found_without_much_bias() -> None:
    rng = np.random.default_rng(5)
    errors = []
    for k in range(24):
        distance, bearing = rng.uniform(0.6, 1.5), rng.uniform(-0.4, 0.4)
        x, y = 0.1 + distance * math.cos(bearing), distance * math.sin(bearing)
        length, width = rng.uniform(0.14, 0.4, 2)
        box = Thing(x, y, length, width, rng.uniform(-3.0, 3.0), rng.uniform(0.1, 0.3))
        (found,) = seen([box], k)
        along = (np.array([x, y]) - VIEW.below) / distance
        errors.append([(found.centre - [x, y]) @ along, found.diameter - box.diameter, found.height - box.height])
    mean, rms = np.mean(errors, axis=0), np.sqrt(np.mean(np.square(errors), axis=0))
    assert np.abs(mean) == pytest.approx([0.0, 0.0, 0.0], abs=0.03)
    assert (rms < [0.05, 0.08, 0.05]).all()


def test_a_wall_close_behind_is_cut_away_and_is_not_the_object() -> None:
    things = [Thing(1.0, 0.1, 0.3), Thing(1.5, 0.0, 0.1, 6.0, height=1.0, colour=(120, 40, 60))]
    image = picture(CAMERA, MOUNT, things, 0, FLOOR)
    regions = by_colour(VIEW, FloorModel(), image, free_floor(things[:1], reach=1.35))
    object_ = faced(regions, Sought())
    assert object_ is not None
    assert object_.centre == pytest.approx([1.0, 0.1], abs=0.03)
    assert object_.diameter == pytest.approx(0.3, abs=0.03)
    assert object_.height == 0.0, "the top is not told from the wall"
    assert continued(regions, Sought(), np.array([1.5, 0.0]), 0.2) is None


def test_of_several_the_one_that_goes_on_is_kept() -> None:
    things = [Thing(0.8, 0.0, 0.2), Thing(1.5, -0.5, 0.3, 0.2, 1.0), Thing(1.4, 0.4, 0.25)]
    regions = seen(things)
    assert len(regions) == 3
    nearest, kept = faced(regions, Sought()), continued(regions, Sought(), np.array([1.42, 0.38]), 0.2)
    assert nearest is not None and kept is not None
    assert nearest.centre == pytest.approx([0.8, 0.0], abs=0.02)
    assert kept.centre == pytest.approx([1.4, 0.4], abs=0.03)


def test_what_is_under_the_picture_is_placed_by_its_top() -> None:
    """Held against the base's front the object stands nearer than the picture begins."""
    disc = Thing(0.225 + 0.16, 0.03, 0.32, height=0.2)
    (found,) = seen([disc])
    assert found.cut
    assert faced([found], Sought()) is None
    placed = placed_by_top(VIEW, found, 0.2, 0.32)
    assert placed.centre == pytest.approx([disc.x, disc.y], abs=0.03)
    assert placed.diameter == 0.32


def test_what_reaches_out_of_the_picture_is_cut() -> None:
    (found,) = seen([Thing(1.0, 0.85, 0.3)])
    assert found.cut


@pytest.mark.parametrize("y", [0.72, 0.75, 0.78, 0.81])
def test_what_is_cut_but_was_seen_whole_is_as_far_off_as_is_said(y: float) -> None:
    """Of a disc of 0.3 m at the border of the picture ever less is seen. Its size not known, 0.1 m is said."""
    true = np.array([1.0, y])
    hint = Hint(true + 0.02, np.eye(2) * 0.01**2, None, 1.0, 0.3, 0.1)
    things = [Thing(*true, 0.3)]
    finder, memory = AppearanceFinder(TrackerConfig(finds="appearance")), Memory()
    found = finder.find(
        picture(CAMERA, MOUNT, things, 0, FLOOR), View(CAMERA, MOUNT, hint, free_floor(things, 0), 0.45), memory
    )
    assert found is not None and found.diameter == 0.0, "it is to be cut"
    off = found.place - true
    assert off @ np.linalg.solve(found.covariance, off) < chi2.ppf(0.99, 2), off
    assert math.sqrt(np.linalg.eigvalsh(found.covariance)[0]) < 0.09


def test_a_floor_that_changes_is_learned_and_the_old_one_forgotten() -> None:
    grey = np.full_like(FLOOR, 120.0)
    model = FloorModel()
    thing = [Thing(1.0, 0.0, 0.3)]
    for k in range(3):
        by_colour(VIEW, model, picture(CAMERA, MOUNT, thing, k, FLOOR), free_floor(thing, k))
    assert len(by_colour(VIEW, model, picture(CAMERA, MOUNT, thing, 3, FLOOR), free_floor(thing, 3))) == 1
    assert not floor_colours(model)[colours(picture(CAMERA, MOUNT, [], 0, grey))].mean() > 0.5
    for k in range(60):
        by_colour(VIEW, model, picture(CAMERA, MOUNT, thing, k % 4, grey), free_floor(thing, k))
    assert len(by_colour(VIEW, model, picture(CAMERA, MOUNT, thing, 9, grey), free_floor(thing, 9))) == 1
    assert floor_colours(model)[colours(picture(CAMERA, MOUNT, [], 0, FLOOR))].mean() < 0.1


def test_without_known_floor_nothing_is_said() -> None:
    image = picture(CAMERA, MOUNT, [Thing(1.0, 0.0, 0.3)], 0, FLOOR)
    assert by_colour(VIEW, FloorModel(), image, np.empty((0, 2))) == []
    assert not floor_colours(FloorModel()).any()


def test_the_model_goes_through_a_snapshot() -> None:
    model = FloorModel()
    by_colour(VIEW, model, picture(CAMERA, MOUNT, [], 0, FLOOR), free_floor([]))
    again = decode(FloorModel, encode(model))
    assert np.array_equal(again.seen, model.seen)
    assert again.known


@given(st.floats(0.5, 2.5), st.floats(-0.5, 0.5), st.floats(0.07, 0.3))
def test_a_discs_contour_gives_it_back(distance: float, bearing: float, radius: float) -> None:
    """Without a picture: the closed form from a contour made by the disc's own equation."""
    beta = math.asin(radius / distance)
    at = np.linspace(bearing - beta, bearing + beta, 41)[1:-1]
    offset = np.cos(at - bearing)
    root = np.sqrt(radius**2 - distance**2 * (1 - offset**2))
    near, far = distance * offset - root, (distance * offset + root) / (1 - 0.2 / 0.9)
    none = np.zeros(len(at), bool)
    found = footprint(VIEW, Contour(at, near, far, bearing + beta, bearing - beta, none, False, False, 500))
    true = VIEW.below + distance * np.array([math.cos(bearing), math.sin(bearing)])
    assert found.centre == pytest.approx(true, abs=0.005)
    assert found.diameter == pytest.approx(2 * radius, abs=0.005)


@pytest.mark.parametrize(("width", "depth"), [(0.3, 0.3), (0.2, 0.2)])
def test_behind_a_flat_front_without_a_top_there_is_as_much_as_it_is_wide(width: float, depth: float) -> None:
    lateral = np.linspace(-width / 2, width / 2, 40)
    bearing, near = np.arctan2(lateral, 1.0), np.hypot(lateral, 1.0)
    none = np.zeros(40, bool)
    found = footprint(VIEW, Contour(bearing, near, near * 3, bearing[-1], bearing[0], none, True, False, 500))
    assert found.centre == pytest.approx(VIEW.below + np.array([1.0 + depth / 2, 0.0]), abs=0.002)
    assert found.diameter == pytest.approx(math.hypot(width, depth), abs=0.002)


def test_two_things_whose_pictures_touch_are_two_where_the_contour_jumps() -> None:
    mask = shown([Thing(0.8, 0.0, 0.2, height=0.3), Thing(1.5, 0.15, 0.5, 0.3, 0.1, height=0.3)])
    found = sorted(contours(VIEW, mask), key=lambda one: float(one.near.min()))
    assert len(found) == 2
    assert float(found[0].near.min()) == pytest.approx(0.6, abs=0.01)
    assert float(found[1].near.min()) == pytest.approx(1.1, abs=0.2)
