"""The match finds a known pose; the filter maps a room and knows where it is; the same seed gives the same bytes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.geometry.pose import between, compose
from services.mapping.filter import Noise, Particles
from services.mapping.grid import Maps
from services.mapping.matching import agreement, climb, likelihood_field, prior, search
from services.mapping.scan import Scan
from services.mapping.surfaces import settle
from tests.figures import Figures
from tests.services.mapping.rooms import ROUND, scan_at

POSES = st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-3.1, 3.1))


@given(POSES, POSES)
def test_steps_lead_back(first: tuple[float, float, float], second: tuple[float, float, float]) -> None:
    a, b = np.array(first), np.array(second)
    assert compose(a, between(a, b)) == pytest.approx(b, abs=1e-9)


def mapped(noise: float = 0.01, turns: int = 1) -> Maps:
    """Return a map of the room from three places, so often at each."""
    maps, generator = Maps.of(1), np.random.Generator(np.random.PCG64(4))
    for pose in (np.array([1.0, 1.0, 0.3]), np.array([4.0, 1.0, 2.0]), np.array([5.0, 3.2, -1.0])) * turns:
        scan = scan_at(pose, noise, generator)
        maps.draw(0, pose, scan.ends, scan.returned, scan.start, 1e6)
    return maps


MAP = mapped()
FINE = mapped(turns=20)


@settings(max_examples=40)
@given(st.floats(-0.25, 0.25), st.floats(-0.25, 0.25), st.floats(-0.3, 0.3))
def test_search_and_climb_find_the_pose(dx: float, dy: float, turn: float) -> None:
    pose = np.array([2.0, 1.2, 0.5])
    scan = scan_at(pose)
    found = pose + np.array([dx, dy, turn])
    expected, information = found.copy(), np.diag([25.0, 25.0, 25.0])
    shown, corner = MAP.picture(0)
    search(
        likelihood_field(shown, 0.15), *corner, found, scan.thinned(90), 30.0, expected, information, 0.05, 6, 0.02, 18
    )
    climb(
        MAP.cells, MAP.index[0], *MAP.corner, found, scan.thinned(180), scan.start, 0.04, 60.0, expected, information,
        0.03, 0.01, 4,
    )  # fmt: skip
    assert math.hypot(*(found[:2] - pose[:2])) < 0.02
    assert abs(found[2] - pose[2]) < 0.015


@settings(max_examples=40)
@given(st.floats(-0.04, 0.04), st.floats(-0.04, 0.04), st.floats(-0.02, 0.02), st.integers(0, 100))
def test_scans_settle_on_the_walls_far_finer_than_a_cell(dx: float, dy: float, turn: float, seed: int) -> None:
    """Scan and map have noise of 1 cm; what 360 beams say together is that over the root of their number."""
    pose = np.array([2.0, 1.2, 0.5])
    scan = scan_at(pose, 0.01, np.random.Generator(np.random.PCG64(seed)))
    found = pose + np.array([dx, dy, turn])
    weak = np.diag([25.0, 25.0, 25.0])
    whole = settle(
        FINE.cells,
        FINE.index[0],
        *FINE.corner,
        found,
        scan.thinned(360),
        scan.start,
        0.015,
        60.0,
        found.copy(),
        weak,
        8,
    )
    assert math.hypot(*(found[:2] - pose[:2])) < 0.006
    assert abs(found[2] - pose[2]) < 0.003
    deviations = np.sqrt(np.diag(np.linalg.inv(whole)))
    assert (deviations < (0.01, 0.01, 0.006)).all()


def test_what_no_surface_is_near_to_settles_where_the_odometry_says() -> None:
    scan = scan_at(np.array([2.0, 1.2, 0.5]))
    found = np.array([30.0, 30.0, 0.5])
    expected, information = found + np.array((0.1, 0.0, 0.02)), np.diag([100.0, 50.0, 400.0])
    nowhere = (MAP.cells, MAP.index[0], *MAP.corner, found, scan.thinned(360), scan.start)
    whole = settle(*nowhere, 0.015, 60.0, expected, information, 8)
    assert found == pytest.approx(expected)
    assert whole == pytest.approx(information)


@given(st.floats(-0.04, 0.04))
def test_a_beam_agrees_by_how_far_it_ends_from_the_wall(off: float) -> None:
    """One wall, seen at 2 m; log of a Gaussian with 2 % of anything."""
    maps, ahead, start = Maps.of(1), np.array([[2.0, 0.02]]), np.zeros(2)
    maps.draw(0, np.zeros(3), ahead, np.array([True]), start, 1e6)
    pose = np.array([off, 0.0, 0.0])
    found = agreement(maps.cells, maps.index[0], *maps.corner, pose, ahead, start, 0.04)
    assert found == pytest.approx(math.log(0.02 + 0.98 * math.exp(-0.5 * (off / 0.04) ** 2)), abs=1e-5)
    nowhere = agreement(maps.cells, maps.index[0], *maps.corner, pose - np.array([1.0, 0.0, 0.0]), ahead, start, 0.04)
    assert nowhere == pytest.approx(math.log(0.02))
    unseen = agreement(maps.cells, maps.index[0], *maps.corner, pose + np.array([1.0, 0.0, 0.0]), ahead, start, 0.04)
    assert unseen == pytest.approx(math.log(0.02 + 0.98 * math.exp(-2.0)))


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-0.5, 0.5), st.floats(-3.1, 3.1))
def test_the_prior_is_a_gaussian(dx: float, dy: float, turn: float, theta: float) -> None:
    expected = np.array([1.0, 2.0, theta])
    information = np.array([[30.0, 4.0, 1.0], [4.0, 20.0, 2.0], [1.0, 2.0, 50.0]])
    d = np.array([dx, dy, turn])
    assert prior(expected + d, expected, information) == pytest.approx(-0.5 * d @ information @ d, abs=1e-9)


def driven(seed: int, particles: int = 8) -> tuple[Particles, np.ndarray, np.ndarray, np.ndarray]:
    """Return the filter after a round through the room, and its poses, the true ones, and odometry's, (K, 3)."""
    generator = np.random.Generator(np.random.PCG64(100 + seed))
    true = []
    for (ax, ay), (bx, by) in zip(ROUND, ROUND[1:], strict=False):
        steps = max(2, round(math.dist((ax, ay), (bx, by)) / 0.2))
        heading = math.atan2(by - ay, bx - ax)
        true += [np.array([ax + t * (bx - ax), ay + t * (by - ay), heading]) for t in np.linspace(0, 1, steps)]
    found = Particles.at(true[0], particles, seed)
    poses, odometry = [true[0]], [true[0]]
    scan = scan_at(true[0], 0.01, generator)
    found.draw(scan, 12.0)
    for before, after in zip(true, true[1:], strict=False):
        step = between(before, after)
        # An odometry that slips and turns: 5 % of the way, and 0.03 rad a step.
        step = step * 1.05 + (0.0, 0.0, 0.03) + generator.standard_normal(3) * (0.005, 0.005, 0.01)
        odometry.append(compose(odometry[-1], step))
        scan = scan_at(after, 0.01, generator)
        found.move(step, Noise(), scan)
        poses.append(found.pose)
        found.draw(scan, 12.0)
        found.select()
    return found, np.array(poses), np.array(true), np.array(odometry)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_filter_knows_where_it_is(seed: int) -> None:
    _, poses, true, odometry = driven(seed)
    errors = np.hypot(*(poses - true)[:, :2].T)
    assert np.hypot(*(odometry - true)[-1, :2]) > 0.5, "odometry alone would be lost"
    assert errors.mean() < 0.03
    assert errors.max() < 0.10
    turns = np.abs((poses - true)[:, 2] + math.pi) % (2 * math.pi) - math.pi
    assert np.abs(turns).mean() < 0.02


def test_the_same_seed_gives_the_same_bytes_and_another_does_not() -> None:
    (one, first, _, _), (two, second, _, _), (_, third, _, _) = driven(1), driven(1), driven(2)
    assert first.tobytes() == second.tobytes()
    assert one.maps.cells.tobytes() == two.maps.cells.tobytes()
    assert first.tobytes() != third.tobytes()


def test_particles_are_drawn_anew_by_their_weights_and_only_if_few_count() -> None:
    particles = Particles.at(np.zeros(3), 8, 1)
    particles.poses[:, 0] = np.arange(8)
    assert particles.select() is None
    particles.log_weights = np.log(np.array([0.48, 0.02, 0.4, 0.02, 0.02, 0.02, 0.02, 0.02]))
    chosen = particles.select()
    assert chosen is not None
    # Systematic resampling: each as often as its share says, give or take one.
    counts = np.bincount(chosen, minlength=8)
    assert np.abs(counts - 8 * np.array([0.48, 0.02, 0.4, 0.02, 0.02, 0.02, 0.02, 0.02])).max() < 1.0
    assert (particles.poses[:, 0] == chosen).all()
    assert not particles.log_weights.any()
    particles.log_weights = np.log(np.array([0.05, 0.73, 0.02, 0.04, 0.04, 0.04, 0.04, 0.04]))
    particles.poses[:, 0], particles.best = np.arange(8), 1
    assert particles.select() is not None
    assert particles.poses[particles.best, 0] == 1.0, "the best stays the best"


def test_the_mean_is_of_the_particles_that_tell_the_best_ones_story() -> None:
    particles = Particles.at(np.zeros(3), 4, 1)
    particles.poses[:] = [[1.0, 2.0, 3.1], [1.2, 2.0, -3.1], [1.1, 2.3, 3.1], [4.0, 2.0, 0.0]]
    particles.log_weights = np.log(np.array([0.5, 0.25, 0.15, 0.1]))
    share = np.array([0.5, 0.25, 0.15]) / 0.9
    turns = np.array([3.1, 2 * math.pi - 3.1, 3.1])
    expected = [share @ [1.0, 1.2, 1.1], 2.0 + 0.3 * share[2], share @ turns]
    assert particles.pose == pytest.approx(expected)
    particles.best = 3
    assert particles.pose == pytest.approx([4.0, 2.0, 0.0])


def through_passage(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return errors along a passage of 1.2 m of which no end is in sight, of the best particle and of the mean, m."""
    generator = np.random.Generator(np.random.PCG64(200 + seed))
    angles = np.linspace(-math.pi, math.pi, 180, endpoint=False)
    far = np.minimum(0.6 / np.maximum(np.abs(np.sin(angles)), 1e-9), 3.0)
    particles, best, mean = Particles.at(np.zeros(3), 30, seed), [], []
    for k in range(30):
        lengths = far + 0.01 * generator.standard_normal(len(far))
        ends = lengths[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
        scan = Scan(ends, far < 3.0, np.zeros(2))
        if k:
            particles.move(np.array([0.05, 0.0, 0.0]), Noise(), scan)
        particles.draw(scan, 12.0)
        particles.select()
        best.append(particles.poses[particles.best, 0] - 0.05 * k)
        mean.append(particles.pose[0] - 0.05 * k)
    return np.array(best), np.array(mean)


def test_along_a_passage_the_mean_does_not_walk_at_random(figures: Figures) -> None:
    """Beams say nothing of how far the robot has come there, and the odometry is exact."""
    both = [through_passage(seed) for seed in range(4)]
    best, mean = (np.sqrt(np.mean(np.square([one[k] for one in both]))) for k in (0, 1))
    figures(f"along a passage, root mean square: best particle {best:.3f} m, mean {mean:.3f} m")
    assert mean < 0.5 * best
    assert mean < 0.03
