from __future__ import annotations

from pathlib import Path

import pytest

from tests.replays.inspect.synthetic_session import write_session


@pytest.fixture(scope="session")
def push(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A whole made-up session of 8 s."""
    out = tmp_path_factory.mktemp("sessions") / "push.mcap"
    write_session(out, 8.0)
    return out
