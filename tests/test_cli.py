"""The command line: whole runs, listings, and errors that name what is wrong without a traceback."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from drivers.sapien import objects, scene
from experiments.session import prepare
from services.names import CONTROLLERS, STRATEGIES
from services.task.config import TaskConfig

SHORT = ["--perception", "truth", "--scene", "open", "--goal", "1.6", "0.3"]


def pushlane(*arguments: str, cwd: Path | None = None, columns: int = 120) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "runtime.cli.main", *arguments],
        capture_output=True,
        text=True,
        check=False,
        cwd=cwd,
        timeout=120,
        env={"PATH": "/usr/bin:/bin", "PYTHONPATH": str(Path(__file__).parent.parent), "COLUMNS": str(columns)},
    )


def test_a_push_is_recorded_and_replays(tmp_path: Path) -> None:
    ran = pushlane("sim", *SHORT, "--strategy", "strict", "--seed", "7", "-o", "a.mcap", cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.splitlines()[-1].startswith("DELIVERED: cylinder in open, strict, adaptive, seed 7")
    assert "times real time" in ran.stdout
    assert "\x1b" not in ran.stdout  # plain lines where there is no terminal
    replayed = pushlane("replay", "a.mcap", cwd=tmp_path)
    assert replayed.returncode == 0
    assert replayed.stdout.splitlines()[-1].startswith("IDENTICAL byte for byte")
    found = json.loads(pushlane("replay", "a.mcap", "--json", "--service", "task", cwd=tmp_path).stdout)
    assert found["identical"] is True
    assert [one["name"] for one in found["services"]] == ["task"]
    differs = pushlane("replay", "a.mcap", "--service", "controller", "--set", "controller.speed=0.2", cwd=tmp_path)
    assert differs.returncode == 1
    assert "DIFFERENT: controller" in differs.stdout
    data = bytearray((tmp_path / "a.mcap").read_bytes())
    data[len(data) // 2] ^= 4
    (tmp_path / "b.mcap").write_bytes(data)
    corrupt = pushlane("replay", "b.mcap", cwd=tmp_path)
    assert corrupt.returncode == 2
    assert "Traceback" not in corrupt.stderr


def test_two_processes_give_the_same_payloads(tmp_path: Path) -> None:
    from replays.recording import load

    for name in ("a.mcap", "b.mcap"):
        assert pushlane("sim", *SHORT, "-o", name, cwd=tmp_path).returncode == 0
    a, b = (load(tmp_path / name) for name in ("a.mcap", "b.mcap"))
    assert a.samples == b.samples
    assert a.snapshots == b.snapshots
    assert a.journals == b.journals


def test_a_failed_push_exits_with_1_and_is_kept(tmp_path: Path) -> None:
    ran = pushlane("sim", *SHORT, "--time-limit", "3", "-o", "a.mcap", "--json", cwd=tmp_path)
    assert ran.returncode == 1
    facts = json.loads(ran.stdout)
    assert (facts["outcome"], facts["cause"]) == ("failed", "time_limit")
    assert (tmp_path / "a.mcap").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--goal", "100", "100"], "goal (100.00, 100.00) m is outside of the map, which has x from "),
        (["--scene", "open", "--goal", "-90", "0"], "goal (-90.00, 0.00) m is outside of the map"),
        (["--goal", "4.0", "6.95"], "goal (4.00, 6.95) m is 0.050 m from the nearest obstacle; 0.230 m are needed"),
        (["--scene", "corridor-1", "--set", "perception.object_diameter=2.5"], "2.500 m"),
        (["--scene", "nowhere"], "no scene is called 'nowhere'; known are 1A, 1B"),
        (["--object", "elephant"], "no object is called 'elephant'; known are"),
        (["--strategy", "brave"], "no strategy is called 'brave'; expected one of strict, relaxed"),
        (["--controller", "brave"], "no controller is called 'brave'; expected one of adaptive"),
        (["--goal", "nan", "1"], "--goal nan 1: expected a place on the map, two finite numbers in m"),
        (["--set", "sim.goal=[1.0, inf]"], "--set: sim.goal[1]: expected a finite number (found inf)"),
        (["--precision", "0"], "--precision 0: expected a distance in m, above 0 and at most 5"),
        (["--precision", "nan"], "--precision nan: expected a distance in m, above 0"),
        (["--time-limit", "0"], "--time-limit 0: expected a time in s, above 0 and at most 36000"),
        (["--time-limit", "-5"], "--time-limit -5: expected a time in s"),
        (["--yaw", "400"], "--yaw 400: expected degrees from -360 to 360"),
        (["--seed", "-1"], "--seed: sim.seed: expected `int` >= 0"),
        (["--set", "controller.sped=1"], "--set: controller.sped: no such key; did you mean 'speed'?"),
        (["--set", "controller.speed=fast"], "--set: controller.speed: expected `float`, got `str` (found 'fast')"),
        (["--set", "nonsense"], "expected section.key=value"),
        (["--config", "missing.toml"], "cannot read missing.toml"),
        (["--set", "timing.latency.nothing=1.0"], "no topic 'nothing'"),
        (["-o", "no/such/folder.mcap"], "cannot write no/such/folder.mcap"),
        (["-o", "."], ". is there already"),
        (["--perception", "eyes"], "--perception: sim.perception: expected one of sensors, truth (found 'eyes')"),
        (["--link", "usb"], "--link: sim.link: expected one of direct, rest, serial (found 'usb')"),
        (["--set", "sim.tagged=maybe"], "--set: sim.tagged: expected one of true, false (found 'maybe')"),
        (["--set", "sim.start=3"], "--set: sim.start: expected one of behind, beside, front, scene (found 3)"),
        (["--set", "sim.seed=one"], "--set: sim.seed: expected `int`, got `str` (found 'one')"),
        (["--tags"], "--tags: needs perception from sensors to have an effect; sim.perception is truth (--perception)"),
        (["--no-tags"], "--no-tags: needs perception from sensors"),
        (["--map", "plan"], "--map: needs perception from sensors"),
        (["--set", "sim.depth=true"], "--set sim.depth: needs perception from sensors"),
        (["--set", "learner.r0=9"], "--set: learner: r0 is 9, expected less than c, 7"),
        (["--set", "task.strategy=brave"], "predictive, relaxed, strict, switching (found 'brave')"),
        (["--set", "perception.latency_low=0.5"], "--set: perception: latency_low is 0.5 s"),
        (["--set", "driver.scene.boxes=[]"], "--set: driver.scene and perception.scene differ"),
    ],
)
def test_mistakes_are_named_in_one_line(arguments: list[str], words: str, tmp_path: Path) -> None:
    output = [] if "-o" in arguments else ["-o", "a.mcap"]
    ran = pushlane("sim", "--perception", "truth", *arguments, *output, cwd=tmp_path)
    assert ran.returncode == 2, ran.stdout
    assert words in ran.stderr
    assert len(ran.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--to", "nan", "1"], "--to nan 1: expected a place on the map"),
        (["--to", "1", "1", "--precision", "0"], "--precision 0: expected a distance in m, above 0"),
        (["--to", "1", "1", "--time-limit", "inf"], "--time-limit inf: expected a time in s, above 0"),
        (["--to", "1", "1", "--yaw", "nan"], "--yaw nan: expected degrees"),
    ],
)
def test_a_goal_that_is_none_is_not_sent(arguments: list[str], words: str) -> None:
    ran = pushlane("push", *arguments)
    assert (ran.returncode, words in ran.stderr, len(ran.stderr.strip().splitlines())) == (2, True, 1), ran.stderr


def test_a_recording_that_is_there_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"precious")
    for arguments in (SHORT, [*SHORT, "--goal", "100", "100"]):
        ran = pushlane("sim", *arguments, "-o", "a.mcap", cwd=tmp_path)
        assert ran.returncode == 2
        assert "a.mcap is there already" in ran.stderr
        assert (tmp_path / "a.mcap").read_bytes() == b"precious"
    ran = pushlane("sim", *SHORT, "--time-limit", "1", "-o", "a.mcap", "--overwrite", cwd=tmp_path)
    assert ran.returncode == 1
    assert len((tmp_path / "a.mcap").read_bytes()) > 1000


@pytest.mark.parametrize("mode", ["local", "lockstep"])
def test_ctrl_c_ends_a_push_and_leaves_a_whole_recording(mode: str, tmp_path: Path) -> None:
    from replays.recording import load
    from replays.replay import replay

    command = [
        sys.executable,
        "-m",
        "runtime.cli.main",
        "sim",
        "--perception",
        "truth",
        "--scene",
        "2A",
        "-o",
        "a.mcap",
    ]
    command += ["--mode", mode]
    running = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert running.stdout is not None
    for line in running.stdout:
        if "pushing" in line:
            break
    running.send_signal(signal.SIGINT)
    _, errors = running.communicate(timeout=60)
    assert running.returncode == 130
    assert errors.startswith("pushlane: interrupted at ")
    loaded = load(tmp_path / "a.mcap")
    assert loaded.damage is None
    assert replay(loaded).identical


def test_results_that_cannot_be_written_are_refused_first(tmp_path: Path) -> None:
    assert pushlane("sim", *SHORT, "--time-limit", "1", "-o", "a.mcap", cwd=tmp_path).returncode == 1
    for arguments in (["inspect", "a.mcap", "--save", "no/x.rrd"], ["replay", "a.mcap", "--overlay", "no/x.rrd"]):
        ran = pushlane(*arguments, cwd=tmp_path)
        assert ran.returncode == 2
        assert "cannot write no/x.rrd" in ran.stderr
        assert "Traceback" not in ran.stderr
    ran = pushlane("replay", "a.mcap", "--set", "wheel.x=1", cwd=tmp_path)
    assert ran.returncode == 2
    assert "no section 'wheel' is replayed; what can be set is that of driver, perception" in ran.stderr
    before = (tmp_path / "a.mcap").read_bytes()
    for arguments, words in (
        (["inspect", "a.mcap", "--save", "a.mcap"], "a.mcap is a recording"),
        (["replay", "a.mcap", "--overlay", "a.mcap"], "a.mcap is a recording"),
        (["replay", "a.mcap", "--start", "nan"], "--start: expected a time in s"),
        (["replay", "a.mcap", "--start", "1000"], "--start 1000: a.mcap goes from 0.05 s to 1."),
        (["replay", "a.mcap", "--start", "-1"], "--start -1: a.mcap goes from 0.05 s to 1."),
        (["replay", "a.mcap", "--service", "task", "--set", "controller.k_gamma=1"], "that of task"),
        (["replay", "a.mcap", "--set", "controller.sped=1"], "--set: controller.sped: no such key; did you mean"),
        (["replay", "a.mcap", "--set", "corridor.unknown=x"], "--set: corridor.unknown: expected one of free, occ"),
        (["inspect", "a.mcap", "--save", "a.rrd", "--at", "1000"], "--at 1000: the session goes from 0.00 s"),
    ):
        ran = pushlane(*arguments, cwd=tmp_path)
        assert (ran.returncode, words in ran.stderr) == (2, True), ran.stderr
    assert (tmp_path / "a.mcap").read_bytes() == before


def test_results_go_where_they_can_be_written_or_it_is_said(tmp_path: Path) -> None:
    """As root, too: a file in the place of a folder, /proc, which takes no files, and a name that is too long."""
    (tmp_path / "file").write_text("precious")
    beams = " ".join(["1"] * 180)
    (tmp_path / "a.log").write_text(f"FLASER 180 {beams} 0 0 0 0 0 0\n" * 2)
    long = "x" * 300
    session = str(Path(__file__).parent.parent / "replays" / "recordings" / "corridor-1-relaxed.mcap")
    for arguments, words in (
        (["slam", "a.log", "-o", "file"], "cannot write file: File exists"),
        (["slam", "a.log", "-o", "file/maps"], "cannot write file/maps: Not a directory"),
        (["slam", "a.log", "-o", "/proc/maps"], "cannot write /proc/maps: No such file or directory"),
        (["slam", "a.log", "-o", "/proc"], "cannot write into /proc: No such file or directory"),
        (["slam", "a.log", "-o", long], f"cannot write {long}: File name too long"),
        (["experiment", "open", "-o", "file/out"], "file/out: Not a directory"),
        (["experiment", "strategies", "-o", "/proc/out"], "/proc/out: No such file or directory"),
        (["experiment", "deliveries", "--failures", "file"], "cannot write file: File exists"),
        (["inspect", session, "--save", "/proc/a.rrd"], "cannot write /proc/a.rrd: No such file or directory"),
        (["inspect", session, "--save", "/dev/full"], "cannot write /dev/full: it is no regular file"),
        (["inspect", session, "--screenshot", "file/a.png"], "cannot write file/a.png: there is no folder file"),
        (["inspect", session, "--screenshot", "/proc/a.png"], "cannot write /proc/a.png: No such file or directory"),
        (["replay", session, "--overlay", long], f"cannot write {long}: File name too long"),
        (["experience", "save", session, "-o", "."], "cannot write .: it is a folder"),
        (["experience", "save", session, "-o", f"{long}.json"], f"cannot write {long}.json: File name too long"),
        (["calibrate", "board", "-o", "/proc/a.png"], "cannot write /proc/a.png: No such file or directory"),
        (["sim", *SHORT, "-o", "file/a.mcap"], "cannot write file/a.mcap: Not a directory"),
        (["sim", *SHORT, "-o", f"{long}.mcap"], f"cannot write {long}.mcap: File name too long"),
    ):
        ran = pushlane(*arguments, cwd=tmp_path)
        assert (ran.returncode, words in ran.stderr) == (2, True), (arguments, ran.stderr)
        assert len(ran.stderr.strip().splitlines()) == 1
    assert (tmp_path / "file").read_text() == "precious"
    assert {path.name for path in tmp_path.iterdir()} == {"file", "a.log"}


def test_what_is_no_log_is_named_with_what_was_expected(tmp_path: Path) -> None:
    (tmp_path / "empty.log").write_bytes(b"")
    (tmp_path / "binary.log").write_bytes(b"ODOM 1 2 3\n" + bytes(range(128, 256)))
    (tmp_path / "binary.npz").write_bytes(bytes(range(256)))
    (tmp_path / "binary.mcap").write_bytes(bytes(range(256)))
    (tmp_path / "columns.csv").write_text("time,range\n0.1,2.5\n")
    (tmp_path / "short.log").write_text("# a comment\nFLASER 180 1 2 3\n")
    (tmp_path / "folder.log").mkdir()
    for arguments, words in (
        (["missing.log"], "missing.log: there is no such file"),
        (["folder.log"], "folder.log: is a folder; expected a CARMEN log"),
        (["empty.log"], "empty.log: is empty; expected a CARMEN log"),
        (["binary.log"], "binary.log, after line 0: not a CARMEN log: no text; expected a CARMEN log"),
        (["binary.npz"], "binary.npz: no .npz file; expected one as numpy.savez writes it"),
        (["binary.mcap"], "expected an MCAP session"),
        (["columns.csv"], "columns.csv: 0 laser scans: no line begins with FLASER or ROBOTLASER1; line 1 begins with"),
        (
            ["short.log"],
            "short.log, line 2: FLASER cannot be read: 3 numbers; expected 180; the format is FLASER count",
        ),
    ):
        ran = pushlane("slam", *arguments, cwd=tmp_path)
        assert (ran.returncode, words in ran.stderr, "Traceback" in ran.stderr) == (2, True, False), ran.stderr
        assert len(ran.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["deliveries", "--set", "sim.seed=3"], "--set sim.seed: has no effect here: seeds go from --first on"),
        (["tracking", "--set", "sim.seed=3"], "--set sim.seed: has no effect here: seeds go from --seed on"),
        (["strategies", "-o", "out", "--set", "sim.scene=open"], "--set sim.scene: has no effect here: the experiment"),
        (["best", "-o", "out", "--set", "sim.seed=3"], "--set sim.seed: has no effect here: the experiment has its"),
    ],
)
def test_experiments_refuse_what_they_decide_themselves(arguments: list[str], words: str, tmp_path: Path) -> None:
    ran = pushlane("experiment", *arguments, cwd=tmp_path)
    assert (ran.returncode, words in ran.stderr, len(ran.stderr.strip().splitlines())) == (2, True, 1), ran.stderr
    assert list(tmp_path.iterdir()) == []


def test_experiments_say_which_settings_of_a_file_they_do_not_use(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text('[sim]\nseed = 3\nscene = "open"\ngoal = [1.6, 0.3]\ntime_limit = 1.0\n')
    arguments = ["experiment", "deliveries", "--trials", "1", "--jobs", "1", "--first", "7", "--config", "a.toml"]
    ran = pushlane(*arguments, cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert "a.toml: sim.seed is not used here: seeds go from --first on" in ran.stderr
    assert "seeds 7 to 7" in ran.stdout


def test_the_list_names_everything() -> None:
    found = json.loads(pushlane("sim", "--list", "--json").stdout)
    assert [one["name"] for one in found["scenes"]] == list(scene.names())
    assert [one["name"] for one in found["objects"]] == list(objects.names())
    assert [one["name"] for one in found["strategies"]] == list(STRATEGIES)
    assert [one["name"] for one in found["controllers"]] == list(CONTROLLERS)
    assert len(found["scenes"]) >= 4
    assert len(found["objects"]) >= 6


def test_config_show_says_where_values_come_from_and_reads_back(tmp_path: Path) -> None:
    (tmp_path / "my.toml").write_text("[controller]\nspeed = 0.2\n")
    arguments = ["config", "show", "--config", "my.toml", "--set", "learner.window=0.05"]
    arguments += ["--set", "timing.latency.command>driver=0.02"]
    shown = pushlane(*arguments, cwd=tmp_path)
    lines = {line.split(" = ")[0]: line for line in shown.stdout.splitlines() if " = " in line}
    assert lines["speed"].endswith("# my.toml")
    assert lines["window"].endswith("# --set")
    assert lines["k_gamma"].endswith("# default")
    values = tomllib.loads(shown.stdout)
    assert values["controller"]["speed"] == 0.2
    described = pushlane(*arguments, "--describe", cwd=tmp_path).stdout
    assert "# K_gamma, gain on gamma in (8), at least 0, at most 10\nk_gamma = 0.1" in described
    assert tomllib.loads(described) == values
    (tmp_path / "again.toml").write_text(shown.stdout)
    again = pushlane("config", "show", "--config", "again.toml", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert tomllib.loads(again.stdout) == values


@pytest.mark.parametrize(
    ("verb", "words"),
    [
        (["slam"], ["[default: 30]", "[default: (nothing is written)]", "[default: (a map is made)]"]),
        (["replay"], ["[default: (its beginning)]"]),
        (
            ["sim"],
            [
                "(living-room)",
                "(predictive; strict with one",
                "(predictive; adaptive with one",
                "(0.1)",
                "(400)",
                "(not recorded)",
                "(direct)",
            ],
        ),
        (["experiment", "deliveries"], ["from --first on. [default: 100]", "(none is kept)"]),
        (["experiment", "tracking"], ["[default: tags,appearance,depth]"]),
    ],
)
def test_help_names_the_defaults_that_hold(verb: list[str], words: list[str]) -> None:
    shown = " ".join(pushlane(*verb, "--help", columns=400).stdout.split())
    for one in words:
        assert one in shown
    session = prepare([])
    task = session.effective.sections["task"]
    assert isinstance(task, TaskConfig)
    assert (session.sim.scene, session.sim.link, task.strategy, task.controller) == (
        "living-room", "direct", "predictive", "predictive",
    )  # fmt: skip
    assert (task.precision, task.time_limit) == (0.1, 400.0)


def test_help_teaches() -> None:
    shown = pushlane("--help")
    assert shown.returncode == 0
    for verb in ("sim", "replay", "inspect", "goldens", "config", "experiment"):
        assert verb in shown.stdout
        assert pushlane(verb, "--help").returncode == 0
