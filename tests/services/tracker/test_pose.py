"""Poses from corners that are projected exactly, or with noise of a known size."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.stats import chi2

from services.geometry.angles import wrap
from services.tracker.attitude import free, planar
from services.tracker.layout import Layout, Tag, cube
from services.tracker.pose import NOISE, Belief, Standing, standing
from services.tracker.tags import Tags
from services.vision.camera import Mount
from tests.services.tracker.pictures import camera, facing, mount, seen

Array = NDArray[np.float64]

CUBE = cube(range(5), 0.14, 0.105, bottom=0.3)
ALL = (0, 1, 2, 3, 4)


def away(found: Standing | None, pose: Array) -> Array:
    """Return found less true, the yaw wrapped."""
    assert found is not None
    d = found.pose - pose
    d[2] = wrap(float(d[2]))
    return d


def noisy(tags: Tags, noise: float, random: np.random.Generator) -> Tags:
    return Tags(tags.ids, tags.corners + random.normal(0.0, noise, tags.corners.shape))


def drawn(random: np.random.Generator, only: tuple[int, ...] = ALL) -> tuple[Array, Tags]:
    """Return a pose at which a tag is in the picture, and the tags."""
    while True:
        pose = np.array([random.uniform(0.5, 1.9), random.uniform(-0.5, 0.5), random.uniform(-math.pi, math.pi)])
        tags = seen(CUBE, pose, camera(), mount(), only)
        if len(tags.ids):
            return pose, tags


@example(x=1.1605453930301737, y=0.0, yaw=-1e-9, k1=-0.15623465961640895, only=(1, 2, 3, 4))
@given(
    x=st.floats(0.5, 1.9), y=st.floats(-0.5, 0.5), yaw=st.floats(-math.pi, math.pi),
    k1=st.floats(-0.2, 0.2), only=st.sampled_from([ALL, (0,), (1, 2, 3, 4), (0, 3)]),
)  # fmt: skip
def test_exact_corners_give_the_exact_pose(x: float, y: float, yaw: float, k1: float, only: tuple[int, ...]) -> None:
    lens = camera((k1, 0.02, 0.001, -0.001, 0.0))
    tags = seen(CUBE, np.array([x, y, yaw]), lens, mount(), only)
    assume(len(tags.ids) > 0)
    found = standing(tags, CUBE, lens, mount())
    np.testing.assert_allclose(away(found, np.array([x, y, yaw])), 0.0, atol=1e-6)
    assert found is not None
    assert found.used == tuple(tags.ids.tolist())
    assert found.dropped == ()
    assert found.rms < 1e-3
    assert -math.pi < found.pose[2] <= math.pi


@pytest.mark.parametrize("only", [ALL, (0,), (1, 2, 3, 4)])
@pytest.mark.parametrize("noise", [0.1, 0.4])
def test_the_covariance_is_honest(only: tuple[int, ...], noise: float) -> None:
    """The squared errors, in their own standard deviations, are those of 3 numbers a draw."""
    random = np.random.default_rng(1)
    draws, total = 250, 0.0
    for _ in range(draws):
        pose, tags = drawn(random, only)
        found = standing(noisy(tags, noise, random), CUBE, camera(), mount(), noise=noise)
        d = away(found, pose)
        assert found is not None
        total += float(d @ np.linalg.solve(found.covariance, d))
    low, high = chi2.ppf([0.025, 0.975], 3 * draws)
    assert low < total < high


@pytest.mark.parametrize("only", [ALL, (0,), (1, 2, 3, 4)])
@pytest.mark.parametrize("turned", [0.0035, 0.01])
def test_what_the_mount_may_be_off_covers_what_it_is_off(turned: float, only: tuple[int, ...]) -> None:
    """Each draw is a camera mounted anew: the squared errors are those of 3 numbers a draw."""
    random = np.random.default_rng(5)
    draws, total, off, count = 300, 0.0, 0.004, 0
    for _ in range(draws):
        pose, _ = drawn(random, only)
        turn = cv2.Rodrigues(turned * random.standard_normal(3))[0]
        real = Mount(turn @ mount().rotation, mount().position + off * random.standard_normal(3))
        tags = seen(CUBE, pose, camera(), real, only)
        if not len(tags.ids):
            continue
        found = standing(noisy(tags, NOISE, random), CUBE, camera(), mount(), mount_error=(off, turned))
        d = away(found, pose)
        assert found is not None
        total += float(d @ np.linalg.solve(found.covariance + found.doubt, d))
        count += 3
    low, high = chi2.ppf([0.025, 0.975], count)
    assert low < total < high, total / count


def test_corners_worse_than_their_noise_widen_the_covariance() -> None:
    random = np.random.default_rng(2)
    _, tags = drawn(random)
    tight = standing(noisy(tags, NOISE, random), CUBE, camera(), mount())
    wide = standing(noisy(tags, 8.0 * NOISE, random), CUBE, camera(), mount())
    assert tight is not None and wide is not None
    ratio = np.diag(wide.covariance) / np.diag(tight.covariance)
    assert (ratio > 16.0).all()


@pytest.mark.parametrize("id", [1, 2, 3, 4])
def test_one_tag_seen_from_above_does_not_flip(id: int) -> None:
    random = np.random.default_rng(id)
    for _ in range(60):
        pose, tags = drawn(random, (id,))
        found = standing(noisy(tags, 0.3, random), CUBE, camera(), mount())
        assert abs(away(found, pose)[2]) < math.radians(8.0)


def test_an_expected_pose_tells_two_upright_ones_apart() -> None:
    """A level camera at the height of a tag far away sees it turned to the left or to the right nearly alike."""
    layout = Layout((Tag(1, 0.105, CUBE.by_id()[1].rotation, np.array([0.0, 0.0, 0.4])),))
    level = mount(pitch=0.0, height=0.4)
    random = np.random.default_rng(3)
    pose = np.array([3.6, 0.0, math.pi - 0.35])
    mirrored = np.array([3.6, 0.0, math.pi + 0.35 - math.tau])
    spread = np.diag([0.02, 0.02, 0.1]) ** 2
    wrong = 0
    for _ in range(40):
        tags = noisy(seen(layout, pose, camera(), level), 0.3, random)
        wrong += abs(away(standing(tags, layout, camera(), level), pose)[2]) > 0.35
        found = standing(tags, layout, camera(), level, Belief(pose + np.array([0.01, -0.01, 0.05]), spread))
        assert abs(away(found, pose)[2]) < 0.35
        other = standing(tags, layout, camera(), level, Belief(mirrored, spread))
        assert abs(away(other, mirrored)[2]) < 0.5
    assert wrong > 5


def test_an_expected_pose_does_not_pull_at_the_measured_one() -> None:
    pose, tags = drawn(np.random.default_rng(4))
    free_of_it = standing(tags, CUBE, camera(), mount())
    pulled = standing(tags, CUBE, camera(), mount(), Belief(pose + np.array([0.05, -0.03, 0.2]), np.eye(3) * 1e-6))
    assert free_of_it is not None and pulled is not None
    np.testing.assert_allclose(pulled.pose, free_of_it.pose, atol=1e-9)


def test_a_tag_that_contradicts_the_others_is_left_out() -> None:
    """Of three tags one has slipped by 2 cm, or is read as that of another side."""
    pose = np.array([0.9, 0.1, 0.6])
    tags = seen(CUBE, pose, camera(), mount())
    assert tags.ids.tolist() == [0, 2, 3]
    for k in range(3):
        moved = tags.corners.copy()
        moved[k] += [0.0, 12.0]
        found = standing(Tags(tags.ids, moved), CUBE, camera(), mount())
        np.testing.assert_allclose(away(found, pose), 0.0, atol=1e-6)
        assert found is not None
        assert found.dropped == (tags.ids[k],)
        assert set(found.used) == set(tags.ids.tolist()) - {tags.ids[k]}
    misread = Tags(np.array([0, 1, 3]), tags.corners)
    found = standing(misread, CUBE, camera(), mount())
    np.testing.assert_allclose(away(found, pose), 0.0, atol=1e-6)
    assert found is not None and found.dropped == (1,)


def test_a_strange_tag_far_off_is_left_out() -> None:
    """The same id lies elsewhere in the room, too."""
    pose = np.array([0.9, 0.1, 0.6])
    tags, far = seen(CUBE, pose, camera(), mount()), seen(CUBE, np.array([1.5, -0.4, 2.0]), camera(), mount())
    both = Tags(np.append(tags.ids, far.ids[:1]), np.concatenate([tags.corners, far.corners[:1]]))
    found = standing(both, CUBE, camera(), mount())
    np.testing.assert_allclose(away(found, pose), 0.0, atol=1e-6)


@pytest.mark.parametrize("roll", [-30.0, -12.0, 12.0, 30.0])
@pytest.mark.parametrize("id", [0, 3])
def test_an_object_that_has_tipped_over_shows_no_upright_pose(roll: float, id: int) -> None:
    """A single tag on top or at the side, seen on an object that leans to a side."""
    c, s = math.cos(math.radians(roll)), math.sin(math.radians(roll))
    turn = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    corners = CUBE.by_id()[id].corners() @ turn.T + [1.0, 0.0, 0.0]
    tags = Tags(np.array([id]), camera().project(mount().to_camera(corners))[None])
    assert standing(tags, CUBE, camera(), mount()) is None


def test_no_tag_of_the_object_shows_no_pose() -> None:
    none = Tags(np.empty(0, np.int64), np.empty((0, 4, 2)))
    assert standing(none, CUBE, camera(), mount()) is None
    _, tags = drawn(np.random.default_rng(5))
    assert standing(Tags(tags.ids + 10, tags.corners), CUBE, camera(), mount()) is None


def test_the_same_corners_give_the_same_bytes() -> None:
    random = np.random.default_rng(6)
    _, tags = drawn(random)
    tags = noisy(tags, 0.2, random)
    found, again = standing(tags, CUBE, camera(), mount()), standing(tags, CUBE, camera(), mount())
    assert found is not None and again is not None
    assert found.pose.tobytes() == again.pose.tobytes()
    assert found.covariance.tobytes() == again.covariance.tobytes()


turns = st.tuples(*[st.floats(-0.6, 0.6)] * 3)


@given(turn=turns, x=st.floats(-0.2, 0.2), y=st.floats(-0.2, 0.2), z=st.floats(0.7, 3.0), k1=st.floats(-0.2, 0.2))
def test_a_board_in_any_attitude_is_found_exactly(
    turn: tuple[float, float, float], x: float, y: float, z: float, k1: float
) -> None:
    lens = camera((k1, 0.02, 0.001, -0.001, 0.0))
    points = np.array([[0.05 * i, 0.05 * j, 0.0] for i in range(4) for j in range(3)])
    rotation, position = facing(turn), np.array([x, y, z])
    found, place, error = free(points, lens.project(points @ rotation.T + position), lens)
    np.testing.assert_allclose(found, rotation, atol=1e-5)
    np.testing.assert_allclose(place, position, atol=1e-6)
    assert error < 1e-4


@example(turn=(0.0, 0.0, 0.0), z=1.0)
@example(turn=(0.0, 0.5, 0.0), z=1.0)
@example(turn=(0.0, 0.0, 3.1415926535897927), z=0.59375)
@example(turn=(0.0, 0.0, 0.5 * math.pi), z=1.0)
@example(turn=(0.0, 0.0, -0.5 * math.pi), z=1.0)
@given(turn=st.tuples(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6), st.floats(-math.pi, math.pi)), z=st.floats(0.3, 1.0))
def test_one_of_the_two_poses_of_a_tag_is_the_true_one(turn: tuple[float, float, float], z: float) -> None:
    tag = Tag(0, 0.105, np.eye(3), np.zeros(3))
    rotation, position = facing(turn), np.array([0.02, -0.03, z])
    poses = planar(tag, camera().project(tag.corners() @ rotation.T + position), camera())
    assert [error for _, _, error in poses] == sorted(error for _, _, error in poses)
    best = min(poses, key=lambda pose: float(np.abs(pose[0] - rotation).max()))
    np.testing.assert_allclose(best[0], rotation, atol=1e-3)
    np.testing.assert_allclose(best[1], position, atol=1e-4)
