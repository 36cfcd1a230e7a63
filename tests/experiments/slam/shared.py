"""Where the shared data folder is: beside the project, or where PUSHLANE_SHARED says."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

SHARED = Path(os.environ.get("PUSHLANE_SHARED", Path(__file__).parents[4] / "shared" / "data"))


def needed(path: Path) -> pytest.MarkDecorator:
    """Return the mark of tests that need `path`, of the shared data."""
    return pytest.mark.skipif(not path.exists(), reason=f"{path} is not there; PUSHLANE_SHARED names its folder")
