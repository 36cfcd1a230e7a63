"""The replay report, as text for people and as JSON for scripts."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from replays import whatif
from replays.result import Comparison, Finding, NodeResult, Report, TopicResult
from runtime.time import seconds

_MOST_FINDINGS = 10
_LONGEST_TEXT = 240


def text(report: Report) -> Iterator[str]:
    """Return the report line by line."""
    recording = report.recording
    if report.changes:
        yield whatif.summary(report)
    yield f"{recording.path}: run {recording.header.run[:8]}, {recording.header.mode}, seed {recording.header.seed}"
    if recording.damage:
        yield f"  FILE {recording.damage}"
    yield from _comparison_lines(report)
    if report.changes:
        yield from whatif.text(report)
    else:
        for node in report.nodes:
            yield from _node_lines(node)
    yield verdict(report)


def verdict(report: Report) -> str:
    """Return the last line: what the replay found, in one sentence."""
    if report.recording.corrupt:
        return f"CORRUPT: {report.recording.path} is not what was recorded"
    names = [node.node for node in report.nodes]
    outputs = sum(row.recorded for node in report.nodes for row in node.topics.values())
    if report.identical:
        how = "byte for byte" if report.comparison is Comparison.BYTES else "within the declared tolerances"
        return f"IDENTICAL {how}: {outputs} messages of {len(names)} services ({', '.join(names)})"
    different = [node.node for node in report.nodes if not node.identical]
    return f"DIFFERENT: {', '.join(different)}; first {first_finding(report).text}"


def first_finding(report: Report) -> Finding:
    """Return the earliest finding of a report that is not identical."""
    return min((f for node in report.nodes for f in node.findings), key=lambda f: (f.time, f.entry))


def as_json(report: Report) -> dict[str, Any]:
    """Return the report as plain values for JSON. Errors that are infinite, such as of text, become null."""
    return {
        "file": str(report.recording.path),
        "run": report.recording.header.run,
        "damage": report.recording.damage,
        "comparison": report.comparison.value,
        "platform_differences": report.reasons,
        "changed": report.changed,
        "changes": [{"key": one.key, "recorded": one.recorded, "replayed": one.replayed} for one in report.changes],
        "identical": report.identical and not report.recording.corrupt,
        "services": [_node_json(node) for node in report.nodes],
    }


def _comparison_lines(report: Report) -> Iterator[str]:
    if report.comparison is Comparison.BYTES:
        yield "  compared bytes: CPU features and package versions are those of the recording"
        return
    yield "  compared within declared tolerances, since this machine differs from the recording's:"
    for reason in report.reasons:
        yield f"    {reason}"


def _node_lines(node: NodeResult) -> Iterator[str]:
    origin = f"snapshot {node.snapshot}" if node.snapshot else "its beginning"
    span = f"{seconds(node.start):.2f} s to {seconds(node.end):.2f} s"
    state = "identical" if node.identical else f"DIFFERENT ({len(node.findings)} findings)"
    yield f"{node.node}: {state}; {node.events} events from {origin}, {span}"
    if node.note:
        yield f"  coverage: {node.note}"
    for topic, row in node.topics.items():
        yield f"  {topic}: {_topic_line(row)}"
        for name, error in row.differences.fields.items():
            largest = "not comparable" if math.isinf(error.largest) else f"largest {error.largest:.3g}"
            rms = "" if math.isinf(error.largest) else f", RMS {error.rms:.3g}"
            yield f"    {name}: {largest}{rms}, {error.count} values, first at {seconds(error.first):.3f} s"
    for index, finding in enumerate(node.findings[:_MOST_FINDINGS]):
        first = "first " if index == 0 else ""
        yield f"  {first}at {seconds(finding.time):.3f} s, journal entry {finding.entry}: {finding.text}"
    if node.inputs:
        yield "  what it knew when it first diverged, newest last:"
        for known in node.inputs:
            yield f"    {known.topic} {known.sequence}: {known.text[:_LONGEST_TEXT]}"
    if len(node.findings) > _MOST_FINDINGS:
        yield f"  and {len(node.findings) - _MOST_FINDINGS} more findings"


def _topic_line(row: TopicResult) -> str:
    parts = [f"{row.recorded} recorded", f"{row.replayed} replayed", f"{row.identical} identical"]
    parts += [f"{count} {what}" for count, what in ((row.missing, "missing"), (row.extra, "extra")) if count]
    if row.beyond:
        parts.append(f"{row.beyond} differ")
    if row.first is not None:
        parts.append(f"first at {seconds(row.first):.3f} s")
    return ", ".join(parts)


def _node_json(node: NodeResult) -> dict[str, Any]:
    return {
        "name": node.node,
        "identical": node.identical,
        "events": node.events,
        "from_snapshot": node.snapshot,
        "start_ns": node.start,
        "end_ns": node.end,
        "complete": node.complete,
        "note": node.note,
        "outputs": {
            topic: {
                "recorded": row.recorded,
                "replayed": row.replayed,
                "identical": row.identical,
                "missing": row.missing,
                "extra": row.extra,
                "differ": row.beyond,
                "first_ns": row.first,
                "fields": {
                    name: {
                        "largest": None if math.isinf(error.largest) else error.largest,
                        "rms": None if math.isinf(error.rms) else error.rms,
                        "count": error.count,
                        "first_ns": error.first,
                    }
                    for name, error in row.differences.fields.items()
                },
            }
            for topic, row in node.topics.items()
        },
        "inputs": [{"topic": one.topic, "sequence": one.sequence, "text": one.text} for one in node.inputs],
        "findings": [
            {
                "entry": finding.entry,
                "time_ns": finding.time,
                "topic": finding.topic,
                "sequence": finding.sequence,
                "text": finding.text,
            }
            for finding in node.findings
        ],
    }
