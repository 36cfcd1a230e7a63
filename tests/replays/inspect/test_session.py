from __future__ import annotations

import struct
from pathlib import Path

import pytest
from google.protobuf.message import Message
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from mcap_protobuf.schema import register_schema

from replays.inspect.errors import Unreadable
from replays.inspect.session import read_session
from runtime.messages import Odometry, RobotPose, Twist2


def written(out: Path, rows: list[tuple[str, int, Message]]) -> Path:
    with out.open("wb") as file:
        writer = Writer(file)
        writer.start()
        for topic, time, message in rows:
            channel = writer.register_channel(topic, "protobuf", register_schema(writer, type(message)))
            writer.add_message(channel, time, message.SerializeToString(), time)
        writer.finish()
    return out


def test_every_message_is_read_with_its_time(push: Path) -> None:
    session = read_session(push)
    with push.open("rb") as file:
        rows = [
            (channel.topic, record.log_time, record.data) for _, channel, record in make_reader(file).iter_messages()
        ]
    for topic in {topic for topic, _, _ in rows}:
        track = session.tracks[topic]
        expected = [(time, data) for name, time, data in rows if name == topic]
        got = [(int(t), m.SerializeToString()) for t, m in zip(track.times, track.messages, strict=True)]
        assert got == expected
    assert session.damage == ""
    assert session.metadata["header"]["seed"] == "7"
    assert session.attachments["config.toml"].startswith(b"[controller]")


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(share=st.floats(0.15, 0.999))
def test_a_cut_file_gives_a_beginning_of_what_the_whole_one_gives(push: Path, tmp_path: Path, share: float) -> None:
    data = push.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: int(share * len(data))])
    whole, part = read_session(push), read_session(cut)
    assert part.damage != "" or part.span == whole.span
    for topic, track in part.tracks.items():
        assert track.messages == whole.tracks[topic].messages[: len(track)]


def test_a_changed_byte_ends_the_reading_and_is_said(push: Path, tmp_path: Path) -> None:
    data = bytearray(push.read_bytes())
    data[len(data) // 2] ^= 0xFF
    bad = tmp_path / "bad.mcap"
    bad.write_bytes(data)
    session = read_session(bad)
    assert session.damage != ""
    assert session.tracks


def test_a_changed_number_is_not_shown(tmp_path: Path) -> None:
    out = tmp_path / "a.mcap"
    with out.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start()
        channel = writer.register_channel("odometry", "protobuf", register_schema(writer, Odometry))
        writer.add_message(channel, 0, Odometry(covariance=[1234.5]).SerializeToString(), 0)
        writer.finish()
    data = out.read_bytes()
    number = struct.pack("<d", 1234.5)
    assert data.count(number) == 1
    out.write_bytes(data.replace(number, struct.pack("<d", 1234.75)))
    with pytest.raises(Unreadable, match="crc"):
        read_session(out)


def test_messages_are_sorted_by_time(tmp_path: Path) -> None:
    rows: list[tuple[str, int, Message]] = [("odometry", t, Odometry(stamp=t)) for t in (5, 1, 3)]
    track = read_session(written(tmp_path / "a.mcap", rows)).track("odometry", Odometry)
    assert [m.stamp for m in track.messages] == [1, 3, 5]
    assert track.latest(track.times - 1).tolist() == [-1, 0, 1]
    assert track.latest(track.times).tolist() == [0, 1, 2]


def test_a_topic_of_another_type_is_refused(tmp_path: Path) -> None:
    session = read_session(written(tmp_path / "a.mcap", [("odometry", 0, Twist2(vx=1.0))]))
    with pytest.raises(Unreadable, match=r"odometry carries pushlane\.Twist2, expected pushlane\.Odometry"):
        session.track("odometry", Odometry)


def test_a_topic_that_is_missing_is_empty(push: Path) -> None:
    assert len(read_session(push).track("nothing", RobotPose)) == 0


def test_copies_for_plain_viewers_are_left_out(tmp_path: Path) -> None:
    rows: list[tuple[str, int, Message]] = [("viewer/tf", 0, Odometry()), ("odometry", 0, Odometry())]
    session = read_session(written(tmp_path / "a.mcap", rows))
    assert list(session.tracks) == ["odometry"]
    assert session.undecoded == {}


def test_what_cannot_be_decoded_is_counted(tmp_path: Path) -> None:
    out = tmp_path / "a.mcap"
    with out.open("wb") as file:
        writer = Writer(file)
        writer.start()
        unknown = writer.register_channel("foo", "json", writer.register_schema("Foo", "jsonschema", b"{}"))
        known = writer.register_channel("odometry", "protobuf", register_schema(writer, Odometry))
        for data in (b"\xff\xff\xff", Odometry(stamp=1).SerializeToString()):
            writer.add_message(unknown, 0, b"{}", 0)
            writer.add_message(known, 0, data, 0)
        writer.finish()
    session = read_session(out)
    assert session.undecoded == {"foo": 2, "odometry": 1}
    assert len(session.tracks["odometry"]) == 1


@pytest.mark.parametrize("data", [b"", b"not an MCAP file at all", b"\x89MCAP0\r\n"])
def test_a_file_without_messages_is_refused(tmp_path: Path, data: bytes) -> None:
    out = tmp_path / "a.mcap"
    out.write_bytes(data)
    with pytest.raises(Unreadable, match=r"a\.mcap: nothing to show"):
        read_session(out)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(Unreadable, match="No such file"):
        read_session(tmp_path / "none.mcap")
