"""Whole runs: determinism over processes, going on, Ctrl-C, recordings of failures."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from pyarrow import parquet

from experiments.paper import store
from experiments.paper.cells import cells, tasks
from experiments.paper.store import BadRun, Store
from experiments.paper.trial import Outcome, attempt
from experiments.paper.whole import Order, carry_out
from replays.recording import load
from runtime.config.layers import ConfigError, Layer
from runtime.messages import PushOutcome, PushStatus
from tests.experiments.trials import failed, outcome


def order(folder: Path, **changes: object) -> Order:
    facts: dict[str, object] = {
        "experiments": ("strategies",),
        "trials": 1,
        "jobs": 1,
        "first_seed": 4,
        "folder": folder,
        "methods": ("relaxed",),
        "starts": (),
        "failures": 0,
        "drawn": False,
        "layers": [],
        "command": "pushlane experiment strategies",
    }
    return Order(**(facts | changes))  # type: ignore[arg-type]


def test_a_tiny_run_writes_everything_and_goes_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert carry_out(order(tmp_path, drawn=True))
    report = (tmp_path / "report.md").read_text()
    assert "Fewer than 200 trials a cell. There are: Experiment 1, 1 a cell of its tables." in report
    assert "Experiment 1: success" in report and "17/20 = 85.0 %" in report
    table = parquet.read_table(tmp_path / "trials.parquet")
    assert sorted(table.column("scene").to_pylist()) == ["1A", "1B", "2A", "2B"]
    assert set(table.column_names) == set(Outcome.__struct_fields__)
    assert (tmp_path / "plots" / "fig-7c.png").stat().st_size > 5000
    assert (tmp_path / "plots" / "fig-7c.svg").read_text().startswith("<?xml")
    capsys.readouterr()
    before = (tmp_path / "trials.jsonl").read_bytes()
    # More trials add to those there are; those are not run again.
    lines = before.splitlines()
    (tmp_path / "trials.jsonl").write_bytes(b"\n".join(lines[:3]) + b"\n" + lines[3][:40])
    assert carry_out(order(tmp_path))
    assert "3 of 4 trials are there already" in capsys.readouterr().out
    assert (tmp_path / "trials.jsonl").read_bytes() == before


@pytest.mark.slow
def test_the_number_of_processes_changes_nothing(tmp_path: Path) -> None:
    for jobs in (1, 2):
        assert carry_out(order(tmp_path / str(jobs), jobs=jobs, starts=("front",)))
    one, two = ((tmp_path / jobs / "trials.parquet").read_bytes() for jobs in "12")
    assert one == two
    assert parquet.read_table(tmp_path / "1" / "trials.parquet").num_rows == 5


def test_a_run_goes_on_only_as_it_began(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Store(tmp_path, [], 1).close()
    Store(tmp_path, [], 1).close()
    with pytest.raises(BadRun, match="begun with --seed 1, this one has 2"):
        Store(tmp_path, [], 2)
    with pytest.raises(BadRun, match=r"begun with settings \[\], this one has .*controller"):
        Store(tmp_path, [Layer("--set", {"controller": {"speed": 0.2}})], 1)
    monkeypatch.setattr(store, "code_digest", lambda: "other")
    with pytest.raises(BadRun, match="begun with code .*, this one has other"):
        Store(tmp_path, [], 1)


def test_what_is_stored_comes_back(tmp_path: Path) -> None:
    kept = Store(tmp_path, [], 1)
    trials = [failed("stall", seed=2, distance=None, turn=None), outcome(seed=1)]
    for one in trials:
        kept.add(one)
    kept.close()
    _, found = store.stored(tmp_path)
    assert found == sorted(trials, key=lambda one: one.seed)
    rows = parquet.read_table(tmp_path / "trials.parquet").to_pylist()
    assert [row["seed"] for row in rows] == [1, 2] and rows[1]["distance"] is None and rows[0]["time"] == 20.0
    with pytest.raises(BadRun, match="expected the folder of a run"):
        store.stored(tmp_path / "nowhere")
    (tmp_path / "trials.jsonl").write_text("no trial\n")
    with pytest.raises(BadRun, match="expected a trial in every line"):
        store.stored(tmp_path)


def test_the_digest_of_the_code_sees_a_change(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "runtime").mkdir()
    (tmp_path / "services").mkdir()
    (tmp_path / "experiments").mkdir()
    for name in ("runtime/__init__.py", "services/a.py", "experiments/session.py", "experiments/scoring.py"):
        (tmp_path / name).write_text("a = 1\n")
    monkeypatch.setattr("runtime.__file__", str(tmp_path / "runtime" / "__init__.py"))
    first = store.code_digest()
    assert store.code_digest() == first
    (tmp_path / "services" / "a.py").write_text("a = 2\n")
    assert store.code_digest() != first


def test_a_failure_leaves_its_recording(tmp_path: Path) -> None:
    # A time limit that no push can keep.
    layers = [Layer("test", {"sim": {"time_limit": 2.0}})]
    wanted = next(tasks(cells(["strategies"], ["relaxed"], ()), 1, 4))
    assert attempt(wanted, layers).cause == "time limit"
    assert carry_out(order(tmp_path, layers=layers, failures=1))
    files = sorted((tmp_path / "failures").rglob("*.mcap"))
    assert [file.parent.name for file in files] == [f"strategies-{name}-relaxed" for name in ("1A", "1B", "2A", "2B")]
    recording = load(files[0])
    assert recording.damage is None
    last = [one for (topic, _), one in recording.samples.items() if topic == "push/status"][-1]
    assert PushStatus.FromString(last.payload).outcome == PushOutcome.FAILED
    listed = (tmp_path / "failures.md").read_text()
    assert (
        "--scene 1A --object orange-cylinder --strategy relaxed --controller adaptive --precision 0.05 --seed 4"
        in listed
    )
    assert '"time_limit":2.0' in listed
    assert "failures/strategies-1A-relaxed/seed-4.mcap" in (tmp_path / "report.md").read_text()


def test_wrong_options_are_said_before_anything_is_run(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no start is called 'above'; expected some of behind, beside, front"):
        carry_out(order(tmp_path, starts=("above",)))
    with pytest.raises(ConfigError, match="no method of strategies among them"):
        carry_out(order(tmp_path, methods=("dipole",)))
    with pytest.raises(Exception, match="scene '1A' cannot be scaled"):
        carry_out(order(tmp_path, layers=[Layer("--set", {"sim": {"width": 1.3}})]))
    assert not (tmp_path / "run.json").exists()


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_keeps_what_it_has_and_says_so(tmp_path: Path, number: signal.Signals) -> None:
    command = [sys.executable, "-m", "runtime.cli.main", "experiment", "strategies", "--trials", "50", "--jobs", "2"]
    # A group of its own, so that nothing of it is left if it does not end.
    with subprocess.Popen(
        [*command, "--methods", "relaxed", "--starts", "", "-o", str(tmp_path)],
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            file = tmp_path / "trials.jsonl"
            end = time.monotonic() + 60.0
            while time.monotonic() < end and not (file.exists() and file.stat().st_size):
                time.sleep(0.2)
            process.send_signal(number)
            output, _ = process.communicate(timeout=60)
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 130
    assert "interrupted" in output
    _, kept = store.stored(tmp_path)
    assert kept
    assert f"- {len(kept)} trials." in (tmp_path / "report.md").read_text()
