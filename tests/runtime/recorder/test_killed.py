from __future__ import annotations

import io
import os
import signal
import struct
import subprocess
import sys
import time
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import pytest
from mcap.exceptions import McapError
from mcap.records import Attachment, Channel, Message, Metadata
from mcap.stream_reader import StreamReader

from runtime.messages import Odometry
from tests.support import ROOT

WRITER = """
import os, struct, sys, time
from pathlib import Path
from runtime.messages import Odometry, OccupancyGrid
from runtime.sample import Sample
from runtime.recorder.header import of_this_machine
from runtime.recorder.writer import Recorder

recorder = Recorder(Path(sys.argv[1]), of_this_machine("live", 1, ["driver"]), b'{"sim": {}}')
recorder(Sample("map", 1, 0, OccupancyGrid(width=2, height=2, resolution=0.1, cells=bytes(4)).SerializeToString()))
number = 0
begin = time.monotonic()
while True:
    number += 1
    handed_over = time.monotonic_ns()
    payload = Odometry(stamp=handed_over, driver_sequence=number, covariance=[0.1] * 9).SerializeToString()
    recorder(Sample("odometry", number, number * 2_000_000, payload))
    os.write(1, struct.pack("<q", handed_over))
    time.sleep(max(0.0, begin + number * 0.002 - time.monotonic()))
"""
LOSS = 250_000_000  # ns


@dataclass(frozen=True)
class Killed:
    """A file whose writer was killed, and the times at which it had been handed its messages, ns."""

    path: Path
    handed_over: list[int]


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Killed:
    path = tmp_path_factory.mktemp("killed") / "cut.mcap"
    process = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], cwd=ROOT, stdout=subprocess.PIPE)
    assert process.stdout is not None
    try:
        data = process.stdout.read(8)
        end = time.monotonic() + 2.0
        while time.monotonic() < end:
            data += os.read(process.stdout.fileno(), 1 << 16)
    finally:
        process.send_signal(signal.SIGKILL)
    data += process.stdout.read()
    process.stdout.close()
    process.wait()
    return Killed(path, [number for (number,) in struct.iter_unpack("<q", data)])


def read(path: Path) -> tuple[dict[str, dict[str, str]], dict[str, bytes], dict[str, list[Message]]]:
    """Return metadata, attachments and messages by topic, up to the cut."""
    metadata: dict[str, dict[str, str]] = {}
    attachments: dict[str, bytes] = {}
    channels: dict[int, str] = {}
    messages: dict[str, list[Message]] = {}
    try:
        for record in StreamReader(io.BytesIO(path.read_bytes()), validate_crcs=True).records:
            if isinstance(record, Metadata):
                metadata[record.name] = record.metadata
            elif isinstance(record, Attachment):
                attachments[record.name] = record.data
            elif isinstance(record, Channel):
                channels[record.id] = record.topic
            elif isinstance(record, Message):
                messages.setdefault(channels[record.channel_id], []).append(record)
    except McapError:
        pass  # the cut
    else:
        pytest.fail("the file has an end: its writer was not killed in the middle")
    return metadata, attachments, messages


def test_a_killed_recorder_loses_at_most_a_quarter_of_a_second(killed: Killed) -> None:
    _, _, messages = read(killed.path)
    assert len(killed.handed_over) > 300
    found = [Odometry.FromString(message.data).stamp for message in messages["odometry"]]
    due = [stamp for stamp in killed.handed_over if stamp <= killed.handed_over[-1] - LOSS]
    assert len(due) > 200
    # In order, without a gap, and at least as far as promised.
    assert found[: len(due)] == due
    assert [message.sequence for message in messages["odometry"]] == list(range(1, len(found) + 1))


def test_a_cut_file_still_says_what_it_is(killed: Killed) -> None:
    metadata, attachments, messages = read(killed.path)
    assert metadata["pushlane"]["mode"] == '"live"'
    assert attachments == {"config.json": b'{"sim": {}}'}
    assert len(messages["viewer/map"]) == len(messages["viewer/tf"]) == len(messages["map"]) == 1


def test_rerun_reads_a_cut_file(killed: Killed, tmp_path: Path) -> None:
    """`rerun mcap convert` may exit with 0 and an empty result, so rows are counted."""
    from rerun.chunk import RrdReader

    _, _, messages = read(killed.path)
    spec = find_spec("rerun_cli")
    assert spec is not None and spec.submodule_search_locations is not None
    binary = Path(spec.submodule_search_locations[0]) / "rerun"
    out = tmp_path / "cut.rrd"
    subprocess.run(
        [binary, "mcap", "convert", "--recover", killed.path, "-o", out],
        env={**os.environ, "CI": "1"},
        check=True,
        capture_output=True,
        timeout=60,
    )
    rows = sum(
        chunk.to_record_batch().num_rows
        for chunk in RrdReader(out).store().stream().filter(content="/odometry", is_static=False)
        if any("Odometry" in name for name in chunk.to_record_batch().schema.names)
    )
    assert rows == len(messages["odometry"])
