from __future__ import annotations

from pathlib import Path

import pytest

from experiments.session import prepare, run
from runtime.config.layers import Layer
from tests.replays.inspect.synthetic_session import write_session


@pytest.fixture(scope="session")
def push(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A whole made-up session of 8 s."""
    out = tmp_path_factory.mktemp("sessions") / "push.mcap"
    write_session(out, 8.0)
    return out


@pytest.fixture(scope="session")
def predicted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A real push with the predictive method, of 10 s."""
    out = tmp_path_factory.mktemp("sessions") / "predicted.mcap"
    method = {"strategy": "predictive", "controller": "predictive", "time_limit": 10.0}
    run(prepare([Layer("test", {"sim": {"scene": "corridor-2", "object": "cart", "seed": 1, **method}})]), out)
    return out
