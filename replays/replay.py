"""Re-executes recorded services from their journals and compares what they give with what was recorded."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import msgspec

from replays import chain
from replays.differences import Differences
from replays.recording import Recording, Unusable
from runtime import registry, topics
from runtime.errors import PushlaneError
from runtime.guard import Guard
from runtime.journal import Entry
from runtime.messages import EntryKind, Reply
from runtime.node import Node, Sample
from runtime.recorder import header
from runtime.recorder.schema import message_type
from runtime.service import Service
from runtime.time import Time
from runtime.topics import TOPICS

SectionOf = Callable[[str], Any]


class Comparison(Enum):
    """How outputs are compared."""

    BYTES = "bytes"
    TOLERANCES = "tolerances"


@dataclass(frozen=True)
class Finding:
    """One thing that is not as it was recorded.

    Attributes:
        node: whose journal shows it.
        entry: number of the journal entry.
        time: logical time, ns.
        text: what and where, for people.
        topic, sequence: the message concerned, if one is.
    """

    node: str
    entry: int
    time: Time
    text: str
    topic: str = ""
    sequence: int = 0


@dataclass
class TopicResult:
    """How one output topic of one node compares."""

    recorded: int = 0
    replayed: int = 0
    identical: int = 0
    missing: int = 0  # recorded, not given by the replay
    extra: int = 0  # given by the replay, not recorded
    beyond: int = 0  # differ by more than is allowed
    first: Time | None = None  # of the first divergence
    differences: Differences = field(default_factory=Differences)

    def add(self, other: TopicResult) -> None:
        """Take in what another incarnation of the same service gave."""
        self.recorded += other.recorded
        self.replayed += other.replayed
        self.identical += other.identical
        self.missing += other.missing
        self.extra += other.extra
        self.beyond += other.beyond
        self.first = other.first if self.first is None else self.first
        self.differences.join(other.differences)


@dataclass
class NodeResult:
    """The replay of one node.

    Attributes:
        start, end: logical time covered, ns.
        snapshot: number of the snapshot it started from; 0 for the service's own beginning.
        events: handled.
        findings: in the order of the journal.
        complete: the whole journal was executed.
        note: what is missing from the coverage, if anything.
    """

    node: str
    start: Time = 0
    end: Time = 0
    snapshot: int = 0
    events: int = 0
    topics: dict[str, TopicResult] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    inputs: list[str] = field(default_factory=list)
    complete: bool = True
    note: str = ""
    overlay: list[tuple[Sample | None, Sample | None]] = field(default_factory=list)

    @property
    def identical(self) -> bool:
        """Return whether nothing differs beyond what the comparison allows."""
        return not self.findings


@dataclass
class Report:
    """The replay of a session."""

    recording: Recording
    comparison: Comparison
    reasons: list[str]  # why bytes are not compared
    changed: list[str]  # configuration keys changed for this replay
    nodes: list[NodeResult] = field(default_factory=list)

    @property
    def identical(self) -> bool:
        """Return whether all nodes are."""
        return all(node.identical for node in self.nodes)


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
        Nondeterministic: a service read a clock or the like.
    """
    reasons = platform_differences(recording)
    comparison = Comparison.TOLERANCES if reasons else Comparison.BYTES
    keys = [f"{section}.{key}" for section, values in (changes or {}).items() for key in values]
    report = Report(recording, comparison, reasons, keys)
    available = recording.header.nodes
    for name in names or available:
        if name not in available:
            raise Unusable(f"{recording.path} has no service '{name}'; it has {', '.join(available)}")
    with Guard() as guard:
        for name in names or available:
            parts = []
            for rows in _segments(recording, name, start):
                service = _build(recording, name, (changes or {}).get(name, {}), services)
                parts.append(_Execution(recording, service, guard, comparison, start, keep).run(rows))
            report.nodes.append(_joined(recording, parts))
    return report


def _segments(recording: Recording, name: str, start: Time) -> list[list[Entry]]:
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


def _joined(recording: Recording, parts: list[NodeResult]) -> NodeResult:
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
    journaled = {topic: row.recorded for topic, row in whole.topics.items()}
    kept = Counter(topic for topic, _ in recording.samples if topic in journaled)
    lost = sum(kept[topic] - count for topic, count in journaled.items())
    if lost > 0 and whole.start <= parts[0].start and whole.complete and not whole.snapshot:
        notes.append(f"{lost} recorded messages are in no journal: their service or the recording ended too soon")
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
    values = _overlaid(recording.config["sections"].get(name, {}), changes)
    try:
        return kind(msgspec.convert(values, kind.Config))
    except msgspec.ValidationError as error:
        raise Unusable(f"{recording.path}: the configuration of '{name}' does not fit: {error}") from error


def _overlaid(values: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    result = dict(values)
    for key, change in changes.items():
        inner = result.get(key)
        result[key] = _overlaid(inner, change) if isinstance(change, dict) and isinstance(inner, dict) else change
    return result


class _Execution:
    """One node through its journal."""

    def __init__(
        self,
        recording: Recording,
        service: Service,
        guard: Guard,
        comparison: Comparison,
        start: Time,
        keep: bool,
    ) -> None:
        self.recording = recording
        self.name = service.name
        self.node = Node(service, guard)
        self.result = NodeResult(self.name)
        self.result.inputs = list(service.contract.inputs)
        self._comparison = comparison
        self._start = start
        self._keep = keep
        self._expected: list[Entry] = []

    def run(self, rows: list[Entry]) -> NodeResult:
        """Execute the entries of one incarnation."""
        rows = self._cut_at_breaks(rows)
        first = self._begin(rows)
        for topic in (*self.node.contract.outputs, topics.log(self.name).name):
            self.result.topics[topic] = TopicResult()
        index = first
        while index < len(rows):
            index = self._step(rows, index)
        self.result.end = rows[-1].time if rows else self.result.start
        self.result.topics = {name: row for name, row in self.result.topics.items() if row.recorded or row.extra}
        self.result.findings.sort(key=lambda finding: finding.entry)
        return self.result

    def _cut_at_breaks(self, rows: list[Entry]) -> list[Entry]:
        """Report every break of the chain, and leave out what comes after one that cannot be bridged."""
        for found in chain.breaks(self.recording, self.name, rows):
            entry = found.entry
            self._find(entry, f"journal of '{self.name}', {found.text}")
            if found.structural:
                self.result.complete = False
                self.result.note = f"stopped at entry {entry.number} of {rows[-1].number + 1}: {found.text}"
                return [row for row in rows if row.number < entry.number]
        return rows

    def _begin(self, rows: list[Entry]) -> int:
        """Start the node at its beginning or from a snapshot. Returns the index of the next entry."""
        for index in range(len(rows) - 1, -1, -1):
            entry = rows[index]
            late_enough = entry.time <= self._start or index <= 1
            if entry.kind != EntryKind.SNAPSHOT or not late_enough or (rows[0].number == 0 and index <= 1):
                continue
            snapshot = self.recording.snapshots.get((self.name, entry.sequence))
            if snapshot is not None:
                self.node.resume(snapshot)
                self.result.snapshot = snapshot.number
                self.result.start = entry.time
                return index + 1
        if rows and rows[0].kind == EntryKind.STARTED and rows[0].number == 0:
            self.result.start = rows[0].time
            self._compare_snapshot(rows[1] if len(rows) > 1 else rows[0], self.node.begin(rows[0].time)[0])
            return min(2, len(rows))
        return 0

    def _step(self, rows: list[Entry], index: int) -> int:
        """Execute the event at `index` and compare what belongs to it. Returns the index of the next event."""
        entry = rows[index]
        end = index + 1
        while end < len(rows) and rows[end].kind in (EntryKind.PRODUCED, EntryKind.REPLIED):
            end += 1
        outputs = rows[index + 1 : end]
        finish = outputs[0].time if outputs else entry.time
        self.result.events += 1
        samples = self._execute(entry, finish)
        if samples is not None and not (len(rows) == end and self.recording.damage and not outputs):
            self._compare(entry, outputs, samples)
        return end

    def _execute(self, entry: Entry, finish: Time) -> list[Sample] | None:
        """Return what the node gives for one event, or None if it cannot be given to it."""
        if entry.kind == EntryKind.MESSAGE:
            sample = self.recording.samples.get((entry.name, entry.sequence))
            if sample is None:
                return None  # the chain has reported it
            return self._accepted(entry, lambda: self.node.consume(sample, entry.time, finish))
        if entry.kind == EntryKind.TIMER:
            return self._accepted(entry, lambda: self.node.fire(entry.name, entry.sequence, entry.time, finish))
        if entry.kind == EntryKind.REQUEST:
            request = self.recording.requests.get((self.name, entry.sequence))
            if request is None:
                return None
            return self._accepted(entry, lambda: self.node.ask(request, entry.time, finish))
        if entry.kind == EntryKind.SNAPSHOT:
            self._compare_snapshot(entry, self.node.take_snapshot(entry.time))
            return []
        self._find(entry, f"journal of '{self.name}', {entry}: not an event")
        return None

    def _accepted(self, entry: Entry, work: Callable[[], list[Sample]]) -> list[Sample] | None:
        try:
            return work()
        except PushlaneError as error:
            if error.exit_code == 1:
                raise
            self._find(entry, f"'{self.name}' cannot take {entry}: {error}", entry.name, entry.sequence)
        except KeyError:
            self._find(entry, f"'{self.name}' no longer takes '{entry.name}'", entry.name, entry.sequence)
        return None

    def _compare(self, event: Entry, outputs: list[Entry], samples: list[Sample]) -> None:
        reply_topic = topics.reply(self.name).name
        given = [sample for sample in samples if sample.topic != reply_topic]
        replies = [sample for sample in samples if sample.topic == reply_topic]
        # The n-th message of a topic within an event belongs to the n-th recorded one: a message too many or too
        # few, which shifts all later sequence numbers, must not make everything after it look different.
        waiting: dict[str, list[Entry]] = {}
        for entry in outputs:
            if entry.kind == EntryKind.PRODUCED:
                waiting.setdefault(entry.name, []).append(entry)
        for sample in given:
            result = self.result.topics.setdefault(sample.topic, TopicResult())
            result.replayed += 1
            if waiting.get(sample.topic):
                self._compare_message(event, waiting[sample.topic].pop(0), sample, result)
                continue
            result.extra += 1
            self._diverge(result, event, f"replay gave a '{sample.topic}' that was not recorded", sample)
        for entry in (entry for rest in waiting.values() for entry in rest):
            result = self.result.topics.setdefault(entry.name, TopicResult())
            result.recorded += 1
            result.missing += 1
            self._diverge(result, event, f"replay gave no '{entry.name}' {entry.sequence}", None, entry)
        for entry in (entry for entry in outputs if entry.kind == EntryKind.REPLIED):
            recorded = self.recording.replies.get((self.name, entry.sequence))
            if recorded is None:
                continue
            if not replies or Reply.FromString(replies[0].payload) != recorded:
                self._find(event, f"reply to {entry.name} {entry.sequence} differs", entry.name, entry.sequence)

    def _compare_message(self, event: Entry, entry: Entry, sample: Sample, result: TopicResult) -> None:
        result.recorded += 1
        recorded = self.recording.samples.get((entry.name, entry.sequence))
        if recorded is None:
            return  # the chain has reported it
        if self._keep:
            self.result.overlay.append((recorded, sample))
        if recorded.payload == sample.payload:
            result.identical += 1
            return
        kind = message_type(entry.name)
        largest = result.differences.add(kind.FromString(recorded.payload), kind.FromString(sample.payload), event.time)
        row = TOPICS.get(entry.name)
        if self._comparison is Comparison.TOLERANCES and row is not None and largest <= row.tolerance:
            return
        result.beyond += 1
        worst = max(result.differences.fields.items(), key=lambda item: item[1].largest, default=None)
        field_text = f", {worst[0]} by {worst[1].largest:.3g}" if worst else ""
        text = f"'{entry.name}' {entry.sequence} differs{field_text}"
        self._diverge(result, event, text, sample, entry)

    def _diverge(
        self, result: TopicResult, event: Entry, text: str, sample: Sample | None, entry: Entry | None = None
    ) -> None:
        if result.first is None:
            result.first = event.time
        topic = entry.name if entry else (sample.topic if sample else "")
        sequence = entry.sequence if entry else (sample.sequence if sample else 0)
        number = entry.number if entry else event.number
        self.result.findings.append(
            Finding(self.name, number, event.time, f"{text}, while handling {event}", topic, sequence)
        )

    def _compare_snapshot(self, entry: Entry, sample: Sample) -> None:
        recorded = self.recording.snapshots.get((self.name, entry.sequence))
        if recorded is None or recorded.SerializeToString(deterministic=True) == sample.payload:
            return
        if self._comparison is Comparison.TOLERANCES:
            # State that differs in last digits drifts apart; taking up the recorded one bounds that.
            self.node.resume(recorded)
            return
        if not self.result.findings:
            self._find(entry, f"snapshot {entry.sequence} of '{self.name}' differs")

    def _find(self, entry: Entry, text: str, topic: str = "", sequence: int = 0) -> None:
        topic, sequence = (topic, sequence) if topic else (entry.name, entry.sequence)
        self.result.findings.append(Finding(self.name, entry.number, entry.time, text, topic, sequence))
