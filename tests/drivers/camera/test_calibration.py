"""Calibration of cameras whose K and D are known, since their pictures are made with them."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.camera import advice
from drivers.camera.board import Board, Kind, Sighting
from drivers.camera.calibration import FEWEST, Calibration, TooFewViews, View, calibrate, moved
from tests.drivers.camera.synthetic import VIEWS, Lens, Pose, in_camera, photograph
from tests.figures import Figures

CHARUCO = Board()
CHESSBOARD = Board(kind=Kind.CHESSBOARD, columns=9, rows=7, square=0.025)
BOARDS = {"charuco": CHARUCO, "chessboard": CHESSBOARD}
PLAIN, WIDE = Lens(), Lens(fx=280.0, fy=282.0, distortion=(-0.30, 0.14, -0.001, 0.0008, -0.03))


@cache
def pictures(name: str, lens: Lens = PLAIN) -> list[View]:
    board = BOARDS[name]
    return [View(str(n), board.find(photograph(lens, board, pose, seed=n))) for n, pose in enumerate(VIEWS)]


def exact(lens: Lens, poses: list[Pose], noise: float, seed: int = 1, board: Board = CHARUCO) -> list[View]:
    """Return views without pictures: corners by the model's formulas, and noise, pixels, on them."""
    generator = np.random.default_rng(seed)
    places = np.mgrid[1 : board.columns, 1 : board.rows].reshape(2, -1).T * board.square
    points = np.column_stack([places, np.zeros(len(places))])
    views = []
    for number, pose in enumerate(poses):
        seen = in_camera(pose, board, points)
        x, y = lens.bent(seen[:, 0] / seen[:, 2], seen[:, 1] / seen[:, 2])
        pixels = np.column_stack([lens.fx * x + lens.cx, lens.fy * y + lens.cy])
        views.append(View(str(number), Sighting(points, pixels + generator.normal(0, noise, pixels.shape))))
    return views


def truth(lens: Lens) -> np.ndarray:
    return np.array([lens.fx, lens.fy, lens.cx, lens.cy])


def numbers(found: Calibration) -> np.ndarray:
    return found.matrix[[0, 1, 0, 1], [0, 1, 2, 2]]


@pytest.mark.parametrize("name", BOARDS)
def test_the_camera_that_took_the_pictures_comes_out(name: str, figures: Figures) -> None:
    found = calibrate(pictures(name), (640, 480))
    off = numbers(found) - truth(PLAIN)
    bent = found.distortion - PLAIN.distortion
    figures(f"{name}: fx, fy, cx, cy off by {np.round(off, 2)} pixels, distortion by {np.round(bent, 4)}, "
            f"error {found.error:.3f} pixels")  # fmt: skip
    assert np.abs(off).max() < 1.5  # of 520 pixels of focal length
    assert np.abs(bent[:2]).max() < 0.02
    assert np.abs(bent[2:4]).max() < 0.001
    assert bent[4] == 0.0
    assert found.error < 0.3
    assert (len(found.views), found.left_out) == (len(VIEWS), [])
    assert advice.advice(found) == []


def test_a_wide_lens_needs_k3_and_gets_it_when_asked_to() -> None:
    near = [Pose(pose.turn, (pose.at[0], pose.at[1], 0.6 * pose.at[2])) for pose in VIEWS]
    views = exact(WIDE, near, noise=0.01)
    found = calibrate(views, (640, 480), wide=True)
    assert np.abs(numbers(found) - truth(WIDE)).max() < 0.1
    assert np.abs(found.distortion - WIDE.distortion).max() < 0.005
    assert found.deviations[8] > 0
    assert calibrate(views, (640, 480)).error > 2 * found.error


@settings(max_examples=15, derandomize=True, deadline=None)
@given(
    focal=st.floats(350, 900),
    aspect=st.floats(0.97, 1.03),
    cx=st.floats(290, 350),
    cy=st.floats(210, 270),
    k1=st.floats(-0.3, 0.1),
    seed=st.integers(0, 1000),
)
def test_every_camera_comes_out_within_five_of_its_own_deviations(
    focal: float, aspect: float, cx: float, cy: float, k1: float, seed: int
) -> None:
    lens = Lens(fx=focal, fy=focal * aspect, cx=cx, cy=cy, distortion=(k1, 0.0, 0.0, 0.0, 0.0))
    found = calibrate(exact(lens, VIEWS, noise=0.1, seed=seed), (640, 480))
    assert found.error == pytest.approx(0.1 * np.sqrt(2), rel=0.2)  # two coordinates of a corner
    off = np.abs(np.append(numbers(found) - truth(lens), found.distortion[:4] - lens.distortion[:4]))
    assert (off <= 5 * found.deviations[:8] + 1e-6).all()
    assert (found.deviations[:8] > 0).all()


def test_the_normals_are_those_of_the_boards() -> None:
    found = calibrate(exact(PLAIN, VIEWS, noise=0.0), (640, 480))
    expected = [in_camera(Pose(pose.turn, (0, 0, 0)), CHARUCO, np.array([[0.135, 0.09, 1.0]]))[0] for pose in VIEWS]
    np.testing.assert_allclose(found.normals, expected, atol=1e-3)


@pytest.mark.parametrize("count", range(FEWEST))
def test_too_few_views_are_refused_with_their_number(count: int) -> None:
    with pytest.raises(TooFewViews, match=f"{count} usable views of the board, expected at least 5"):
        calibrate(exact(PLAIN, VIEWS[:count], noise=0.1), (640, 480))


def test_a_view_that_does_not_fit_is_left_out_and_named() -> None:
    views = exact(PLAIN, VIEWS, noise=0.1)
    bent = views[4].seen.pixels + 6.0 * np.sin(views[4].seen.pixels / 40.0)
    views[4] = View("crooked.png", Sighting(views[4].seen.points, bent))
    found = calibrate(views, (640, 480))
    assert [name for name, _ in found.left_out] == ["crooked.png"]
    assert "pixels, most views by 0." in found.left_out[0][1]
    assert len(found.views) == len(VIEWS) - 1
    assert np.abs(numbers(found) - truth(PLAIN)).max() < 2.0
    with pytest.raises(TooFewViews, match=r"4 usable views .*; crooked\.png: off by"):
        calibrate(views[2:7], (640, 480))


def test_views_that_are_not_tilted_or_lie_in_the_middle_are_named() -> None:
    flat = [Pose((0.02 * n, -0.02 * n, 0.3 * n), (0.0, 0.0, 0.5 + 0.02 * n)) for n in range(6)]
    said = advice.advice(calibrate(exact(PLAIN, flat, noise=0.1), (640, 480)))
    assert any("in 0 views the board is tilted to the left or right by 15 degrees or more" in line for line in said)
    assert any("in 0 views the board is tilted up or down" in line for line in said)
    assert any(line.startswith("no corner was seen in the picture's top left,") for line in said)
    # Turned about the picture's vertical only: left and right are there, up and down are not.
    one_way = [Pose((0.0, 0.1 * n - 0.5, 0.0), (0.02 * n - 0.1, 0.02 * n - 0.1, 0.35)) for n in range(11)]
    said = advice.advice(calibrate(exact(PLAIN, one_way, noise=0.1), (640, 480)))
    assert not any("left or right by" in line for line in said)
    assert any("up or down" in line for line in said)


@given(column=st.integers(0, 2), row=st.integers(0, 2))
def test_the_ninth_without_corners_is_named(column: int, row: int) -> None:
    centres = np.array([[(i + 0.5) * 30.0, (j + 0.5) * 20.0] for j in range(3) for i in range(3)])
    names = ["top left", "top middle", "top right", "middle left", "middle", "middle right"]
    names += ["bottom left", "bottom middle", "bottom right"]
    missing = 3 * row + column
    assert advice.uncovered(np.delete(centres, missing, axis=0), 90, 60) == [names[missing]]
    assert advice.uncovered(centres, 90, 60) == []


def test_large_errors_are_doubted() -> None:
    said = advice.advice(calibrate(exact(PLAIN, VIEWS, noise=3.0), (640, 480)))
    assert any("is the board flat and stiff" in line for line in said)
    assert any("the focal length is known to" in line for line in said)


def test_a_board_that_was_held_still_is_one_view() -> None:
    one = exact(PLAIN, VIEWS[:1], noise=0.2, seed=1)[0].seen
    again = exact(PLAIN, VIEWS[:1], noise=0.2, seed=2)[0].seen
    other = exact(PLAIN, VIEWS[1:2], noise=0.2)[0].seen
    part = Sighting(one.points[3:], one.pixels[3:])
    assert not moved(one, again, 640)
    assert moved(one, other, 640)
    assert moved(one, part, 640)
    assert moved(Sighting(one.points[:-3], one.pixels[3:]), part, 640)  # other corners, in the same places
