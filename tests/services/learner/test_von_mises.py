import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq, minimize
from scipy.special import i0e, i1e, iv

from services.learner.von_mises import BadPrior, concentration, estimate, prior, update

angles = st.lists(st.floats(-math.pi, math.pi), min_size=0, max_size=40)


def posterior_of(samples: list[float]):
    found = prior()
    for alpha in samples:
        found = update(found, alpha)
    return found


def log_density(mu: float, kappa: float, samples: list[float]) -> float:
    """ln of prior (13) times likelihood (11), up to a constant."""
    log_i0 = math.log(i0e(kappa)) + kappa
    value = 5.84 * kappa * math.cos(mu) - 7.0 * log_i0
    return value + sum(kappa * math.cos(a - mu) - log_i0 for a in samples)


def test_the_prior_alone_is_the_findings_kappa() -> None:
    found = estimate(prior())
    assert found.mu == 0.0
    assert found.kappa == pytest.approx(3.375, abs=5e-4)
    assert iv(1, found.kappa) / iv(0, found.kappa) == pytest.approx(5.84 / 7, rel=1e-12)


@given(st.floats(1e-6, 0.9999))
def test_concentration_solves_the_bessel_ratio(ratio: float) -> None:
    kappa = concentration(ratio)
    expected = brentq(lambda k: i1e(k) / i0e(k) - ratio, 0, 1e5, xtol=1e-14, rtol=1e-14)
    assert kappa == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("kappa", [1e-3, 0.5, 3.375, 50.0, 2e4])
def test_concentration_inverts_the_ratio(kappa: float) -> None:
    assert concentration(i1e(kappa) / i0e(kappa)) == pytest.approx(kappa, rel=1e-9)


def test_concentration_is_finite_up_to_1() -> None:
    assert concentration(0.0) == 0.0
    assert concentration(1 - 1e-12) == pytest.approx(0.5e12, rel=1e-3)
    for bad in (1.0, -0.1, math.nan):
        with pytest.raises(ValueError, match="I_1/I_0"):
            concentration(bad)


@settings(max_examples=30)
@given(angles)
def test_the_estimate_maximises_the_posterior(samples: list[float]) -> None:
    found = estimate(posterior_of(samples))
    assume(found.kappa > 1e-3)
    best = minimize(
        lambda v: -log_density(v[0], math.exp(v[1]), samples),
        (found.mu + 0.2, math.log(found.kappa) + 0.3),
        method="Nelder-Mead",
        options={"xatol": 1e-7, "fatol": 1e-13, "maxiter": 4000},
    )
    assert log_density(found.mu, found.kappa, samples) >= -best.fun - 1e-9
    assert math.cos(found.mu - best.x[0]) == pytest.approx(1.0, abs=1e-4)
    assert found.kappa == pytest.approx(math.exp(best.x[1]), rel=1e-2, abs=1e-3)


@given(angles)
def test_hyperparameters_are_the_sum_of_phasors(samples: list[float]) -> None:
    found = posterior_of(samples)
    total = 5.84 + np.exp(1j * np.array(samples)).sum()
    assert (found.x, found.y, found.c) == pytest.approx((total.real, total.imag, 7 + len(samples)))


def test_a_limit_forgets() -> None:
    found = prior()
    for _ in range(500):
        found = update(found, 1.0, limit=20.0)
    assert found.c == pytest.approx(20)
    assert estimate(found).mu == pytest.approx(1.0, abs=1e-3)


def test_opposite_samples_leave_no_direction() -> None:
    found = update(prior(1.0, 7.0, 0.0), math.pi)
    assert estimate(found).kappa == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize(("r_0", "c"), [(7.0, 7.0), (-1.0, 7.0), (1.0, math.inf), (math.nan, 7.0)])
def test_bad_priors_are_refused(r_0: float, c: float) -> None:
    with pytest.raises(BadPrior):
        prior(r_0, c)
