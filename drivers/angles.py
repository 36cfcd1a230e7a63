"""Angles in radians, wrapped to (-pi, pi]. Drivers wrap angles here and nowhere else."""

from __future__ import annotations

import math


def wrap(angle: float) -> float:
    """Return `angle` (rad, finite) wrapped to (-pi, pi]."""
    return float(angle - math.tau * math.ceil((angle - math.pi) / math.tau))
