"""The golden pushes still come out as they were recorded."""

from __future__ import annotations

from pathlib import Path

import pytest

from replays import goldens, report
from replays.recording import load
from replays.replay import replay
from runtime.messages import Corridor, PushTarget


def test_there_is_a_recording_of_every_golden_and_no_other() -> None:
    assert {path.stem for path in goldens.paths()} == set(goldens.GOLDENS)
    assert len(goldens.GOLDENS) >= 4


def test_goldens_differ_in_what_matters() -> None:
    sims = [values["sim"] for values in goldens.GOLDENS.values()]
    for key in ("scene", "strategy", "object"):
        assert len({one.get(key, "default") for one in sims}) >= 4
    outcomes = [goldens.outcome(load(path)) for path in goldens.paths()]
    assert any(one.startswith("failed") for one in outcomes)
    assert sum(one.startswith("delivered") for one in outcomes) >= 3


@pytest.mark.parametrize("path", goldens.paths(), ids=lambda path: path.stem)
def test_golden_replays_identically(path: Path) -> None:
    found = replay(load(path))
    assert found.recording.damage is None
    assert found.identical, "\n".join(report.text(found))


@pytest.mark.parametrize("path", goldens.paths(), ids=lambda path: path.stem)
def test_recorded_targets_lie_on_the_recorded_path(path: Path) -> None:
    samples = load(path).samples
    corridors = [Corridor.FromString(s.payload) for (topic, _), s in samples.items() if topic == "corridor"]
    corridor = corridors[0]
    points = list(zip(corridor.path.x, corridor.path.y, strict=True))
    for (topic, _), sample in samples.items():
        if topic == "push/target":
            target = PushTarget.FromString(sample.payload)
            nearest = min(((x - target.target.x) ** 2 + (y - target.target.y) ** 2) ** 0.5 for x, y in points)
            assert nearest <= 0.03  # points are at most 0.05 m apart
