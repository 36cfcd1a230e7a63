"""The object motion controller: pushing and relocating blended, with feedback on gamma (7)-(10)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.controller.activation import PRIOR_KAPPA, PRIOR_MU, activations
from services.geometry.angles import direction, wrap

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Gains:
    """Gains of (8) and the speed (Sec. 6.1)."""

    k_gamma: float = 0.1
    """K_gamma"""
    k_mu_gamma: float = 0.05
    """K_mu_gamma"""
    speed: float = 0.3
    """V, m/s"""


@dataclass(frozen=True, slots=True)
class Behaviour:
    """What the law knows of the object."""

    alpha_p: float
    """rad"""
    psi_push: float
    psi_relocate: float
    gamma: float
    """rad, newest reading"""
    mean_gamma: float
    """rad, mu_gamma"""


def reference(alpha: float, alpha_p: float, psi_push: float, psi_relocate: float) -> Array:
    """Return v_reference (2,) in the push frame, of length 1 for psi that are (7), (9), (10).

    The sign of 0 is taken as +: at alpha = alpha_p exactly psi_relocate is 0, and opposite to it either way
    round the object is as good.

    Args:
        alpha, alpha_p: rad.
        psi_push, psi_relocate: activations in [0, 1].
    """
    push = math.copysign(psi_push, math.cos(alpha) + 0.0)
    relocate = math.copysign(psi_relocate, math.sin(alpha_p - alpha) + 0.0)
    return np.array((push, relocate))


def command(r: Array, o: Array, alpha: float, behaviour: Behaviour, gains: Gains) -> Array:
    """Return u (2,), m/s, map frame: the reference turned by the feedback, of length V (8).

    Args:
        r, o: (2,), m, map frame.
        alpha: rad, orientation of the push-line in the push frame.

    Raises:
        services.geometry.angles.DegenerateDirection: r and o coincide.
    """
    vx, vy = reference(alpha, behaviour.alpha_p, behaviour.psi_push, behaviour.psi_relocate)
    feedback = gains.k_mu_gamma * behaviour.mean_gamma + gains.k_gamma * behaviour.gamma
    theta = wrap(direction(r, o) + math.atan2(vy, vx) - feedback)
    return gains.speed * np.array((math.cos(theta), math.sin(theta)))


def non_adaptive(alpha: float, gamma: float, mu: float = PRIOR_MU, kappa: float = PRIOR_KAPPA) -> Behaviour:
    """Return the behaviour that the prior alone says: the non-adaptive controller (Sec. 6.3.3).

    All adaptive values are held: alpha_p = `mu`, psi as `mu` and `kappa` have them, and mu_gamma = 0, which the
    paper calls the adaptive part of the feedback. gamma itself is fed back.

    Args:
        alpha, gamma: rad.
        mu, kappa: mode of the prior.
    """
    psi_push, psi_relocate = activations(alpha, mu, kappa)
    return Behaviour(mu, psi_push, psi_relocate, gamma, 0.0)
