"""Recordings that several tests of the replay look at."""

from __future__ import annotations

from pathlib import Path

import pytest

from experiments.session import prepare, run
from runtime.config.layers import Layer

_SIM = {"scene": "open", "goal": [1.6, 0.3], "seed": 7, "strategy": "strict", "controller": "adaptive"}
SHORT = Layer("test", {"sim": _SIM, "timing": {"snapshot_period": 2.0}})


@pytest.fixture(scope="session")
def session_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short delivered push of about ten seconds."""
    path = tmp_path_factory.mktemp("sessions") / "short.mcap"
    run(prepare([SHORT]), path)
    return path
