"""What is kept of a push that ends for want of a way."""

from __future__ import annotations

from pathlib import Path

import pytest

from experiments import watching
from experiments.session import prepare
from runtime.local import PushResult
from runtime.messages import FailureCause, PushOutcome, PushStatus


def ended(length: float, monkeypatch: pytest.MonkeyPatch, file: Path) -> PushResult:
    status = PushStatus(
        outcome=PushOutcome.FAILED, cause=FailureCause.NO_PATH, reason="no way", robot_path_length=length
    )  # fmt: skip
    file.write_bytes(b"recorded")
    monkeypatch.setattr(watching, "run", lambda *_, **__: PushResult(status, 0))
    return watching.run_shown(prepare([]), file, terminal=False, quiet=True)[0]


def test_a_goal_that_cannot_be_reached_leaves_no_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with pytest.raises(watching.NoPath, match="no way"):
        ended(0.0, monkeypatch, tmp_path / "a.mcap")
    assert not (tmp_path / "a.mcap").exists()


def test_a_push_that_loses_its_way_is_a_failed_one_with_its_recording(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    result = ended(1.2, monkeypatch, tmp_path / "a.mcap")
    assert result.status.outcome == PushOutcome.FAILED
    assert (tmp_path / "a.mcap").exists()
