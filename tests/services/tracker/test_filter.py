"""The filter: what it believes of moving, resting, hidden and carried objects, and how honest it is about it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime.messages import Visibility
from runtime.time import SECOND
from services.tracker.config import FilterConfig
from services.tracker.filter import Reading, Track

CONFIG = FilterConfig()
FAR = np.array([-3.0, 0.0])
D_R = 0.45
SIGMA = 0.005
DT = SECOND // 10


def reading(x: float, y: float, yaw: float | None = 0.3, sigma: float = SIGMA) -> Reading:
    return Reading(np.array([x, y]), np.eye(2) * sigma**2, yaw, 0.02**2, 0.3)


def fed(places: list[tuple[float, float]], robot: np.ndarray = FAR) -> Track:
    track = Track.begin(reading(*places[0]), 0, CONFIG)
    for k, place in enumerate(places[1:], 1):
        track.predict(k * DT, robot, D_R, CONFIG)
        track.correct(reading(*place), CONFIG)
    return track


def test_a_resting_object_is_known_better_than_one_reading_says() -> None:
    random = np.random.default_rng(1)
    track = fed([tuple(random.normal(0.0, SIGMA, 2)) for _ in range(30)])
    assert np.hypot(*track.mean[:2]) < SIGMA
    assert track.covariance[0, 0] < SIGMA**2 and track.covariance[0, 0] > 0.0
    assert np.hypot(*track.mean[2:]) < 0.04


def test_an_object_pushed_at_constant_speed_is_followed_without_lag() -> None:
    touch = 0.5 * (D_R + 0.3)
    track = Track.begin(reading(0.0, 0.0), 0, CONFIG)
    for k in range(1, 30):
        track.predict(k * DT, np.array([0.02 * k - touch, 0.0]), D_R, CONFIG)
        track.correct(reading(0.02 * k, 0.0), CONFIG)
    before = track.mean.copy()
    track.predict(30 * DT, np.array([0.02 * 30 - touch, 0.0]), D_R, CONFIG)
    assert before[2] == pytest.approx(0.2, abs=0.03)
    assert track.mean[0] == pytest.approx(0.6, abs=0.012)


def test_its_errors_are_as_large_as_it_says() -> None:
    """The normalised error squared of place and velocity, over many runs of its own model, is chi-squared (4)."""
    random, values = np.random.default_rng(2), []
    for _ in range(300):
        true = np.zeros(4)
        first = Reading(true[:2] + random.normal(0.0, SIGMA, 2), np.eye(2) * SIGMA**2, None, 0.0, 0.3)
        config = FilterConfig(drag=0.5, shove=0.3, speed=1e-3)
        track = Track.begin(first, 0, config)
        for k in range(1, 15):
            push, dt = random.normal(0.0, 0.3, 2), 0.1
            kept = math.exp(-dt / 0.5)
            way = 0.5 * (1.0 - kept)
            true = np.concatenate([true[:2] + way * true[2:] + 0.5 * dt**2 * push, kept * true[2:] + dt * push])
            track.predict(k * DT, FAR, D_R, config)
            seen = true[:2] + random.normal(0.0, SIGMA, 2)
            track.correct(Reading(seen, np.eye(2) * SIGMA**2, None, 0.0, 0.3), config)
        off = track.mean - true
        values.append(float(off @ np.linalg.solve(track.covariance, off)))
    # The mean of 300 values of chi-squared (4) is 4, its deviation sqrt(8 / 300); strange readings are left out.
    assert np.mean(values) == pytest.approx(4.0, abs=3.0 * math.sqrt(8.0 / 300.0) + 0.1)


def test_out_of_sight_it_is_predicted_then_lost_and_known_ever_less() -> None:
    track = fed([(0.0, 0.0)] * 10)
    seen, spread = track.stamp, track.covariance[0, 0]
    said = []
    for k in range(1, 16):
        track.predict(seen + k * DT, FAR, D_R, CONFIG)
        said.append(track.visibility(track.stamp, CONFIG))
        assert track.covariance[0, 0] > spread
        spread = track.covariance[0, 0]
    assert said[:2] == [Visibility.VISIBLE] * 2
    assert said[2:10] == [Visibility.PREDICTED] * 8
    assert said[10:] == [Visibility.LOST] * 5
    assert np.hypot(*track.mean[:2]) < 0.01, "what nobody pushes stays"


def test_out_of_sight_the_base_pushes_it_along() -> None:
    track = fed([(0.375, 0.0)] * 10, np.array([0.0, 0.0]))
    for k in range(1, 11):
        track.predict(track.seen + k * DT, np.array([0.03 * k, 0.0]), D_R, CONFIG)
    assert track.mean[0] == pytest.approx(0.3 + 0.5 * (D_R + 0.3), abs=0.005)
    assert track.mean[1] == pytest.approx(0.0, abs=1e-9)


def test_a_wild_reading_is_left_out_and_one_that_stays_is_believed() -> None:
    track = fed([(0.0, 0.0)] * 10)
    believed = []
    for k in range(1, 6):
        track.predict(track.stamp + DT, FAR, D_R, CONFIG)
        believed.append(track.correct(reading(1.0, 0.5), CONFIG))
        if k == 1:
            assert np.hypot(*track.mean[:2]) < 0.01
    assert believed == [False, False, False, True, True]
    assert track.mean[:2] == pytest.approx([1.0, 0.5], abs=0.01)


def test_a_yaw_that_flips_once_is_left_out() -> None:
    track = fed([(0.0, 0.0)] * 10)
    track.predict(track.stamp + DT, FAR, D_R, CONFIG)
    track.correct(reading(0.0, 0.0, yaw=0.3 + 1.2), CONFIG)
    assert track.yaw[0] == pytest.approx(0.3, abs=0.01)


@given(st.floats(-math.pi, math.pi), st.lists(st.floats(-0.02, 0.02), min_size=1, max_size=20))
def test_yaw_is_followed_through_the_turn_of_the_circle(first: float, steps: list[float]) -> None:
    track = Track.begin(reading(0.0, 0.0, math.remainder(first, math.tau)), 0, CONFIG)
    angle = first
    for k, step in enumerate(steps, 1):
        angle += step
        track.predict(k * DT, FAR, D_R, CONFIG)
        track.correct(reading(0.0, 0.0, math.remainder(angle, math.tau)), CONFIG)
    assert abs(math.remainder(track.yaw[0] - angle, math.tau)) < 0.08
    assert -math.pi <= track.yaw[0] <= math.pi


def test_no_time_passes_backwards() -> None:
    track = fed([(0.0, 0.0)] * 3)
    before = (track.stamp, track.mean.tobytes(), track.covariance.tobytes())
    track.predict(track.stamp - DT, FAR, D_R, CONFIG)
    assert (track.stamp, track.mean.tobytes(), track.covariance.tobytes()) == before


def test_the_diameter_is_the_mean_of_what_was_seen() -> None:
    track = Track.begin(Reading(np.zeros(2), np.eye(2) * 1e-4, None, 0.0, 0.30), 0, CONFIG)
    for k, diameter in enumerate((0.34, 0.32), 1):
        track.predict(k * DT, FAR, D_R, CONFIG)
        track.correct(Reading(np.zeros(2), np.eye(2) * 1e-4, None, 0.0, diameter), CONFIG)
    assert track.diameter == pytest.approx(0.32)
    assert not track.oriented


def test_readings_that_contradict_each_other_are_never_believed() -> None:
    track = fed([(1.0, 0.0)] * 20)
    for x, y in [(2.0, 0.0), (-3.0, 1.0), (0.0, 4.0), (5.0, 5.0), (-2.0, 2.0)]:
        assert not track.correct(reading(x, y), CONFIG)
    assert math.hypot(track.mean[0] - 1.0, track.mean[1]) < 0.01


@pytest.mark.parametrize("robot", [FAR, np.array([0.7, 0.0])])
def test_the_same_silence_means_the_same_however_often_it_is_looked_at(robot: np.ndarray) -> None:
    found = []
    for steps in (1, 2, 10, 50):
        track = fed([(1.0, 0.0)] * 20)
        start = track.stamp
        for k in range(1, steps + 1):
            track.predict(start + k * SECOND // steps, robot, 0.0, CONFIG)
        found.append(track.covariance)
    for one in found[1:]:
        assert np.allclose(one, found[0], rtol=0.02)
