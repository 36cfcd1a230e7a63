"""How much to push and how much to relocate, from the distribution of good alphas (Sec. 5.3)."""

from __future__ import annotations

import math

PRIOR_MU = 0.0
"""rad, mode of the prior R_0 = 5.84, c = 7, phi = 0."""

PRIOR_KAPPA = 3.3747804587839596
"""Its concentration: I_1(kappa)/I_0(kappa) = R_0/c."""


def activations(alpha: float, mu: float, kappa: float) -> tuple[float, float]:
    """Return psi_push = p(alpha)/p(mu) and psi_relocate = sqrt(1 - psi_push^2), both in [0, 1].

    p is the von Mises density (11). Its ratio needs no Bessel function and does not overflow.

    Args:
        alpha: rad, orientation of the push-line in the push frame.
        mu: rad, mean direction of the good alphas.
        kappa: their concentration.
    """
    exponent = kappa * (math.cos(alpha - mu) - 1.0)
    return math.exp(exponent), math.sqrt(-math.expm1(2.0 * exponent))
