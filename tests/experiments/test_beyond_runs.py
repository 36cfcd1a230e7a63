"""Whole runs of the experiments past the paper's: files, going on, other methods beside, recordings of failures."""

from __future__ import annotations

from pathlib import Path

import pytest
import typer
from pyarrow import parquet
from typer.testing import CliRunner

from experiments.beyond import cases, cli
from experiments.beyond.whole import Order, carry_out
from experiments.paper.cells import UnknownMethod
from experiments.paper.trial import Outcome, attempt
from replays.recording import load
from runtime.config.layers import Layer

# No push is done so soon: trials take no time, and each leaves its recording.
_SOON = [Layer("test", {"sim": {"time_limit": 1.0}})]


def order(folder: Path, chosen: list[cases.Case], **changes: object) -> Order:
    facts: dict[str, object] = {
        "cases": tuple(chosen),
        "method": "predictive",
        "trials": 1,
        "jobs": 1,
        "first_seed": 4,
        "folder": folder,
        "failures": 0,
        "drawn": True,
        "layers": _SOON,
        "command": "pushlane experiment best",
    }
    return Order(**(facts | changes))  # type: ignore[arg-type]


def test_a_tiny_run_writes_everything_and_goes_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    chosen = [case for case in cases.best() if case.pushes[0][0] in ("corridor-1", "1B")][2:5]
    assert carry_out(order(tmp_path, chosen))
    report = (tmp_path / "report.md").read_text()
    assert "**Fewer than 200 trials a case: there are 1.**" in report
    assert "| predictive | width 1.3, yaw seen | 0/1 | 0.0 % [0.0, 79.3] | 99.5 % | missed | - | - | 0 |" in report
    assert "time limit 1 |" in report and "![Success" in report
    rows = parquet.read_table(tmp_path / "trials.parquet").to_pylist()
    assert set(rows[0]) == set(Outcome.__struct_fields__)
    assert sorted(row["case"] for row in rows) == sorted(case.name for case in chosen)
    assert (tmp_path / "plots" / "best.png").stat().st_size > 5000
    assert (tmp_path / "plots" / "best.svg").read_text().startswith("<?xml")
    before = (tmp_path / "trials.jsonl").read_bytes()
    capsys.readouterr()
    # What is there is not run again; without yaw and other methods go beside it.
    blind = cases.best(yaw=False)[6:7]
    assert carry_out(order(tmp_path, chosen))
    assert (tmp_path / "trials.jsonl").read_bytes() == before
    assert carry_out(order(tmp_path, blind, drawn=False))
    assert carry_out(order(tmp_path, chosen[:1], method="relaxed/adaptive", drawn=False))
    assert "3 of 3 trials are there already" in capsys.readouterr().out
    kinds = {(row["method"], row["case"]) for row in parquet.read_table(tmp_path / "trials.parquet").to_pylist()}
    assert len(kinds) == 5 and ("relaxed/adaptive", chosen[0].name) in kinds and ("predictive", blind[0].name) in kinds


def test_a_failure_leaves_its_seed_and_recording(tmp_path: Path) -> None:
    (case,) = [case for case in cases.around() if case.name.endswith("at 180 deg")][:1]
    assert carry_out(order(tmp_path, [case], failures=1, drawn=False))
    (file,) = (tmp_path / "failures").rglob("*.mcap")
    assert file.relative_to(tmp_path / "failures") == Path(
        "open-open-cheezit-friction-0.2-goal-at-180-deg-predictive"
    ) / ("seed-16.mcap")
    recording = load(file)
    assert recording.damage is None
    assert recording.config["sections"]["sim"]["goal"] == pytest.approx([-4.0, 0.0])
    listed = (tmp_path / "failures.md").read_text()
    assert (
        "--scene open --object cheezit --strategy predictive --controller predictive --precision 0.05 --seed 16"
        in listed
    )
    assert "--set 'sim.goal=[-4.0,0.0]' --set sim.object_friction=0.2" in listed


@pytest.mark.slow
def test_objects_of_every_size_are_delivered(tmp_path: Path) -> None:
    # On an open floor straight ahead; what is said of size, mass and friction must not upset the physics.
    for settings in ({"object_diameter": 0.06}, {"object_diameter": 0.6}, {"object_mass": 0.05}, {"object_mass": 3.0}):
        case = cases.Case(
            "open", cases.goal_name(0.4, 0), (("open", "box"),), {"sim": settings | {"goal": [-0.5, 0.0]}}
        )
        (task,) = cases.tasks([case], "predictive", 1, 2)
        assert attempt(task, []).success, settings


def test_wrong_options_are_said_before_anything_is_run(tmp_path: Path) -> None:
    with pytest.raises(UnknownMethod):
        carry_out(order(tmp_path / "a", cases.best(), method="bang"))
    with pytest.raises(Exception, match="sim.object_friction is 0.3, but object 'plane' has wheels"):
        carry_out(
            order(
                tmp_path / "a", cases.sweep(["noise"]), trials=7, layers=[Layer("x", {"sim": {"object_friction": 0.3}})]
            )
        )
    assert not (tmp_path / "a").exists()


@pytest.mark.parametrize("verb", ["best", "open", "orientation", "robustness"])
def test_every_verb_has_the_options_of_the_others(verb: str) -> None:
    found = CliRunner().invoke(experiment(), [verb, "--help"], env={"COLUMNS": "200", "TERM": "dumb"})
    assert found.exit_code == 0
    for option in ("--trials", "--jobs", "--seed", "--output", "--method", "--set", "--failures"):
        assert option in found.output
    assert ("--without-yaw" in found.output) == (verb == "best")


def test_the_verbs_do_what_their_options_say(tmp_path: Path) -> None:
    options = ["--jobs", "1", "--failures", "0", "--no-plots", "--seed", "9", "--set", "sim.time_limit=0.5"]
    speeds = ["robustness", "--parameters", "speed", "--trials", "1", "-o", str(tmp_path / "a"), *options]
    found = CliRunner().invoke(experiment(), speeds)
    assert found.exit_code == 0, found.output
    rows = parquet.read_table(tmp_path / "a" / "trials.parquet").to_pylist()
    assert sorted(row["case"] for row in rows) == [f"speed 0.{k} m/s" for k in range(1, 6)]
    assert {(row["seed"], row["method"], row["precision"]) for row in rows} == {(9, "predictive", 0.05)}
    assert not (tmp_path / "a" / "plots").exists()
    blind = ["best", "--without-yaw", "--trials", "1", "--method", "strict/dipole", "-o", str(tmp_path / "b"), *options]
    found = CliRunner().invoke(experiment(), blind)
    assert found.exit_code == 0, found.output
    rows = parquet.read_table(tmp_path / "b" / "trials.parquet").to_pylist()
    assert len(rows) == 20 and all(row["case"].endswith("no yaw") for row in rows)
    assert {(row["strategy"], row["controller"]) for row in rows} == {("strict", "dipole")}


def experiment() -> typer.Typer:
    made = typer.Typer()
    cli.register(made)
    return made
