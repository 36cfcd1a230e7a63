"""Hands a replay's recorded and replayed messages to the Rerun overlay."""

from __future__ import annotations

from pathlib import Path

from google.protobuf.message import Message

from replays.result import Report
from runtime.recorder.schema import message_type
from runtime.sample import Sample
from runtime.time import Time


def write(report: Report, out: Path) -> None:
    """Write the pairs that `report` kept to the Rerun file `out`."""
    from replays.inspect.overlay import overlay

    pairs = [pair for node in report.nodes for pair in node.overlay]
    recorded = [_decoded(sample) for sample, _ in pairs if sample is not None]
    replayed = [_decoded(sample) for _, sample in pairs if sample is not None]
    overlay(recorded, replayed, out)


def _decoded(sample: Sample) -> tuple[str, Time, Message]:
    return sample.topic, sample.time, message_type(sample.topic).FromString(sample.payload)
