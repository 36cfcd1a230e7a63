"""Recording a running system: parts that replay alone, recordings on request, and what was missed."""

from __future__ import annotations

import errno
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from mcap.reader import make_reader

from experiments.session import Session, prepare
from experiments.systems import NODES
from replays import report
from replays.recording import Recording, Unusable, load
from replays.replay import replay
from runtime.bus import envelope
from runtime.bus.keys import Keys
from runtime.config.layers import Layer
from runtime.live.gaps import Gaps
from runtime.live.part import Part
from runtime.live.split import BadSplit, Split
from runtime.live.tape import Tape
from runtime.messages import (
    Journal,
    LaserScan,
    Log,
    PushPhase,
    RecordingQuery,
    RecordingStart,
    RecordingStatus,
    RecordingStop,
    Reply,
)
from runtime.recorder import header
from runtime.recorder.writer import CannotRecord, Recorder
from runtime.sample import INCARNATION, Sample
from runtime.topics import TOPICS
from tests.figures import Figures
from tests.live_system import System, free_endpoint, running, short_session


def ask(system: System, name: str, payload: bytes) -> Reply:
    for answer in system.session.get(system.keys.request(name), payload=payload, timeout=5.0):
        assert answer.ok is not None
        return Reply.FromString(bytes(answer.ok.payload))
    raise AssertionError(f"nobody answered {name}")


def status(system: System) -> RecordingStatus:
    payload = RecordingQuery().SerializeToString()
    for answer in system.session.get(system.keys.request("recording/status"), payload=payload, timeout=5.0):
        assert answer.ok is not None
        return RecordingStatus.FromString(bytes(answer.ok.payload))
    raise AssertionError("nobody answered recording/status")


def session_that_records_to(folder: Path) -> Session:
    endpoint = free_endpoint()
    sim = {"scene": "open", "goal": [0.6, 0.1], "object": "cylinder", "seed": 2, "time_limit": 120}
    bus = {"robot": "parts", "listen": [endpoint], "connect": [endpoint]}
    return prepare([Layer("test", {"sim": sim, "bus": bus, "live": {"recordings": str(folder)}})])


def numbers(recording: Recording, topic: str) -> set[int]:
    return {sequence for name, sequence in recording.samples if name == topic}


def entries(recording: Recording, node: str) -> set[int]:
    return {
        number for batch in recording.journals[node] for number in range(batch.first, batch.first + len(batch.kind))
    }


def check_alone(recording: Recording, events: int = 10) -> None:
    assert recording.damage is None
    found = replay(recording)
    assert found.identical, f"{recording.path.name}\n" + "\n".join(report.text(found))
    assert [node.node for node in found.nodes] == list(NODES)
    assert all(node.events >= events for node in found.nodes)


def test_parts_replay_alone_and_nothing_falls_between(tmp_path: Path, figures: Figures) -> None:
    session = session_that_records_to(tmp_path)
    with running(session, tmp_path / "first.mcap") as system:
        assert status(system).recording
        assert ask(system, "recording/stop", RecordingStop().SerializeToString()).accepted
        system.wait(lambda: not status(system).recording, 5.0, "the end of the first")
        refused = ask(system, "recording/stop", RecordingStop().SerializeToString())
        assert (refused.accepted, refused.reason) == (False, "nothing is being recorded")
        assert status(system).file == str(tmp_path / "first.mcap")
        for name, words in (("a/b", "no plain file name"), ("..", "no plain file name")):
            refused = ask(system, "recording/start", RecordingStart(name=name).SerializeToString())
            assert not refused.accepted and words in refused.reason
        refused = ask(system, "recording/start", RecordingStart(split="3 weeks").SerializeToString())
        assert not refused.accepted and "'3 weeks' is no size or time" in refused.reason

        # In the middle of the life of every service, and of a push.
        assert system.ask_for_push().accepted
        system.wait(lambda: system.status().phase == PushPhase.PUSHING, 10.0, "pushing")
        start = RecordingStart(name="parts", split="3s").SerializeToString()
        assert ask(system, "recording/start", start).accepted
        again = ask(system, "recording/start", RecordingStart(name="other").SerializeToString())
        assert not again.accepted and "parts.mcap is being recorded already" in again.reason
        alone = Tape(system.session, system.keys, tmp_path / "alone.mcap", session.plan(), ["command"])
        time.sleep(11.0)
        alone.close()
        assert ask(system, "recording/stop", RecordingStop().SerializeToString()).accepted
        system.wait(lambda: not status(system).recording, 5.0, "the end")
        done = status(system)
        existing = ask(system, "recording/start", RecordingStart(name="parts").SerializeToString())
        assert not existing.accepted and "is there already" in existing.reason
        assert max(system.launcher.restarts.values()) == 0
        heard = {topic: list(samples) for topic, samples in system.heard.items()}
    paths = [tmp_path / "parts.mcap", *sorted(tmp_path.glob("parts-*.mcap"))]
    assert len(paths) == done.parts >= 3
    check_alone(load(tmp_path / "first.mcap"), events=0)  # before the push little happens
    parts = [load(path) for path in paths]
    for part in parts:
        check_alone(part)
        # Each begins with what a late joiner is told.
        assert numbers(part, "map") == {1}
        assert numbers(part, "push/goal")
    for topic in ("odometry", "command", "push/status", "truth", "robot/pose"):
        kept = [numbers(part, topic) for part in parts]
        whole = set().union(*kept)
        low, high = min(kept[0] - ({min(kept[0])} if topic == "push/status" else set())), max(whole)
        sent = {sample.sequence for sample in heard[topic] if low <= sample.sequence <= high}
        assert sent and sent <= whole, (topic, sorted(sent - whole))
        assert all(before & after for before, after in zip(kept, kept[1:], strict=False)), topic
    for node in NODES:
        kept = [entries(part, node) for part in parts]
        whole = set().union(*kept)
        assert whole == set(range(min(whole), max(whole) + 1)), node
        assert all(before & after for before, after in zip(kept, kept[1:], strict=False)), node
    # The requests and their answers are in the recording that they began and ended.
    asked = {request.name for part in parts for request in part.requests.values()}
    assert {"recording/start", "recording/stop"} <= asked
    assert any(reply.name == "recording/stop" and reply.accepted for reply in parts[-1].replies.values())
    with paths[0].open("rb") as file:
        end = {record.name: record.metadata for record in make_reader(file).iter_metadata()}["end"]
    assert end["next"] == "parts-2.mcap"
    # Only one topic, and what replay needs of it.
    only = load(tmp_path / "alone.mcap")
    assert {topic for topic, _ in only.samples if topic in TOPICS} == {"command"}
    assert set(only.journals) == set(NODES)
    sizes = ", ".join(f"{path.name} {path.stat().st_size / 1000:.0f} kB" for path in paths)
    figures(f"{done.messages} messages, {done.missed} missed, in {len(paths)} parts: {sizes}")


def test_a_part_whose_tail_was_taken_away_is_found_out(tmp_path: Path) -> None:
    """The note of the recorder that it left says up to which entry it had the journals."""
    from replays import coverage
    from replays.result import NodeResult
    from runtime import registry
    from runtime.journal import JournalWriter, entries

    writer = JournalWriter("task")
    for number in range(3):
        writer.add(3, "tick", number, number)  # type: ignore[arg-type]
    batch = writer.batch()
    assert batch is not None
    lives = [list(entries([batch]))]
    contract = registry.service_class("task").contract
    for last, expected in ((2, 0), (3, 1), (None, 1)):
        running_on = {} if last is None else {"task": last}
        recording = Recording(tmp_path, header.of_this_machine("live", 1, ["task"]), {}, None, running=running_on)
        result = NodeResult("task")
        coverage.check(recording, "task", contract, lives, result)
        assert len(result.findings) == expected, (last, result.findings)


def sample(topic: str, sequence: int, payload: bytes = b"") -> Sample:
    return Sample(topic, sequence, sequence * 1000, payload)


def journal(first: int, count: int) -> Sample:
    batch = Journal(node="task", first=first, kind=[3] * count)
    return sample("journal/task", first + count, batch.SerializeToString())


def test_gaps_are_counted_and_named_within_one_life() -> None:
    gaps = Gaps()
    said = [
        gaps.take(sample("odometry", number)) for number in (7, 8, 11, 13, 12, 13, INCARNATION + 1, INCARNATION + 3)
    ]
    assert said == [
        "",
        "",
        "missed 2 messages of 'odometry': 9 to 10",
        "missed 1 messages of 'odometry': 12",
        "",
        "",
        "",
        f"missed 1 messages of 'odometry': {INCARNATION + 2}",
    ]
    assert gaps.missed == {"odometry": 4}
    # A batch of a journal stands for several numbers.
    batches = [journal(0, 4), journal(4, 2), journal(9, 1), journal(INCARNATION, 3)]
    firsts = [0, 4, 9, INCARNATION]
    assert [gaps.take(one, first) for one, first in zip(batches, firsts, strict=True)] == [
        "",
        "",
        "missed 3 entries of 'journal/task': 6 to 8",
        "",
    ]
    assert gaps.total == 7


class Silent:
    """A bus on which only the test speaks."""

    def __init__(self) -> None:
        self.hear = None

    def declare_subscriber(self, key, hear):  # type: ignore[no-untyped-def]
        self.hear = hear
        return self

    def undeclare(self) -> None:
        pass

    def get(self, *_: object, **__: object) -> list[object]:
        return []

    def liveliness(self):  # type: ignore[no-untyped-def]
        return self


class Heard:
    """A sample as the bus brings it."""

    def __init__(self, key: str, one: Sample) -> None:
        self.key_expr, self.payload = key, one.payload
        self.attachment = envelope.pack(one.sequence, one.time)


def noisy(noise: random.Random) -> bytes:
    """Return a scan that cannot be compressed much."""
    return LaserScan(frame_id=noise.randbytes(2000).hex()).SerializeToString()


def test_a_part_ends_at_its_size(tmp_path: Path) -> None:
    bus, keys, noise = Silent(), Keys("alone"), random.Random(1)
    plan = short_session("alone").plan()
    tape = Tape(bus, keys, tmp_path / "a.mcap", plan, split=Split.parse("100kB"))  # type: ignore[arg-type]
    for number in range(1, 301):
        bus.hear(Heard(keys.topic("scan"), sample("scan", number, noisy(noise))))  # type: ignore[misc]
        time.sleep(0.01)
    tape.close()
    assert [path.name for path in tape.paths[:2]] == ["a.mcap", "a-2.mcap"]
    kept: list[set[int]] = []
    for path in tape.paths:
        with path.open("rb") as file:
            kept.append({message.sequence for _, _, message in make_reader(file).iter_messages()})
    assert set().union(*kept) == set(range(1, 301))
    for path, numbers in list(zip(tape.paths, kept, strict=True))[:-1]:
        assert path.stat().st_size >= 100_000
        assert len(numbers) < 300


def test_a_full_disk_is_told_and_ends_the_tape(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bus, keys = Silent(), Keys("alone")
    tape = Tape(bus, keys, tmp_path / "a.mcap", short_session("alone").plan())  # type: ignore[arg-type]

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("mcap.writer.Writer.add_message", full)
    bus.hear(Heard(keys.topic("scan"), sample("scan", 1)))  # type: ignore[misc]
    deadline = time.monotonic() + 5.0
    while tape.failure is None and time.monotonic() < deadline:
        time.sleep(0.02)
    assert "No space left on device" in str(tape.failure)
    with pytest.raises(CannotRecord, match="No space left on device"):
        tape.close()


def test_a_missed_message_is_named_in_the_file_where_it_would_have_been(tmp_path: Path) -> None:
    bus, keys, lines = Silent(), Keys("alone"), []
    plan = short_session("alone").plan()
    tape = Tape(bus, keys, tmp_path / "a.mcap", plan, say=lines.append)  # type: ignore[arg-type]
    for number in (1, 2, 5, 6):
        bus.hear(Heard(keys.topic("odometry"), sample("odometry", number)))  # type: ignore[misc]
    tape.close()
    with (tmp_path / "a.mcap").open("rb") as file:
        rows = [(channel.topic, message) for _, channel, message in make_reader(file).iter_messages()]
    assert [topic for topic, _ in rows] == ["odometry", "odometry", "log/recorder", "odometry", "odometry"]
    line = Log.FromString(rows[2][1].data)
    assert line.message == "missed 2 messages of 'odometry': 3 to 4"
    assert rows[2][1].log_time == 5000
    assert tape.gaps.missed == {"odometry": 2}
    assert "missed 2 messages of 'odometry': log/recorder says where" in list(tape.summary())
    assert lines == [line.message]


def test_a_part_begins_with_the_snapshot_that_was_asked_for(tmp_path: Path) -> None:
    def written(path: Path) -> list[tuple[str, int]]:
        with path.open("rb") as file:
            return [(channel.topic, message.sequence) for _, channel, message in make_reader(file).iter_messages()]

    head = header.of_this_machine("live", 1, ["task"])
    for early in (True, False):  # the answer to the question comes before or after the snapshot by subscription
        path = tmp_path / f"{early}.mcap"
        part = Part(path, head, b"{}")
        part.write(sample("snapshot/task", 5))  # given by itself: messages before it are not here
        part.write(sample("journal/task", 40))
        if early:
            part.begin("task", 6)
        part.write(sample("odometry", 3))
        part.write(sample("snapshot/task", 6))
        part.write(sample("journal/task", 50))
        if not early:
            part.begin("task", 6)
        part.write(sample("snapshot/learner", INCARNATION + 1))  # the first of a life
        part.write(sample("journal/learner", INCARNATION + 4))
        part.write(sample("journal/driver", 8))  # never answered
        assert part.begin_all() == ["driver"]
        part.write(sample("journal/driver", 9))
        part.close(["task", "driver"], "")
        expected = [
            ("odometry", 3),
            ("snapshot/task", 6),
            ("journal/task", 50),
            ("snapshot/learner", INCARNATION + 1),
            ("journal/learner", INCARNATION + 4),
            ("journal/driver", 8),
            ("journal/driver", 9),
        ]
        assert sorted(written(path)) == sorted(expected)
        assert part.journals == {"task": 49, "learner": INCARNATION + 3, "driver": 8}


def test_sizes_and_times_to_split_at() -> None:
    assert Split.parse("200MB") == Split(size=200e6)
    assert Split.parse("10min") == Split(time=600.0)
    assert Split.parse("2.5 GB") == Split(size=2.5e9)
    assert Split.parse("") == Split()
    for text in ("10", "MB", "10 weeks", "-3s", "1s", "5kB", "nan s"):
        with pytest.raises(BadSplit, match=f"'{text}'"):
            Split.parse(text)


def test_the_verbs_record_a_system(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    (tmp_path / "system.toml").write_text(
        f'[bus]\nrobot = "verbs"\nlisten = ["{endpoint}"]\nconnect = ["{endpoint}"]\n'
        f'[sim]\nscene = "open"\ngoal = [0.6, 0.1]\nobject = "cylinder"\n[live]\nrecordings = "{tmp_path}"\n'
    )
    settings = ["--config", "system.toml"]
    environment = {"PATH": "/usr/bin:/bin", "PYTHONPATH": str(Path(__file__).parents[3]), "COLUMNS": "120"}
    command = [sys.executable, "-m", "runtime.cli.main"]

    def pushlane(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [*command, *arguments, *settings],
            capture_output=True, text=True, check=False, cwd=tmp_path, timeout=60, env=environment,
        )  # fmt: skip

    system = subprocess.Popen(
        [*command, "run", "system.toml"], cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True
    )
    try:
        assert system.stdout is not None
        for line in system.stdout:
            if "all services are up" in line:
                break
        assert pushlane("recording", "status").stdout == "nothing is being recorded\n"
        started = pushlane("recording", "start", "a")
        assert started.stdout == f"recording to {tmp_path / 'a.mcap'}\n", started.stderr
        again = pushlane("recording", "start")
        assert (again.returncode, "is being recorded already" in again.stderr) == (2, True)
        recorder = subprocess.Popen(
            [*command, "record", *settings], cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True
        )
        assert pushlane("recording", "status").stdout.startswith(f"recording to {tmp_path / 'a.mcap'}: ")
        time.sleep(1.5)
        recorder.send_signal(signal.SIGINT)
        said, _ = recorder.communicate(timeout=20)
        assert recorder.returncode == 0
        assert " recorded to verbs-" in said.splitlines()[-1]
        stopped = pushlane("recording", "stop")
        assert stopped.stdout.startswith(f"not recording; the last was {tmp_path / 'a.mcap'}: "), stopped.stderr
        there = pushlane("recording", "start", "a")
        # No advice that this verb does not take.
        assert (there.returncode, there.stderr.endswith("a.mcap is there already: choose another name\n")) == (2, True)
        none = pushlane("recording", "stop")
        assert (none.returncode, "'recording/stop' was refused: nothing is being recorded" in none.stderr) == (2, True)
    finally:
        system.send_signal(signal.SIGINT)
        system.communicate(timeout=20)
    assert system.returncode == 0
    files = sorted(tmp_path.glob("*.mcap"))
    assert [path.name.partition("-")[0] for path in files] == ["a.mcap", "verbs"]
    for path in files:
        check_alone(load(path), events=0)


def test_a_recording_of_some_topics_says_that_it_cannot_be_replayed(tmp_path: Path) -> None:
    path = tmp_path / "some.mcap"
    with Recorder(path, header.of_this_machine("live", 0, ["task"], ["push/*"]), b'{"sections": {}}'):
        pass
    with pytest.raises(Unusable, match=r"only the topics push/\*"):
        replay(load(path))
