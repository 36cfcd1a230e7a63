"""Markers and their corners, against pictures that are drawn from their geometry by integrating the light."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from services.tracker.attitude import planar
from services.tracker.layout import Tag, square
from services.tracker.tags import Finder, NotGrey, UnknownDictionary, dictionaries, dictionary, finder
from tests.figures import Figures
from tests.services.tracker.pictures import camera, facing, picture

Array = NDArray[np.float64]

SIDE = 0.075
TURNS = [(0.1, 0.2, 0.3), (-0.3, 0.15, 1.2), (0.25, -0.35, 2.9), (-0.15, -0.3, -1.9)]


def truth(rotation: Array, position: Array, side: float = SIDE) -> Array:
    return camera().project(square(side) @ rotation.T + position)


def outward(found: Array, true: Array) -> float:
    """Return how far corners are outside the true ones, in the mean, pixels."""
    away = true - true.mean(axis=0)
    return float(((found - true) * away / np.linalg.norm(away, axis=1, keepdims=True)).sum(axis=1).mean())


@pytest.mark.parametrize(("z", "within"), [(0.4, 0.05), (0.8, 0.05), (1.2, 0.06), (1.6, 0.12)])
def test_corners_are_those_of_the_print(z: float, within: float) -> None:
    """Markers of 78 to 19 pixels, 1 level of noise. Refined where a corner seems to be, they are 0.2 inside."""
    options = cv2.aruco.DetectorParameters()
    options.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    common = cv2.aruco.ArucoDetector(dictionary("DICT_4X4_50"), options)
    ours, theirs = [], []
    for k, turn in enumerate(TURNS):
        position = np.array([0.013 * k, -0.017 * k, z])
        grey = picture(camera(), facing(turn), position, SIDE, noise=1.0)
        true = truth(facing(turn), position)
        tags = finder("DICT_4X4_50").find(grey)
        assert tags.ids.tolist() == [3]
        assert np.abs(tags.corners[0] - true).max() < within
        ours.append(outward(tags.corners[0], true))
        theirs.append(outward(np.array(common.detectMarkers(grey)[0][0], np.float64)[0], true))
    assert abs(np.mean(ours)) < 0.03
    assert np.mean(theirs) < -0.2


def test_small_markers_are_read(figures: Figures) -> None:
    """Of 15 to 31 pixels, tilted by up to a radian. OpenCV's own settings read more of them wrongly, so not at all."""
    random, count, found, usual = np.random.default_rng(1), 200, 0, 0
    common = cv2.aruco.ArucoDetector(dictionary("DICT_4X4_50"))
    for _ in range(count):
        turn = (random.uniform(-1.0, 1.0), random.uniform(-0.3, 0.3), random.uniform(-3.0, 3.0))
        grey = picture(camera(), facing(turn), np.array([0.0, 0.0, random.uniform(1.0, 2.0)]), SIDE, noise=2.0)
        found += finder("DICT_4X4_50").find(grey).ids.tolist() == [3]
        usual += common.detectMarkers(grey)[1] is not None
    figures(f"{found} of {count} small markers read, by OpenCV's own settings {usual}")
    assert count - found < 0.4 * (count - usual)


@pytest.mark.parametrize("z", [0.5, 1.0, 1.6])
def test_range_is_not_too_long(z: float) -> None:
    errors = []
    for k, turn in enumerate(TURNS):
        position = np.array([0.011 * k, 0.007 * k, z])
        grey = picture(camera(), facing(turn), position, SIDE, noise=1.0)
        tags = finder("DICT_4X4_50").find(grey)
        _, found, _ = planar(Tag(3, SIDE, np.eye(3), np.zeros(3)), tags.corners[0], camera())[0]
        errors.append((found[2] - z) / z)
    assert abs(np.mean(errors)) < 0.002


def test_a_picture_that_holds_the_light_itself_is_read_as_such() -> None:
    position = np.array([0.0, 0.0, 0.7])
    true = truth(facing(TURNS[0]), position)
    grey = picture(camera(), facing(TURNS[0]), position, SIDE, gamma=1.0)
    right = Finder(dictionary("DICT_4X4_50"), gamma=1.0).find(grey).corners[0]
    wrong = finder("DICT_4X4_50").find(grey).corners[0]
    assert abs(outward(right, true)) < 0.02
    assert outward(wrong, true) > 0.2


def test_a_lens_bends_edges() -> None:
    bent = camera((0.3, 0.1, 0.002, -0.001, 0.0))
    position = np.array([0.15, -0.08, 0.4])
    grey = picture(bent, facing(TURNS[0]), position, 0.12)
    true = bent.project(square(0.12) @ facing(TURNS[0]).T + position)
    found = finder("DICT_4X4_50").find(grey, bent).corners[0]
    assert np.abs(found - true).max() < 0.1
    assert np.abs(finder("DICT_4X4_50").find(grey).corners[0] - true).max() > 0.3


def test_a_smudge_on_an_edge_does_not_move_it() -> None:
    position = np.array([0.0, 0.0, 0.4])
    grey = picture(camera(), facing((0.0, 0.0, 0.0)), position, SIDE)
    true = truth(facing((0.0, 0.0, 0.0)), position)
    x, y = np.round(0.7 * true[0] + 0.3 * true[1]).astype(int)
    # The ink has run out over the edge, by a pixel and a half.
    grey[y - 1 : y + 2, x - 4 : x + 5] = grey[y + 4, x]
    found = finder("DICT_4X4_50").find(grey)
    assert np.abs(found.corners[0] - true).max() < 0.1


@pytest.mark.parametrize(("name", "id"), [("DICT_5X5_1000", 403), ("DICT_APRILTAG_36h11", 17), ("DICT_6X6_250", 40)])
def test_markers_of_other_dictionaries_are_found(name: str, id: int) -> None:
    position = np.array([0.05, 0.0, 0.6])
    grey = picture(camera(), facing(TURNS[1]), position, SIDE, name, id)
    tags = finder(name).find(grey)
    assert tags.ids.tolist() == [id]
    assert np.abs(tags.corners[0] - truth(facing(TURNS[1]), position)).max() < 0.06


@pytest.mark.parametrize(("left", "right"), [(2, 7), (7, 2)])
def test_several_markers_come_in_the_order_of_their_ids(left: int, right: int) -> None:
    pictures = [
        picture(camera(), facing(TURNS[0]), np.array([x, 0.0, 0.6]), SIDE, id=id)
        for x, id in ((-0.2, left), (0.2, right))
    ]
    both = np.concatenate([pictures[0][:, :320], pictures[1][:, 320:]], axis=1)
    tags = finder("DICT_4X4_50").find(both)
    assert tags.ids.tolist() == [2, 7]
    assert (tags.corners[0].mean(axis=0)[0] < 320) == (left == 2)
    again = Finder(dictionary("DICT_4X4_50")).find(both)
    assert again.corners.tobytes() == tags.corners.tobytes()


@pytest.mark.parametrize("level", [0, 128, 255])
def test_nothing_is_found_where_there_is_nothing(level: int) -> None:
    tags = finder("DICT_5X5_1000").find(np.full((480, 640), level, np.uint8))
    assert tags.ids.shape == (0,)
    assert tags.corners.shape == (0, 4, 2)


def test_an_unknown_dictionary_is_named_with_the_known_ones() -> None:
    with pytest.raises(UnknownDictionary, match=r"'DICT_9X9_50'.*DICT_4X4_50.*DICT_APRILTAG_36h11"):
        finder("DICT_9X9_50")
    with pytest.raises(UnknownDictionary):
        dictionary("ArucoDetector")
    assert all(dictionary(name).markerSize >= 4 for name in dictionaries())


@pytest.mark.parametrize("shape", [((480, 640, 3), np.uint8), ((480, 640), np.float32)])
def test_a_picture_that_is_not_grey_is_refused(shape: tuple[tuple[int, ...], type]) -> None:
    with pytest.raises(NotGrey, match="expected"):
        finder("DICT_4X4_50").find(np.zeros(*shape))  # type: ignore[arg-type]
