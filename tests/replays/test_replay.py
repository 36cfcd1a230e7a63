"""Replays are identical on what was recorded, and name the place of anything that was changed."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from replays import chain, report
from replays.recording import Unusable, load
from replays.replay import replay
from replays.result import Comparison, Report
from runtime import registry
from runtime.guard import Nondeterministic
from runtime.journal import Entry
from runtime.messages import EntryKind, Journal, ObjectState, Odometry, RobotPose, VelocityCommand
from runtime.recorder.header import Header
from runtime.service import Effects, Service
from runtime.time import SECOND, Time
from runtime.topics import TOPICS
from services.strategy.service import StrategyService
from tests.replays.tampering import Change, Row, altered, journal_changed, put, rewrite, rows_of

NODES = ["driver", "perception", "corridor", "strategy", "learner", "controller", "task"]


def replayed(path: Path, *names: str, start: Time = 0) -> Report:
    return replay(load(path), list(names) or None, start=start)


def tampered(source: Path, tmp_path: Path, change: Change) -> Path:
    return rewrite(source, tmp_path / "tampered.mcap", change)


def entry_of(path: Path, node: str, wanted: Callable[[Entry], bool]) -> Entry:
    """The middle one of the entries that `wanted` accepts, away from the ends of its batch."""
    loaded = load(path)
    inner = {
        number
        for batch in loaded.journals[node]
        for number in range(batch.first + 1, batch.first + len(batch.kind) - 2)
    }
    found = [entry for entry in chain.read(loaded, node) if entry.number in inner and wanted(entry)]
    return found[len(found) // 2]


@pytest.mark.parametrize("node", NODES)
def test_every_service_replays_to_the_same_bytes(session_file: Path, node: str) -> None:
    found = replayed(session_file, node)
    assert found.comparison is Comparison.BYTES
    assert found.nodes[0].findings == []
    assert found.nodes[0].complete
    outputs = [row for row in found.nodes[0].topics.values() if row.recorded]
    assert outputs
    assert all(row.recorded == row.replayed == row.identical for row in outputs)


def test_every_recorded_message_is_covered_by_some_replay(session_file: Path) -> None:
    loaded = load(session_file)
    found = replay(loaded)
    assert sum(row.identical for node in found.nodes for row in node.topics.values()) == len(loaded.samples)


@pytest.mark.parametrize("node", NODES)
def test_a_replay_can_start_at_any_snapshot(session_file: Path, node: str) -> None:
    found = replayed(session_file, node, start=5 * SECOND)
    assert found.nodes[0].snapshot == 3  # at 0, 2 and 4 s
    assert found.nodes[0].start == 4 * SECOND
    assert found.identical


def test_an_altered_output_is_named(session_file: Path, tmp_path: Path) -> None:
    def nudge(data: bytes) -> bytes:
        command = VelocityCommand.FromString(data)
        command.twist.vx += 1e-12
        return command.SerializeToString(deterministic=True)

    found = replayed(tampered(session_file, tmp_path, altered("command", 60, nudge)), "controller")
    texts = [finding.text for finding in found.nodes[0].findings]
    assert {(finding.topic, finding.sequence) for finding in found.nodes[0].findings} == {("command", 60)}
    assert any("differs, twist.vx" in text for text in texts)
    assert not found.identical
    row = found.nodes[0].topics["command"]
    assert (row.beyond, row.identical) == (1, row.recorded - 1)
    assert 0 < row.differences.fields["twist.vx"].largest < 1e-11


def test_an_altered_input_is_named_where_it_was_consumed(session_file: Path, tmp_path: Path) -> None:
    def nudge(data: bytes) -> bytes:
        state = ObjectState.FromString(data)
        state.position.x += 0.05
        return state.SerializeToString(deterministic=True)

    found = replayed(tampered(session_file, tmp_path, altered("object/state", 90, nudge)), "strategy")
    first = found.nodes[0].findings[0]
    assert (first.topic, first.sequence) == ("object/state", 90)
    assert "altered" in first.text
    assert {f.topic for f in found.nodes[0].findings} == {"object/state", "push/target"}


def test_an_altered_input_without_effect_is_named_all_the_same(session_file: Path, tmp_path: Path) -> None:
    def nudge(data: bytes) -> bytes:
        odometry = Odometry.FromString(data)
        odometry.covariance[0] += 1.0
        return odometry.SerializeToString(deterministic=True)

    found = replayed(tampered(session_file, tmp_path, altered("odometry", 50, nudge)), "controller")
    assert [(f.topic, f.sequence) for f in found.nodes[0].findings] == [("odometry", 50)]


def is_message(entry: Entry) -> bool:
    return entry.kind == EntryKind.MESSAGE


def test_a_dropped_journal_entry_is_named(session_file: Path, tmp_path: Path) -> None:
    entry = entry_of(session_file, "controller", is_message)

    def drop(batch: Journal, index: int) -> None:
        rows = rows_of(batch)
        put(batch, rows[:index] + rows[index + 1 :])

    found = replayed(tampered(session_file, tmp_path, journal_changed("controller", entry.number, drop)), "controller")
    first = found.nodes[0].findings[0]
    assert first.entry == entry.number
    assert "an entry was dropped" in first.text
    assert not found.nodes[0].complete


def test_a_doubled_journal_entry_is_named(session_file: Path, tmp_path: Path) -> None:
    entry = entry_of(session_file, "controller", is_message)

    def double(batch: Journal, index: int) -> None:
        rows = rows_of(batch)
        put(batch, rows[: index + 1] + rows[index:])

    found = replayed(
        tampered(session_file, tmp_path, journal_changed("controller", entry.number, double)), "controller"
    )
    first = found.nodes[0].findings[0]
    assert first.entry == entry.number + 1
    assert "doubled" in first.text


def test_reordered_journal_entries_are_named(session_file: Path, tmp_path: Path) -> None:
    entry = entry_of(session_file, "task", lambda entry: is_message(entry) and entry.name == "robot/pose")

    def swap(batch: Journal, index: int) -> None:
        rows = rows_of(batch)
        rows[index], rows[index + 1] = rows[index + 1], rows[index]
        put(batch, rows)

    found = replayed(tampered(session_file, tmp_path, journal_changed("task", entry.number, swap)), "task")
    first = found.nodes[0].findings[0]
    assert first.entry == entry.number
    assert "moved" in first.text


def test_a_changed_journal_entry_is_named(session_file: Path, tmp_path: Path) -> None:
    entry = entry_of(session_file, "strategy", is_message)

    def later(batch: Journal, index: int) -> None:
        rows = rows_of(batch)
        kind, name, sequence, at, digest = rows[index]
        rows[index] = (kind, name, sequence, at + 1, digest)
        put(batch, rows)

    found = replayed(tampered(session_file, tmp_path, journal_changed("strategy", entry.number, later)), "strategy")
    assert found.nodes[0].findings[0].entry == entry.number


def test_a_missing_batch_is_named(session_file: Path, tmp_path: Path) -> None:
    def drop(rows: list) -> list:
        batches = [row for row in rows if row.topic == "journal/learner"]
        return [row for row in rows if row is not batches[40]]

    found = replayed(tampered(session_file, tmp_path, drop), "learner")
    assert "entries are missing" in found.nodes[0].findings[0].text
    assert not found.nodes[0].complete


def test_a_journal_without_its_end_is_named(session_file: Path, tmp_path: Path) -> None:
    def cut(rows: list) -> list:
        batches = [row for row in rows if row.topic == "journal/task"]
        return [row for row in rows if row not in batches[len(batches) // 2 :]]

    found = replayed(tampered(session_file, tmp_path, cut), "task")
    texts = [finding.text for finding in found.nodes[0].findings]
    assert any("has no end" in text for text in texts)
    assert any("no journal says that 'task' gave it" in text for text in texts)


@pytest.mark.parametrize(("count", "text"), [(1, "no journal says that 'controller' gave it"), (2, "has no end")])
def test_dropping_the_last_entries_is_named(session_file: Path, tmp_path: Path, count: int, text: str) -> None:
    last = chain.read(load(session_file), "controller")[-1]

    def drop(batch: Journal, _: int) -> None:
        put(batch, rows_of(batch)[:-count])

    found = replayed(tampered(session_file, tmp_path, journal_changed("controller", last.number, drop)), "controller")
    assert any(text in finding.text for finding in found.nodes[0].findings)


def test_a_message_that_was_put_in_is_named(session_file: Path, tmp_path: Path) -> None:
    def add(rows: list[Row]) -> list[Row]:
        model = next(row for row in rows if row.topic == "command")
        return [*rows, replace(model, sequence=9999)]

    found = replayed(tampered(session_file, tmp_path, add), "controller")
    assert [(f.topic, f.sequence) for f in found.nodes[0].findings] == [("command", 9999)]


def test_a_second_message_of_one_name_is_named(session_file: Path, tmp_path: Path) -> None:
    def double(rows: list[Row]) -> list[Row]:
        model = next(row for row in rows if (row.topic, row.sequence) == ("push/target", 50))
        return [*rows, replace(model, data=model.data + b"\x38\x01")]

    found = replayed(tampered(session_file, tmp_path, double), "strategy")
    assert [(f.topic, f.sequence) for f in found.nodes[0].findings] == [("push/target", 50)]


def test_a_moved_time_of_publication_is_named(session_file: Path, tmp_path: Path) -> None:
    def move(rows: list[Row]) -> list[Row]:
        return [
            replace(row, time=row.time + SECOND) if (row.topic, row.sequence) == ("command", 70) else row
            for row in rows
        ]

    found = replayed(tampered(session_file, tmp_path, move), "controller")
    assert [(f.topic, f.sequence) for f in found.nodes[0].findings] == [("command", 70)]


def test_the_first_divergence_comes_with_what_the_service_knew(session_file: Path) -> None:
    loaded = load(session_file)
    found = replay(loaded, ["controller"], {"controller": {"k_gamma": 0.3}})
    known = {one.topic: one for one in found.nodes[0].inputs}
    assert {"robot/pose", "object/state", "push/target", "push/behaviour"} <= set(known)
    behaviour = known["push/behaviour"]
    recorded = loaded.samples[("push/behaviour", behaviour.sequence)]
    assert recorded.time <= report.first_finding(found).time
    assert behaviour.text.startswith("stamp: ")
    inputs = report.as_json(found)["services"][0]["inputs"]
    assert any(one["topic"] == "push/behaviour" and "gamma" in one["text"] for one in inputs)
    found.changes.clear()  # as of a replay that was to be identical: the report of a "what if" is shorter
    assert any("push/behaviour" in line and "gamma" in line for line in report.text(found))


def test_an_unknown_section_is_refused(session_file: Path) -> None:
    with pytest.raises(Unusable, match="no section 'wheel' is replayed"):
        replay(load(session_file), None, {"wheel": {"x": 1}})


def test_a_message_that_was_not_recorded_is_named(session_file: Path, tmp_path: Path) -> None:
    def lose(rows: list) -> list:
        return [row for row in rows if (row.topic, row.sequence) != ("robot/pose", 33)]

    found = replayed(tampered(session_file, tmp_path, lose), "controller")
    first = found.nodes[0].findings[0]
    assert (first.topic, first.sequence) == ("robot/pose", 33)
    assert "not recorded" in first.text


def test_any_flipped_byte_is_reported(session_file: Path, tmp_path: Path) -> None:
    data = session_file.read_bytes()
    generator = random.Random(1)
    ends = [*range(64), *range(len(data) - 200, len(data))]
    unreported = []
    for place in [*ends, *(generator.randrange(len(data)) for _ in range(40))]:
        flipped = bytearray(data)
        flipped[place] ^= 1 << generator.randrange(8)
        path = tmp_path / "flipped.mcap"
        path.write_bytes(flipped)
        try:
            if not load(path).corrupt:
                unreported.append(place)
        except Unusable:
            continue
    assert unreported == []


def test_a_file_that_was_cut_replays_up_to_the_cut(session_file: Path, tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    data = session_file.read_bytes()
    path.write_bytes(data[: len(data) * 2 // 3])
    loaded = load(path)
    found = replay(loaded)
    assert loaded.damage is not None
    assert loaded.damage.startswith("cut")
    assert found.identical, report.first_finding(found)
    assert (
        0 < sum(row.identical for node in found.nodes for row in node.topics.values()) < len(load(session_file).samples)
    )


class ClockReader(StrategyService):
    """A strategy that looks at the wall clock."""

    def choose(self, object: ObjectState, now: Time) -> Effects:
        time.time()
        yield from StrategyService.choose(self, object, now)


class Doubting(StrategyService):
    """A strategy that answers only every second object state."""

    def choose(self, object: ObjectState, now: Time) -> Effects:
        if object.stamp // (50_000_000) % 2:
            yield from StrategyService.choose(self, object, now)


def with_strategy(kind: type[Service]) -> Callable[[str], type[Service]]:
    return lambda name: kind if name == "strategy" else registry.service_class(name)


def test_a_service_that_reads_the_clock_is_refused_by_name(session_file: Path) -> None:
    with pytest.raises(Nondeterministic, match=r"'strategy' called time\.time in handler 'choose'"):
        replay(load(session_file), ["strategy"], services=with_strategy(ClockReader))


def test_messages_that_code_no_longer_gives_are_counted(session_file: Path) -> None:
    found = replay(load(session_file), ["strategy"], services=with_strategy(Doubting))
    row = found.nodes[0].topics["push/target"]
    assert row.missing == pytest.approx(row.recorded / 2, abs=2)
    assert not found.identical
    assert "replay gave no 'push/target'" in report.first_finding(found).text


def test_a_changed_setting_shows_what_it_changes(session_file: Path) -> None:
    found = replay(load(session_file), ["controller"], {"controller": {"k_gamma": 0.3}})
    assert found.changed == ["controller.k_gamma"]
    assert found.nodes[0].topics["command"].beyond > 10
    assert set(found.nodes[0].topics["command"].differences.fields) == {"twist.vx", "twist.vy"}


def test_on_another_machine_tolerances_are_used_and_said(session_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("runtime.recorder.header.cpu_features", lambda: ["riscv64"])
    found = replayed(session_file)
    assert found.comparison is Comparison.TOLERANCES
    assert "riscv64" in found.reasons[0]
    assert found.identical
    assert "within the declared tolerances" in report.verdict(found)


def test_tolerances_accept_last_digits_and_no_more(
    session_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("runtime.recorder.header.cpu_features", lambda: ["riscv64"])
    for change, accepted in ((1e-9, True), (1e-3, False)):

        def nudge(data: bytes, change: float = change) -> bytes:
            command = VelocityCommand.FromString(data)
            command.twist.vx += change
            return command.SerializeToString(deterministic=True)

        found = replayed(tampered(session_file, tmp_path, altered("command", 60, nudge)), "controller")
        assert (found.nodes[0].topics["command"].beyond == 0) is accepted


def test_tolerances_are_by_field() -> None:
    assert TOPICS["odometry"].allowed("pose.x") == 0.02
    assert TOPICS["odometry"].allowed("twist.omega") == 0.05
    assert TOPICS["odometry"].allowed("driver_sequence") == 1e-6
    assert TOPICS["truth"].allowed("object_twist.vx") == 0.1
    assert TOPICS["truth"].allowed("object.x") == 0.05
    assert TOPICS["command"].allowed("twist.vx") == 1e-6


def test_an_unknown_service_is_refused(session_file: Path) -> None:
    with pytest.raises(Unusable, match="no service 'wheel'; it has driver"):
        replayed(session_file, "wheel")


def test_files_that_are_no_sessions_are_refused(tmp_path: Path) -> None:
    for name, data, words in (("a", b"nonsense", "no MCAP"), ("b", b"", "no MCAP"), ("c", b"\x89MCAP0\r\n", "header")):
        path = tmp_path / name
        path.write_bytes(data)
        with pytest.raises(Unusable, match=words):
            load(path)
    with pytest.raises(Unusable, match="cannot read"):
        load(tmp_path / "missing")


def test_the_header_says_where_the_session_comes_from(session_file: Path) -> None:
    header: Header = load(session_file).header
    assert header.nodes == NODES
    assert header.seed == 7
    assert header.mode == "local"
    assert header.versions["numpy"].startswith("2.")


def test_the_robot_pose_names_the_odometry_it_is_based_on(session_file: Path) -> None:
    samples = load(session_file).samples
    poses = [RobotPose.FromString(s.payload) for (topic, _), s in samples.items() if topic == "robot/pose"]
    odometry = [Odometry.FromString(s.payload) for (topic, _), s in samples.items() if topic == "odometry"]
    stamps = {message.driver_sequence: message.stamp for message in odometry}
    assert all(stamps[pose.driver_sequence] == pose.stamp for pose in poses)
