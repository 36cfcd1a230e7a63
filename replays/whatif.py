"""The report of a replay with changed settings, for people: what was changed, and how much it changes."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import NamedTuple

from replays.differences import FieldError
from replays.result import NodeResult, Report, TopicResult
from replays.units import unit_of
from runtime.recorder.schema import message_type
from runtime.time import seconds

_MOST_FIELDS = 6
_MOST_FINDINGS = 1


class _Row(NamedTuple):
    node: NodeResult
    topic: str
    result: TopicResult

    @property
    def different(self) -> int:
        return self.result.beyond + self.result.missing + self.result.extra

    @property
    def share(self) -> float:
        return self.different / max(self.result.recorded + self.result.extra, 1)


def summary(report: Report) -> str:
    """Return in one sentence what was changed and how much that changes."""
    changes = " and ".join(
        f"{one.key} {_value(one.replayed)} instead of {_value(one.recorded)}" for one in report.changes
    )
    rows = _rows(report)
    outputs = sum(row.result.recorded for row in rows)
    names = ", ".join(node.node for node in report.nodes)
    differ = [row for row in rows if row.different]
    if not differ:
        found = "other things than messages differ" if not report.identical else "nothing changes"
        return f"With {changes}, {found}: {outputs} messages of {names} are as recorded"
    first = min(row.result.first for row in differ if row.result.first is not None) if differ else 0
    top = differ[0]
    most = next((f"; {top.topic} {_error(top.topic, *one)}" for one in _ranked(top)), "")
    parts = [
        f"{row.different} of {row.result.recorded} messages of {row.topic} ({_percent(row.share)})" for row in differ
    ]
    more = f" and of {len(parts) - 3} more topics" if len(parts) > 3 else ""
    return f"With {changes}, other values in {', '.join(parts[:3])}{more}, from {seconds(first):.2f} s on{most}"


def text(report: Report) -> Iterator[str]:
    """Return the topics that differ, those that differ most first, with their most important fields."""
    yield "  inputs are those recorded: the world does not answer; push with this setting to see what becomes of it"
    same = []
    for row in _rows(report):
        if not row.different:
            same.append(f"{row.topic} ({row.result.recorded})")
            continue
        counts = (
            (row.result.beyond, "differ"),
            (row.result.missing, "missing"),
            (row.result.extra, "more than recorded"),
        )
        said = ", ".join(f"{count} {what}" for count, what in counts if count)
        since = f", from {seconds(row.result.first):.2f} s on" if row.result.first is not None else ""
        yield f"{row.node.node}: {row.topic}: {said} of {row.result.recorded} recorded ({_percent(row.share)}){since}"
        fields = _ranked(row)
        for name, error in fields[:_MOST_FIELDS]:
            yield f"    {_error(row.topic, name, error)}, {error.count} values, from {seconds(error.first):.2f} s on"
        if len(fields) > _MOST_FIELDS:
            yield f"    and {len(fields) - _MOST_FIELDS} more fields"
    if same:
        yield f"as recorded: {', '.join(same)}"
    for node in report.nodes:
        if node.note:
            yield f"{node.node}: coverage: {node.note}"
        for finding in node.findings[:_MOST_FINDINGS]:
            yield f"{node.node}: first at {seconds(finding.time):.3f} s, journal entry {finding.entry}: {finding.text}"
        if len(node.findings) > _MOST_FINDINGS:
            rest = len(node.findings) - _MOST_FINDINGS
            yield f"  and {rest} more findings; --json has all, and what the service knew at the first"


def _rows(report: Report) -> list[_Row]:
    """Return the output topics, those with the largest share of different messages first."""
    rows = [_Row(node, topic, result) for node in report.nodes for topic, result in node.topics.items()]
    return sorted(rows, key=lambda row: (-row.share, row.node.node, row.topic))


def _ranked(row: _Row) -> list[tuple[str, FieldError]]:
    """Return the fields that differ: quantities first, then text and missing ones, plain numbers, variances, stamps."""

    def rank(item: tuple[str, FieldError]) -> tuple[int, float]:
        name, error = item
        unit = unit_of(message_type(row.topic), name)
        if unit == "ns" or unit.endswith("m^2") or unit == "rad^2":
            return 3, -error.largest
        if math.isinf(error.largest):
            return 1, -error.count
        return (0 if unit else 2), -error.largest

    return sorted(row.result.differences.fields.items(), key=rank)


def _error(topic: str, name: str, error: FieldError) -> str:
    if math.isinf(error.largest):
        return f"{name}: other text, choice or number of elements"
    unit = unit_of(message_type(topic), name)
    scale, unit = (1e-9, "s") if unit == "ns" else (1.0, unit)
    said = f" {unit}" if unit else ""
    return f"{name} by up to {scale * error.largest:.3g}{said}, RMS {scale * error.rms:.3g}{said}"


def _value(value: object) -> str:
    return "what is not set" if value is None else json.dumps(value, default=str)


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %"
