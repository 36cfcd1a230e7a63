"""Re-executes recorded services from their journals and compares what they give with what was recorded."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from replays import chain, coverage
from replays.execution import Execution
from replays.recording import Recording, Unusable
from replays.result import ChangedSetting, Comparison, NodeResult, Report, TopicResult
from runtime import registry
from runtime.config.layers import Layer, effective
from runtime.guard import Guard
from runtime.journal import Entry
from runtime.messages import EntryKind
from runtime.recorder import header
from runtime.service import Service
from runtime.time import Time


def replay(
    recording: Recording,
    names: Iterable[str] | None = None,
    changes: dict[str, dict[str, Any]] | None = None,
    start: Time = 0,
    keep: bool = False,
    services: Callable[[str], type[Service]] = registry.service_class,
) -> Report:
    """Re-execute nodes of `recording`.

    Args:
        names: which nodes; all by default.
        changes: section -> key -> value over the recorded configuration.
        start: go on from the last snapshot at or before this time, ns.
        keep: keep recorded and replayed samples for an overlay.
        services: name -> service class.

    Raises:
        Unusable: no such node, or a journal cannot be executed at all.
        ConfigError: the recorded configuration, or `changes`, does not fit the services.
        Nondeterministic: a service read a clock or the like.
    """
    only = recording.header.only
    if only and "*" not in only:
        raise Unusable(
            f"{recording.path} holds only the topics {', '.join(only)}: what services consumed is not in it, so they "
            "cannot be replayed; record without --topics"
        )
    reasons = platform_differences(recording)
    comparison = Comparison.TOLERANCES if reasons else Comparison.BYTES
    replayed = list(names or recording.header.nodes)
    for section in changes or {}:
        if section not in replayed:
            raise Unusable(
                f"--set {section}: no section '{section}' is replayed; what can be set is that of {', '.join(replayed)}"
            )
    keys = [f"{section}.{key}" for section, values in (changes or {}).items() for key in values]
    settings = list(_changed(recording.config["sections"], changes or {}))
    report = Report(recording, comparison, reasons, keys, changes=settings)
    available = recording.header.nodes
    for name in names or available:
        if name not in available:
            raise Unusable(f"{recording.path} has no service '{name}'; it has {', '.join(available)}")
    with Guard() as guard:
        for name in names or available:
            lives = _lives(recording, name, start)
            parts = []
            for rows in lives:
                service = _build(recording, name, (changes or {}).get(name, {}), services)
                parts.append(Execution(recording, service, guard, comparison, start, keep).run(rows))
            result = _joined(parts)
            coverage.check(recording, name, services(name).contract, lives, result)
            report.nodes.append(result)
    return report


def _changed(recorded: Any, changes: dict[str, Any], prefix: str = "") -> Iterator[ChangedSetting]:
    """Give every value of `changes` with the one it takes the place of; None where nothing was recorded."""
    for key, change in changes.items():
        before = recorded.get(key) if isinstance(recorded, dict) else None
        if isinstance(change, dict) and isinstance(before, dict):
            yield from _changed(before, change, f"{prefix}{key}.")
        else:
            yield ChangedSetting(f"{prefix}{key}", before, change)


def _lives(recording: Recording, name: str, start: Time) -> list[list[Entry]]:
    """Return the entries of each incarnation of a node that was alive after `start`."""
    try:
        rows = chain.read(recording, name)
    except ValueError as error:
        raise Unusable(f"{recording.path}: {error}") from error
    if not rows:
        raise Unusable(f"{recording.path} has no journal of '{name}'")
    found = [_from_snapshot(recording, name, part) for part in chain.segments(rows)]
    found = [part for part in found if part]
    if not found:
        raise Unusable(f"{recording.path}: '{name}' has neither a beginning nor a snapshot")
    return [part for part in found if part[-1].time >= start] or found[-1:]


def _from_snapshot(recording: Recording, name: str, rows: list[Entry]) -> list[Entry]:
    """Return `rows` from where they can be executed: a recording that joined later begins with a snapshot."""
    if rows[0].kind == EntryKind.STARTED:
        return rows
    for index, entry in enumerate(rows):
        if entry.kind == EntryKind.SNAPSHOT and (name, entry.sequence) in recording.snapshots:
            return rows[index:]
    return []


def _joined(parts: list[NodeResult]) -> NodeResult:
    """Return the results of all incarnations of a node as one."""
    whole = parts[0]
    notes = [part.note for part in parts if part.note]
    for part in parts[1:]:
        whole.end = part.end
        whole.events += part.events
        whole.findings += part.findings
        whole.overlay += part.overlay
        whole.complete = whole.complete and part.complete
        for topic, row in part.topics.items():
            whole.topics.setdefault(topic, TopicResult()).add(row)
    if len(parts) > 1:
        notes.append(f"was restarted {len(parts) - 1} times; each life was replayed from its first snapshot")
    whole.note = "; ".join(notes)
    return whole


def platform_differences(recording: Recording) -> list[str]:
    """Return how this machine differs from the recording's in what decides the last digits of numbers."""
    reasons = []
    here = header.cpu_features()
    if here != recording.header.cpu:
        reasons.append(f"CPU features: recorded {' '.join(recording.header.cpu)}, here {' '.join(here)}")
    versions = header.versions()
    for name, version in recording.header.versions.items():
        if versions.get(name) != version:
            reasons.append(f"{name}: recorded {version}, here {versions.get(name, 'missing')}")
    return reasons


def _build(
    recording: Recording, name: str, changes: dict[str, Any], services: Callable[[str], type[Service]]
) -> Service:
    kind = services(name)
    recorded = Layer(f"{recording.path}, as recorded", {name: recording.config["sections"].get(name, {})})
    return kind(effective({name: kind.Config}, [recorded, Layer("--set", {name: changes})]).sections[name])
