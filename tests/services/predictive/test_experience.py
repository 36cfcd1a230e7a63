"""What is learned from pushes is what is there: a disc's radius, the axis of wheels, nothing where nothing happened."""

from __future__ import annotations

import math

import numpy as np
import pytest

from experiments.session import prepare, run
from runtime.config.layers import Layer
from runtime.messages import PushResponse
from runtime.sample import Sample
from services.geometry.angles import wrapped
from services.predictive import model as m
from services.predictive.experience import Experience
from services.predictive.known import Known

BASE = np.array([0.4, 0.1, 0.23])


def pushed_about(response: np.ndarray, seconds: float, noise: float, before: Known | None = None) -> Experience:
    """Let a robot push an object of this response here and there, and learn from noisy positions."""
    generator = np.random.default_rng(5)
    contour = m.prior_contour(0.46, 0.3)
    known = Experience.of(0.46, 0.3, seed=1, known=before)
    state = np.zeros(m.STATE)
    state[m.RX] = -0.5
    angle = 0.0
    for k in range(round(seconds / 0.05)):
        if k % 60 == 0:  # from another side
            angle = float(generator.uniform(-math.pi, math.pi))
            state[m.RX] = state[m.X] - 0.42 * math.cos(angle)
            state[m.RY] = state[m.Y] - 0.42 * math.sin(angle)
            state[m.RVX : m.STATE] = 0.0
            state[[m.VX, m.VY, m.OMEGA]] = 0.0
            known.rows = []
        for _ in range(10):
            m.step(state, 0.3 * math.cos(angle + 0.2), 0.3 * math.sin(angle + 0.2), 0.0, 0.005, BASE, contour, response)
        seen = state[[m.RX, m.RY, m.X, m.Y]] + noise * generator.standard_normal(4)
        yaw = state[m.YAW] + 0.035 * generator.standard_normal()
        known.observe(50_000_000 * (k + 1), (seen[0], seen[1]), (seen[2], seen[3]), float(yaw), 0.0, BASE)
    return known


def test_the_axis_of_wheels_is_found_and_predictions_get_better() -> None:
    response = m.prior_response(0.3)
    response[[m.ANISOTROPY, m.AXIS, m.COASTING]] = 2.0, 0.6, 0.5
    known = pushed_about(response, 40.0, 0.007)
    found, axis = known.response[m.ANISOTROPY], known.response[m.AXIS]
    if found < 0.0:  # the same surface, named by its other axis
        found, axis = -found, axis + 0.5 * math.pi
    assert found > 1.2
    assert abs(wrapped(2.0 * (axis - 0.6))) < 2.0 * math.radians(10.0)
    assert known.error < 0.6 * known.prior_error


def test_an_even_disc_stays_one() -> None:
    known = pushed_about(m.prior_response(0.3), 40.0, 0.007)
    assert abs(known.response[m.ANISOTROPY]) < 0.5
    assert known.error < 1.05 * known.prior_error


def test_nothing_is_learned_from_standing_still() -> None:
    known = Experience.of(0.46, 0.3, seed=1)
    for k in range(200):
        known.observe(50_000_000 * (k + 1), (-1.0, 0.0), (0.0, 0.0), 0.0, 0.0, BASE)
    assert (known.touches, known.seen) == (0, 0)
    assert np.array_equal(known.response, known.prior)


def test_the_distance_of_touch_of_a_real_disc_is_found() -> None:
    samples: list[PushResponse] = []

    def keep(sample: Sample) -> None:
        if sample.topic == "push/response":
            samples.append(PushResponse.FromString(sample.payload))

    method = {"scene": "open", "object": "can", "seed": 4, "strategy": "predictive", "controller": "predictive"}
    session = prepare([Layer("test", {"sim": method})])
    run(session, sinks=[keep])
    last = samples[-1]
    # The can is a disc of 0.24 m, drawn within its range; the base is one of 0.46 m.
    true = 0.5 * (0.46 + session.effective.sections["driver"].body.diameter)  # type: ignore[attr-defined]
    assert last.touches > 20
    assert m.radius(np.array(last.contour), math.pi)[0] == pytest.approx(true, abs=0.02)


def test_touches_on_one_side_do_not_move_the_far_side_out_of_the_bounding_circle() -> None:
    known = Experience.of(0.46, 0.3, seed=1)
    generator = np.random.default_rng(2)
    for k in range(600):
        # Pushed along x from behind, the contact wandering over a slanting side.
        x, aside = 0.01 * k, 0.35 * math.sin(0.03 * k)
        reach = 0.33 + 0.15 * aside
        r = (x - reach * math.cos(aside), reach * math.sin(aside))
        seen = generator.normal(0.0, 0.005, 4)
        known.observe(50_000_000 * (k + 1), (r[0] + seen[0], r[1] + seen[1]), (x + seen[2], seen[3]), 0.0, 0.0, BASE)
    assert known.touches > 100
    reaches = [m.radius(known.contour, b)[0] for b in np.linspace(-math.pi, math.pi, 73)]
    assert max(reaches) < 0.5 * (0.46 + 0.3) + 0.02, reaches
    assert m.radius(known.contour, math.pi)[0] == pytest.approx(0.33, abs=0.02)
