from __future__ import annotations

import io
import subprocess
import sys
from pathlib import Path

import msgspec
import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import Message
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.records import Attachment, DataEnd, Metadata
from mcap.records import Header as FileHeader
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory

from runtime import topics
from runtime.messages import (
    Corridor,
    EntryKind,
    Journal,
    LaserScan,
    Log,
    ObjectState,
    OccupancyGrid,
    Odometry,
    Polyline,
    PushGoal,
    Snapshot,
)
from runtime.recorder.header import CONFIG_NAME, METADATA_NAME, Header, of_this_machine
from runtime.recorder.schema import descriptor_set, message_type
from runtime.recorder.writer import CannotRecord, Recorder
from runtime.sample import Sample
from runtime.topics import TOPICS
from tests.support import ROOT

HEADER = Header(
    format=1,
    run="0123",
    mode="local",
    commit="",
    dirty=True,
    seed=7,
    nodes=["driver", "task"],
    host='a "host"',
    cpu=["x86_64"],
    versions={"numpy": "2"},
)
CONFIG = b'{"controller": {"k_gamma": 0.5}}'
MESSAGES: dict[str, Message] = {
    "odometry": Odometry(stamp=3, pose={"x": 0.1, "theta": -3.0}, covariance=[0.1] * 9, driver_sequence=2**40),
    "scan": LaserScan(frame_id="base", ranges=[1.0, 2.0, float("inf")]),
    "object/state": ObjectState(stamp=5, yaw=0.0),
    "corridor": Corridor(version=2, edge_push=[Polyline(x=[1, 2], y=[3, 4]), Polyline()]),
    "push/goal": PushGoal(position={"x": 1, "y": 2}, strategy="strict"),
    "journal/task": Journal(node="task", names=["tick"], kind=[EntryKind.TIMER], name=[0], sequence=[1], time=[-5]),
    "snapshot/task": Snapshot(node="task", service=bytes(range(256))),
    "log/task": Log(message="grüß Gott", name="task"),
}


def record(path: Path, samples: list[Sample]) -> None:
    with Recorder(path, HEADER, CONFIG) as recorder:
        for sample in samples:
            recorder(sample)
        assert recorder.count == len(samples)


SAMPLES = [
    Sample(topic, sequence, 1000 * sequence + index, message.SerializeToString(deterministic=True))
    for sequence in (1, 2, 2**32 - 1)
    for index, (topic, message) in enumerate(MESSAGES.items())
]


def test_what_is_written_is_what_any_reader_decodes(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    record(path, SAMPLES)
    with path.open("rb") as file:
        rows = list(make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages(log_time_order=False))
    assert len(rows) == len(SAMPLES)
    for (schema, channel, message, decoded), sample in zip(rows, SAMPLES, strict=True):
        assert (channel.topic, message.sequence, message.data) == (sample.topic, sample.sequence, sample.payload)
        assert message.publish_time == message.log_time == sample.time
        # The reader builds its own class from the schema in the file; bytes and full name must agree with ours.
        original = MESSAGES[sample.topic]
        assert schema is not None and schema.encoding == "protobuf"
        assert schema.name == decoded.DESCRIPTOR.full_name == original.DESCRIPTOR.full_name
        assert decoded.SerializeToString(deterministic=True) == sample.payload
        assert type(original).FromString(decoded.SerializeToString()) == original


def test_the_summary_counts_and_indexes_everything(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    record(path, SAMPLES)
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        metadata = list(reader.iter_metadata())
        attachments = list(reader.iter_attachments())
    assert summary is not None and summary.statistics is not None
    assert summary.statistics.message_count == len(SAMPLES)
    counts = {summary.channels[i].topic: n for i, n in summary.statistics.channel_message_counts.items()}
    assert counts == dict.fromkeys(MESSAGES, 3)
    assert [Header.from_metadata(dict(entry.metadata)) for entry in metadata] == [HEADER]
    assert [attachment.data for attachment in attachments] == [CONFIG]


def test_header_and_configuration_come_first(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    record(path, SAMPLES)
    first, second, third, *_ = StreamReader(io.BytesIO(path.read_bytes()), validate_crcs=True).records
    assert isinstance(first, FileHeader)
    assert isinstance(second, Metadata) and second.name == METADATA_NAME
    assert Header.from_metadata(second.metadata) == HEADER
    assert isinstance(third, Attachment)
    assert (third.name, third.media_type, third.data) == (CONFIG_NAME, "application/json", CONFIG)


def test_the_header_is_on_disk_before_the_first_message(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Recorder(path, HEADER, CONFIG):
        assert CONFIG in path.read_bytes()


def test_every_byte_of_the_data_is_under_a_checksum(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    record(path, SAMPLES)
    ends = [
        r for r in StreamReader(io.BytesIO(path.read_bytes()), validate_crcs=True).records if isinstance(r, DataEnd)
    ]
    assert len(ends) == 1 and ends[0].data_section_crc != 0


def test_the_same_samples_give_the_same_messages_whenever_chunks_are_closed(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Recorder(path, HEADER, CONFIG) as recorder:
        for index, sample in enumerate(SAMPLES):
            recorder(sample)
            if index == 3:
                with recorder._lock:
                    recorder._writer.flush()
    with path.open("rb") as file:
        found = [(c.topic, m.sequence, m.data) for _, c, m in make_reader(file).iter_messages(log_time_order=False)]
    assert found == [(sample.topic, sample.sequence, sample.payload) for sample in SAMPLES]


def test_an_empty_session_is_a_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    record(path, [])
    with path.open("rb") as file:
        assert list(make_reader(file).iter_messages()) == []


def test_closing_twice_is_closing_once(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.mcap", HEADER, CONFIG)
    recorder.close()
    size = (tmp_path / "a.mcap").stat().st_size
    recorder.close()
    assert (tmp_path / "a.mcap").stat().st_size == size


def test_an_error_in_the_session_leaves_a_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"

    def session() -> None:
        with Recorder(path, HEADER, CONFIG) as recorder:
            recorder(SAMPLES[0])
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        session()
    with path.open("rb") as file:
        assert len(list(make_reader(file).iter_messages())) == 1


ALL_TYPES = sorted(
    {topic.message for topic in TOPICS.values()} | {topics.health("x").message}, key=lambda m: m.__name__
)


@pytest.mark.parametrize("kind", [*ALL_TYPES, Journal, Snapshot, Log], ids=lambda kind: kind.__name__)
def test_a_schema_stands_alone(kind: type[Message]) -> None:
    """Files come after what they import, so that a reader without any of our code can build them in one pass."""
    pool = descriptor_pool.DescriptorPool()
    data = descriptor_set(kind.DESCRIPTOR.file).SerializeToString()
    for file in descriptor_pb2.FileDescriptorSet.FromString(data).file:
        pool.Add(file)
    descriptor = pool.FindMessageTypeByName(kind.DESCRIPTOR.full_name)
    assert [(f.name, f.number, f.type) for f in descriptor.fields] == [
        (f.name, f.number, f.type) for f in kind.DESCRIPTOR.fields
    ]
    assert message_factory.GetMessageClass(descriptor).FromString(b"").SerializeToString() == b""


def test_an_unknown_topic_has_no_type() -> None:
    with pytest.raises(KeyError):
        message_type("odometri")


GRIDS = st.tuples(st.integers(1, 12), st.integers(1, 12)).flatmap(
    lambda size: st.builds(
        OccupancyGrid,
        stamp=st.integers(0, 2**60),
        version=st.integers(1, 9),
        resolution=st.sampled_from([0.05, 0.1]),
        width=st.just(size[0]),
        height=st.just(size[1]),
        origin=st.builds(dict, x=st.floats(-10, 10), y=st.floats(-10, 10)),
        cells=st.lists(st.sampled_from([0, 100, 255]), min_size=size[0] * size[1], max_size=size[0] * size[1]).map(
            bytes
        ),
    )
)


@settings(max_examples=15, deadline=None)
@given(grid=GRIDS)
def test_viewers_are_given_the_same_map(tmp_path_factory: pytest.TempPathFactory, grid: OccupancyGrid) -> None:
    from rosbags.typesys import Stores, get_typestore

    path = tmp_path_factory.mktemp("map") / "a.mcap"
    record(path, [Sample("map", 1, 77, grid.SerializeToString()), Sample("map", 2, 99, grid.SerializeToString())])
    with path.open("rb") as file:
        rows = [(s, c, m) for s, c, m in make_reader(file).iter_messages() if c.topic == "viewer/map"]
    assert [(message.log_time, message.sequence) for _, _, message in rows] == [(77, 1), (99, 2)]
    schema, channel, message = rows[0]
    assert schema is not None
    assert (schema.name, schema.encoding, channel.message_encoding) == ("nav_msgs/msg/OccupancyGrid", "ros2msg", "cdr")
    seen = get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr(message.data, "nav_msgs/msg/OccupancyGrid")
    assert (seen.info.width, seen.info.height) == (grid.width, grid.height)
    assert seen.info.resolution == np.float32(grid.resolution)
    assert (seen.info.origin.position.x, seen.info.origin.position.y) == (grid.origin.x, grid.origin.y)
    assert seen.info.origin.orientation.w == 1.0
    assert seen.header.frame_id == "map"
    assert seen.header.stamp.sec * 10**9 + seen.header.stamp.nanosec == grid.stamp
    # ROS 2 says -1 for unknown where we say 255; free and occupied are 0 and 100 in both.
    meaning = {0: 0, 100: 100, 255: -1}
    assert seen.data.tolist() == [meaning[cell] for cell in grid.cells]


def test_a_transform_places_the_map_once(tmp_path: Path) -> None:
    grid = OccupancyGrid(width=1, height=1, resolution=0.1, cells=b"\0").SerializeToString()
    record(tmp_path / "a.mcap", [Sample("map", n, n, grid) for n in (1, 2, 3)])
    with (tmp_path / "a.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        found = [d for _, c, _, d in reader.iter_decoded_messages(topics=["viewer/tf"])]
    assert [(tf.parent_frame_id, tf.child_frame_id, tf.rotation.w) for tf in found] == [("tf#/", "map", 1.0)]


def test_the_header_of_this_machine_survives_its_text_form() -> None:
    header = of_this_machine("local", 3, ["driver", "task"])
    pairs = header.metadata()
    assert all(isinstance(key, str) and isinstance(value, str) for key, value in pairs.items())
    assert Header.from_metadata(pairs) == header
    assert header.versions["numpy"] == np.__version__
    assert header.run != of_this_machine("local", 3, []).run


def test_a_header_that_is_none_is_refused() -> None:
    pairs = HEADER.metadata()
    del pairs["seed"]
    with pytest.raises(msgspec.MsgspecError, match="seed"):
        Header.from_metadata(pairs)


def test_a_place_that_cannot_be_written_is_refused_by_name(tmp_path: Path) -> None:
    for path in (tmp_path / "missing" / "a.mcap", tmp_path):
        with pytest.raises(CannotRecord, match=str(path)):
            Recorder(path, HEADER, CONFIG)


FULL_DISK = """
import resource, signal, sys, time
from pathlib import Path
from runtime.sample import Sample
from runtime.recorder.header import Header
from runtime.recorder.writer import CannotRecord, Recorder

signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
path, limit, pause, count = Path(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]), int(sys.argv[4])
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
header = Header(format=1, run="", mode="local", commit="", dirty=False, seed=1, nodes=[], host="", cpu=[], versions={})
noise = __import__("random").Random(1)
written = 0
try:
    with Recorder(path, header, b"{}") as recorder:
        for number in range(1, count + 1):
            recorder(Sample("snapshot/task", number, number, b"\\x32\\xc8\\x01" + noise.randbytes(200)))
            written = number
            time.sleep(pause)
except CannotRecord as error:
    print("CannotRecord", written, error)
"""


@pytest.mark.parametrize(
    ("limit", "pause", "count", "early"),
    [
        (100, 0.0, 1, True),  # not even the header
        (50_000, 0.0, 20_000, True),  # the disk fills in the middle of a burst
        (20_000, 0.005, 300, True),  # the flushing thread meets the full disk first
        (2_000, 0.0, 20, False),  # all is taken, and nothing fits at the end
    ],
    ids=["header", "burst", "slowly", "at the end"],
)
def test_a_full_disk_is_said(tmp_path: Path, limit: int, pause: float, count: int, early: bool) -> None:
    path = tmp_path / "full.mcap"
    arguments = [str(path), str(limit), str(pause), str(count)]
    result = subprocess.run(
        [sys.executable, "-c", FULL_DISK, *arguments], cwd=ROOT, capture_output=True, text=True, check=False, timeout=60
    )
    assert result.returncode == 0 and result.stderr == "", result.stderr
    verdict, written, *_ = result.stdout.split()
    assert verdict == "CannotRecord" and str(path) in result.stdout
    assert (int(written) < count) == early
