"""The von Mises model of good push angles: conjugate prior, posterior and MAP estimate (11)-(13).

The posterior stays in the prior's family: R_n e^(i phi_n) = R_0 e^(i phi) + sum of e^(i alpha), c_n = c + n.
Its logarithm is R_n kappa cos(phi_n - mu) - c_n ln I_0(kappa) + constant, which is greatest at mu = phi_n and
I_1(kappa)/I_0(kappa) = R_n/c_n. The constant factor 2 pi and the missing power of it in (13) play no part.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy.special import i0e, i1e

from services.geometry.angles import wrap

R_0 = 5.84
C = 7.0
PHI = 0.0

_LARGE = 1e5


class BadPrior(ValueError):
    """The hyperparameters are no prior: 0 <= R_0 < c and finite is asked for."""


@dataclass(frozen=True, slots=True)
class Posterior:
    """Hyperparameters of (13), R and phi as a vector."""

    x: float
    """R_n cos phi_n"""
    y: float
    """R_n sin phi_n"""
    c: float
    """c_n"""


@dataclass(frozen=True, slots=True)
class Estimate:
    """The MAP estimate of the good alphas' distribution (11)."""

    mu: float
    """rad in (-pi, pi]; also alpha_p, since E[alpha | mu, kappa] = mu"""
    kappa: float
    """concentration"""


def prior(r_0: float = R_0, c: float = C, phi: float = PHI) -> Posterior:
    """Return the prior (13).

    Raises:
        BadPrior: not 0 <= `r_0` < `c`, or a value is not finite.
    """
    if not (math.isfinite(r_0) and math.isfinite(c) and math.isfinite(phi) and 0.0 <= r_0 < c):
        raise BadPrior(f"a prior needs 0 <= R_0 < c, finite; got R_0 = {r_0:g}, c = {c:g}, phi = {phi:g}")
    return Posterior(r_0 * math.cos(phi), r_0 * math.sin(phi), c)


def update(posterior: Posterior, alpha: float, limit: float = math.inf) -> Posterior:
    """Return the posterior after one more good `alpha` (rad) (12).

    Args:
        limit: greatest c_n. Beyond it the past is scaled down, which forgets; the paper does not.
    """
    x, y, c = posterior.x + math.cos(alpha), posterior.y + math.sin(alpha), posterior.c + 1.0
    scale = min(1.0, limit / c)
    return Posterior(x * scale, y * scale, c * scale)


def estimate(posterior: Posterior) -> Estimate:
    """Return the mode of the posterior. Where R_n = 0 every mu is as good: mu = 0, kappa = 0."""
    r = math.hypot(posterior.x, posterior.y)
    mu = wrap(math.atan2(posterior.y, posterior.x)) if r > 0.0 else 0.0
    return Estimate(mu, concentration(r / posterior.c))


def concentration(ratio: float) -> float:
    """Return the kappa with I_1(kappa)/I_0(kappa) = `ratio`, to about a relative 1e-15 * max(1, kappa).

    Raises:
        ValueError: `ratio` is not in [0, 1).
    """
    if not 0.0 <= ratio < 1.0:
        raise ValueError(f"I_1/I_0 takes values in [0, 1), not {ratio:g}")
    if ratio == 0.0:
        return 0.0
    # Start: ratio (2 - ratio^2)/(1 - ratio^2), which is right in both limits to first order.
    kappa = ratio * (2.0 - ratio * ratio) / (1.0 - ratio * ratio)
    for _ in range(20):
        a = float(i1e(kappa)) / float(i0e(kappa))
        # The second is the first's limit, without its cancellation.
        steep = 1.0 - a / kappa - a * a if kappa < _LARGE else 0.5 / (kappa * kappa)
        step = (a - ratio) / steep
        # The function is concave: from the right Newton can overshoot below 0, never from the left.
        kappa = max(kappa - step, 0.5 * kappa)
        if abs(step) <= 1e-13 * kappa:
            break
    return kappa
