"""The tools that look at a running system, and the live view."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from experiments.systems import NODES
from replays.inspect import to_rrd
from replays.inspect.live import Feed, LiveCanvas, show_live
from runtime import registry
from runtime.bus.config import AccessConfig, BusConfig, TlsConfig
from runtime.bus.session import hub
from runtime.live import doctor, endpoints
from runtime.live.finding import Finding, Grade
from runtime.live.graph import Graph
from runtime.live.hosts import HostAnswer, HostReport, ask_hosts, offset
from runtime.live.watch import Tally, Window
from runtime.messages import Health, InputHealth, PushGoal, PushOutcome, PushPhase, PushStatus
from runtime.sample import Sample
from runtime.topics import TOPICS
from tests.authority import Authority
from tests.figures import Figures
from tests.live_system import free_endpoint, running, short_session
from tests.replays.inspect.rrd import column
from tests.replays.inspect.synthetic_session import write_session


def test_a_session_drawn_in_pieces_is_the_same_as_drawn_at_once(tmp_path: Path) -> None:
    write_session(tmp_path / "a.mcap", 8.0)
    to_rrd(tmp_path / "a.mcap", tmp_path / "whole.rrd")
    with (tmp_path / "a.mcap").open("rb") as file:
        samples = [
            Sample(channel.topic, message.sequence, message.log_time, message.data)
            for schema, channel, message in make_reader(file).iter_messages(log_time_order=True)
            if not channel.topic.startswith("viewer/")
        ]
    canvas = LiveCanvas("test", "pieces")
    canvas.recording.save(tmp_path / "pieces.rrd")
    feed = Feed(canvas, 0)
    pieces: dict[int, list[Sample]] = {}
    for sample in samples:
        pieces.setdefault(sample.time // 250_000_000, []).append(sample)
    for number in sorted(pieces):
        feed.draw(pieces[number])
    canvas.recording.flush()
    canvas.recording.disconnect()
    own = ("journal/", "snapshot/")
    assert feed.messages == len([one for one in samples if not one.topic.startswith(own)])
    for entity, component in (
        ("/angles/alpha", "Scalars:scalars"),
        ("/learned/kappa", "Scalars:scalars"),
        ("/velocity/vx/command", "Scalars:scalars"),
        ("/depth/robot", "Scalars:scalars"),
        ("/distance/straight", "Scalars:scalars"),
        ("/map/robot", "Transform3D:translation"),
        ("/map/object", "Transform3D:translation"),
        ("/map/corridor/path", "LineStrips3D:strips"),
        ("/map/push_line", "LineStrips3D:strips"),
        ("/states/push", "StateChange:state"),
        ("/log/push", "TextLog:text"),
    ):
        times, rows = column(tmp_path / "whole.rrd", entity, component)
        piecewise, drawn = column(tmp_path / "pieces.rrd", entity, component)
        assert piecewise.tolist() == times.tolist(), entity
        assert drawn == rows, entity
    # Scans are put where the robot is, by poses that may come in the next piece: at most one scan a piece differs.
    times, rows = column(tmp_path / "whole.rrd", "/map/scan", "Points3D:positions")
    piecewise, drawn = column(tmp_path / "pieces.rrd", "/map/scan", "Points3D:positions")
    assert piecewise.tolist() == times.tolist()
    assert sum(a == b for a, b in zip(rows, drawn, strict=True)) >= len(rows) - len(pieces)


def test_what_nobody_takes_is_given_up_and_counted() -> None:
    window = Window(100)
    for number in range(1000):
        window.put(Sample("odometry", number, 0, b""))
    assert [sample.sequence for sample in window.take()] == list(range(900, 1000))
    assert window.dropped == 900
    assert window.take() == []


def pushlane(bus: BusConfig, *arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    settings = ["--set", f"bus.robot={bus.robot}", "--set", f'bus.connect=["{bus.connect[0]}"]']
    return subprocess.run(
        [sys.executable, "-m", "runtime.cli.main", *arguments, *settings],
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
        timeout=60,
        env={"PATH": "/usr/bin:/bin", "PYTHONPATH": str(Path(__file__).parents[3]), "COLUMNS": "120", "CI": "1"},
    )


@pytest.mark.alone
def test_the_tools_tell_of_a_running_system(tmp_path: Path, figures: Figures) -> None:
    session = short_session("tools", goal=[1.2, 0.1], time_limit=120)
    with running(session) as system:
        bus = system.bus
        found = pushlane(bus, "doctor", "--json", "--for", "3", folder=tmp_path)
        rows = json.loads(found.stdout)
        failed = [row for row in rows if row["grade"] == "FAIL"]
        assert (found.returncode, failed) == (0, []), found.stdout
        text = {row["subject"]: row["text"] for row in rows}
        assert text["services"] == f"all {len(NODES)} are up"
        assert "the same on 1 host" in text["versions"]
        assert f"clock of {socket.gethostname()}" in text
        # One machine has one clock.
        for answer in ask_hosts(system.session, system.keys):
            assert abs(answer.offset) <= answer.uncertainty + 1e-3
            assert answer.report.pid > 0 and answer.report.services == list(NODES)

        assert system.ask_for_push().accepted
        system.wait(lambda: system.status().phase == PushPhase.PUSHING, 10.0, "pushing")
        fed: list[object] = []
        out = tmp_path / "live.rrd"
        bridge = threading.Thread(
            target=lambda: fed.append(show_live(bus, threading.Event(), lambda _: None, save=out, duration=6.0))
        )
        bridge.start()
        tree = pushlane(bus, "topics", "graph", "--text", "--for", "1.5", folder=tmp_path).stdout.splitlines()
        dot = pushlane(bus, "topics", "graph", "--for", "1", folder=tmp_path).stdout
        snapshot = pushlane(bus, "snapshot", folder=tmp_path)
        nodes = pushlane(bus, "nodes", folder=tmp_path).stdout.splitlines()
        bridge.join(20.0)
        assert max(system.launcher.restarts.values()) == 0
        silent = pushlane(bus, "topics", "echo", "wheel/speed", "--for", "1", folder=tmp_path)
        latched = pushlane(bus, "topics", "echo", "map", "--for", "0.2", folder=tmp_path)
        unknown = pushlane(bus, "snapshot", "wheel", folder=tmp_path)
        nothing = pushlane(bus, "recording", "status", folder=tmp_path)
    assert any(line.startswith("  odometry ") and "Hz -> controller" in line for line in tree), tree
    assert set(NODES) <= {line for line in tree if not line.startswith(" ")}
    assert '"controller" -> "driver" [label="command ' in dot
    assert [line.split()[0] for line in nodes] == sorted(NODES)
    assert all(re.search(r"dropped \d+, lost 0$", line) for line in nodes), nodes
    assert {line.split()[0] for line in snapshot.stdout.splitlines()} == set(NODES)
    assert silent.returncode == 1
    assert "no topic is called 'wheel/speed'" in silent.stderr
    assert latched.stdout.startswith("map 1 at ")
    assert (unknown.returncode, "no service 'wheel' gave a snapshot" in unknown.stderr) == (2, True)
    assert (nothing.returncode, "no service answered 'recording/status'" in nothing.stderr) == (2, True)
    # The bridge drew each pose that the bus said while it ran, once, at the right places.
    assert fed
    times, rows = column(out, "/map/robot", "Transform3D:translation")
    assert len(times) > 50
    said = [sample.time for sample in system.heard["robot/pose"]]
    since = (times - times[0]).tolist()
    assert any([time - said[i] for time in said[i : i + len(since)]] == since for i in range(len(said)))
    poses = np.array([(truth.robot.x, truth.robot.y) for truth in system.truths()])
    for x, y, _ in np.array(rows)[:, 0]:
        assert np.hypot(poses[:, 0] - x, poses[:, 1] - y).min() < 0.05
    columns = [column(out, entity, "Scalars:scalars")[0] for entity in ("/angles/alpha", "/velocity/vx/base")]
    assert all(len(each) > 50 for each in columns)
    figures(f"live view: {fed[0].messages} messages, {fed[0].dropped} given up; doctor: {text['rates']}")  # type: ignore[attr-defined]


def test_doctor_without_a_system_says_so(tmp_path: Path) -> None:
    bus = BusConfig(robot="nobody", connect=(free_endpoint(),))
    found = pushlane(bus, "doctor", folder=tmp_path)
    assert found.returncode == 1
    assert "FAIL system: no hub at" in found.stdout
    assert "pushlane run SYSTEM.toml" in found.stdout
    with socket.create_server(("127.0.0.1", 0)) as other:
        bus = BusConfig(robot="nobody", connect=(f"tcp/127.0.0.1:{other.getsockname()[1]}",))
        findings = doctor.examine(bus, 0.1)
    assert findings[0].grade is Grade.OK
    assert (findings[-1].grade, "something else listens there" in findings[-1].remedy) == (Grade.FAIL, True)


def test_doctor_tells_a_wrong_certificate_from_one_without_permission(tmp_path: Path) -> None:
    place = (free_endpoint().replace("tcp/", "tls/"),)
    home, foreign = Authority(tmp_path / "home"), Authority(tmp_path / "foreign")
    own = home.host("robot", "127.0.0.1")
    access = AccessConfig(hosts={"robot": ("driver",)})
    with hub(BusConfig(listen=place, connect=place, tls=own, access=access)):
        refused = doctor.examine(BusConfig(connect=place, tls=foreign.operator("operator")), 0.1)[-1]
        unheard = doctor.examine(BusConfig(connect=place, tls=home.operator("nobody")), 0.1)[-1]
    assert (refused.grade, "certificate is not to be believed" in refused.text) == (Grade.FAIL, True)
    assert refused.remedy.startswith("make certificates of all machines in the same folder")
    assert (unheard.grade, "no running system" in unheard.text) == (Grade.FAIL, True)
    assert "no list of the robot's [bus.access]" in unheard.remedy


def grades(findings: list[Finding]) -> list[tuple[str, str]]:
    return [(one.grade.name, one.subject) for one in findings]


def test_rates_are_held_against_the_table() -> None:
    tally, predictive = Tally(seconds=10.0), PushGoal(strategy="predictive")
    tally.counts = {name: round(10 * row.rate) for name, row in TOPICS.items() if row.rate}
    # What no service of this system publishes is not missing.
    del tally.counts["truth"]
    without = [name for name in NODES if "truth" not in registry.service_class(name).contract.outputs]
    assert grades(doctor.rates(tally, without, without, [], predictive)) == [("OK", "rates")]
    assert ("FAIL", "topic truth") in grades(doctor.rates(tally, NODES, NODES, [], predictive))
    tally.counts["truth"] = 200
    everything, idle, pushing = list(NODES), [PushStatus(phase=PushPhase.IDLE)], [PushStatus(phase=PushPhase.PUSHING)]
    assert grades(doctor.rates(tally, NODES, everything, pushing, predictive)) == [("OK", "rates")]
    del tally.counts["command"]
    assert grades(doctor.rates(tally, NODES, everything, idle, predictive)) == [("OK", "rates")]
    assert grades(doctor.rates(tally, NODES, everything, pushing, predictive)) == [
        ("FAIL", "topic command"),
        ("OK", "rates"),
    ]
    tally.counts["command"] = 161  # 80.5 %
    assert grades(doctor.rates(tally, NODES, everything, pushing, predictive)) == [("OK", "rates")]
    tally.counts["command"] = 159  # 79.5 %
    found = doctor.rates(tally, NODES, everything, pushing, predictive)
    assert grades(found) == [("WARN", "topic command"), ("OK", "rates")]
    assert "15.9 Hz, 20 Hz expected" in found[0].text
    del tally.counts["odometry"]
    found = doctor.rates(tally, NODES, [name for name in NODES if name != "driver"], pushing, predictive)
    assert grades(found)[0] == ("FAIL", "topic odometry")
    assert "nobody publishes it" in found[0].text and "'driver'" in found[0].remedy
    assert grades(doctor.services(NODES, NODES[1:])) == [("FAIL", f"service {NODES[0]}")]


def test_what_a_push_does_not_do_is_not_missed() -> None:
    tally, nodes = Tally(seconds=10.0), list(NODES)
    tally.counts = {name: round(10 * row.rate) for name, row in TOPICS.items() if row.rate}
    pushing, ended = PushStatus(phase=PushPhase.PUSHING), PushStatus(phase=PushPhase.ENDED)
    del tally.counts["push/response"]  # only the predictive method learns it
    strict = PushGoal(strategy="strict", controller="adaptive")
    assert grades(doctor.rates(tally, NODES, nodes, [pushing], strict)) == [("OK", "rates")]
    for asked in (PushGoal(strategy="predictive"), PushGoal(controller="predictive")):
        assert ("FAIL", "topic push/response") in grades(doctor.rates(tally, NODES, nodes, [pushing], asked))
    # After its end a push only repeats its last status, once a second, and the other topics of a push are silent.
    tally.counts = {**tally.counts, "push/status": 10}
    assert ("WARN", "topic push/status") in grades(doctor.rates(tally, NODES, nodes, [pushing], strict))
    del tally.counts["command"], tally.counts["push/target"]
    for statuses in ([ended], [pushing, ended]):
        assert grades(doctor.rates(tally, NODES, nodes, statuses, strict)) == [("OK", "rates")]


def answer(ahead: float, uncertainty: float, jump: float = 0.0, **changes: object) -> HostAnswer:
    facts = {
        "wall": 10**18,
        "steady": 10**18 - round(jump * 1e9),
        "versions": {},
        "services": [],
        "folder": "",
        "free": 0,
    }
    return HostAnswer(HostReport(host="robot", pid=1, **{**facts, **changes}), ahead, uncertainty)  # type: ignore[arg-type]


def test_clocks_disks_and_versions_are_judged() -> None:
    # A clock 70 ms ahead, asked over a link that takes 10 ms there and 30 ms back: the middle errs by 10 ms.
    asked = 10**18
    ahead, uncertainty = offset(asked, asked + 10_000_000 + 70_000_000, asked + 40_000_000)
    assert (ahead, uncertainty) == (pytest.approx(0.060), pytest.approx(0.020))
    assert abs(ahead - 0.070) <= uncertainty
    for ahead, uncertainty, jump, expected in (
        (0.049, 0.0, 0.0, ["OK"]),
        (-0.060, 0.005, 0.0, ["WARN"]),
        (0.060, 0.020, 0.0, ["OK"]),  # it may be less than 50 ms
        (0.0, 0.0, -3600.0, ["OK", "WARN"]),
    ):
        assert [one.grade.name for one in doctor.clocks([answer(ahead, uncertainty, jump)])] == expected
    for free, expected in ((6e9, "OK"), (4e9, "WARN"), (4e8, "FAIL")):
        assert grades(doctor.disks([answer(0, 0, folder="/data", free=round(free))])) == [(expected, "disk of robot")]
    assert doctor.disks([answer(0, 0)]) == []
    here = dict.fromkeys(("python", "eclipse-zenoh", "protobuf", "mcap", "rerun-sdk"), "1")
    assert grades(doctor.versions(here, [answer(0, 0, versions=here)])) == [("OK", "versions")]
    found = doctor.versions(here, [answer(0, 0, versions={**here, "protobuf": "2"})])
    assert grades(found) == [("WARN", "version of protobuf")]
    assert found[0].text == "2 on robot, here 1"


def test_losses_are_told_only_where_they_grow() -> None:
    def health(lost: int, refused: int, queue: int = 0, slow: float = 0.0) -> Health:
        row = InputHealth(topic="command", lost=lost, refused=refused, refusal="no such number")
        return Health(node="driver", inputs=[row], queue_length=queue, busy_max=slow)

    assert grades(doctor.healths({"driver": (health(7, 7), health(7, 7))})) == [("OK", "health")]
    found = doctor.healths({"driver": (health(7, 7), health(9, 8, queue=60, slow=0.3))})
    assert [one.grade for one in found] == [Grade.WARN] * 4
    assert [one.text.split()[0] for one in found] == ["60", "its", "2", "refused"]


def test_open_endpoints_and_certificates_are_judged(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        place = (f"tcp/127.0.0.1:{server.getsockname()[1]}",)
        assert [one.grade.name for one in endpoints.sockets(BusConfig(connect=place))] == ["OK"]
        found = endpoints.sockets(BusConfig(connect=place, listen=("tcp/0.0.0.0:7447", "tcp/[::]:7447")))
        assert [one.grade.name for one in found] == ["OK", "WARN", "WARN"]
    assert [one.grade.name for one in endpoints.sockets(BusConfig(connect=place))] == ["FAIL"]

    def openssl(*arguments: str) -> None:
        subprocess.run(["openssl", *arguments], check=True, capture_output=True, cwd=tmp_path)

    key = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"]
    for name in ("ca", "other"):
        openssl(
            "req",
            "-x509",
            *key,
            "-keyout",
            f"{name}.key",
            "-out",
            f"{name}.pem",
            "-days",
            "3650",
            "-subj",
            f"/CN={name}",
        )
    openssl("req", *key, "-keyout", "robot.key", "-out", "robot.csr", "-subj", "/CN=robot")
    signing = ["x509", "-req", "-in", "robot.csr", "-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial"]
    for name, days in (("long", "400"), ("short", "20")):
        openssl(*signing, "-out", f"{name}.pem", "-days", days)
    (tmp_path / "robot.key").chmod(0o600)

    def judged(certificate: str, ca: str = "ca.pem") -> list[str]:
        tls = TlsConfig(ca=str(tmp_path / ca), certificate=str(tmp_path / certificate), key=str(tmp_path / "robot.key"))
        return [one.grade.name for one in endpoints.certificates_of(tls)]

    assert judged("long.pem") == ["OK", "OK"]
    assert judged("short.pem") == ["WARN", "OK"]
    assert judged("long.pem", "other.pem") == ["FAIL", "OK", "OK"]
    assert judged("missing.pem") == ["FAIL"]
    (tmp_path / "robot.key").chmod(0o644)
    assert judged("long.pem") == ["FAIL"]
    assert endpoints.certificates_of(None) == []
    from datetime import UTC, datetime

    late = endpoints.lifetime(tmp_path / "long.pem", datetime(2100, 1, 1, tzinfo=UTC))
    assert (late.grade, "ended on" in late.text) == (Grade.FAIL, True)


def test_the_graph_names_what_is_missing() -> None:
    graph = Graph.of(["corridor", "strategy"], {"corridor": 1.5, "scan": 9.9})
    lines = list(graph.tree())
    assert "  corridor 1.5 Hz -> strategy" in lines
    assert "  push/target silent -> nobody" in lines
    assert "scan 9.9 Hz comes, though nobody that is up declares it" in lines
    waiting = next(line for line in lines if line.startswith("  waits for"))
    assert "map" in waiting and "scan" not in waiting
    dot = list(graph.graphviz())
    assert '  "corridor" -> "strategy" [label="corridor 1.5 Hz"];' in dot
    assert '  "nobody that is up" -> "corridor" [label="scan 9.9 Hz"];' in dot


def test_the_table_shows_services_and_the_push() -> None:
    from rich.console import Console

    from runtime.bus.keys import Keys
    from runtime.live.table import Watch, render

    watch = Watch(Keys("robot"))
    rows = [InputHealth(topic="odometry", dropped=3, lost=2, refused=4), InputHealth(topic="command", dropped=1)]
    health = Health(node="driver", inputs=rows, handled=41, queue_length=5, busy_mean=0.0012, busy_max=0.0345)
    watch.take("health/driver", health.SerializeToString(), 100.0)
    watch.take("health/task", Health(node="task").SerializeToString(), 90.0)
    watch.take("health/task", b"\xff\xff", 99.0)
    for left in (2.0, 0.5):
        status = PushStatus(phase=PushPhase.PUSHING, distance_left=left, elapsed=3 - left)
        watch.take("push/status", status.SerializeToString(), 100.0)
    lines = watch.lines(
        {"driver": 7, "task": 8, "strategy": 9}, {"driver": 2, "task": 0, "strategy": 0, "learner": 1}, 101.0
    )

    def text() -> list[str]:
        console = Console(width=120, color_system=None)
        with console.capture() as capture:
            console.print(render(lines, watch.status, watch.start))
        return [" ".join(line.split()) for line in capture.get().splitlines()]

    shown = text()
    assert shown[1] == "driver up 2 41 1.2 34.5 5 4 6"
    assert shown[2].startswith("task silent for 11 s 0 0")
    assert shown[3] == "strategy starting 0"
    assert shown[4] == "learner restarting 1"
    assert shown[5].startswith("push pushing") and shown[5].endswith("0.50 m left, 2.5 s")
    # Three quarters of the way of 2 m are done.
    bar = [mark for mark in shown[5] if mark in "━╸╺-"]
    assert watch.start == 2.0 and len(bar) >= 20
    watch.take("push/status", PushStatus(phase=PushPhase.PLANNING, distance_left=7.0).SerializeToString(), 101.0)
    assert watch.start == 7.0


@pytest.mark.alone
def test_a_live_view_that_hangs_holds_up_nobody(tmp_path: Path, figures: Figures) -> None:
    with running(short_session("stalled", goal=[1.0, 0.1], time_limit=120)) as system:
        settings = ["--set", "bus.robot=stalled", "--set", f'bus.connect=["{system.bus.connect[0]}"]']
        command = [sys.executable, "-m", "runtime.cli.main", "inspect", "--live", "--save", "a.rrd", *settings]
        bridge = subprocess.Popen(
            command,
            cwd=tmp_path,
            env={"PATH": "/usr/bin:/bin", "PYTHONPATH": str(Path(__file__).parents[3])},
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            system.wait((tmp_path / "a.rrd").exists, 20.0, "the bridge")
            assert system.ask_for_push().accepted
            system.wait(lambda: len(system.commands()) > 20, 10.0, "commands")
            os.kill(bridge.pid, signal.SIGSTOP)
            begin = len(system.heard["command"])
            time.sleep(6.0)  # longer than the lease of its link
            commands = system.heard["command"][begin:]
            os.kill(bridge.pid, signal.SIGCONT)
            status = system.wait_for_end(100.0)
            bridge.send_signal(signal.SIGINT)
            said, _ = bridge.communicate(timeout=20)
        finally:
            bridge.kill()
            bridge.wait()
        health = {name: Health.FromString(system.heard[f"health/{name}"][-1].payload) for name in NODES}
    gaps = np.diff([sample.time for sample in commands]) / 1e9
    figures(f"live view hung for 6 s: longest time between two commands {1000 * gaps.max():.0f} ms; {said.strip()}")
    assert status.outcome == PushOutcome.DELIVERED
    # A service that waited for it would have been silent for the lease of 2 s at least.
    assert gaps.max() < 1.0
    assert sum(row.lost for each in health.values() for row in each.inputs) == 0
    assert bridge.returncode == 0
    assert "written to a.rrd" in said
    assert len(column(tmp_path / "a.rrd", "/map/robot", "Transform3D:translation")[0]) > 50
