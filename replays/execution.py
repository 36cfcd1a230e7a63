"""One life of one service through its journal: execute, compare, note."""

from __future__ import annotations

import math
from collections.abc import Callable

from google.protobuf.text_format import MessageToString

from replays import chain
from replays.recording import Recording
from replays.result import Comparison, Finding, InputValue, NodeResult, TopicResult
from runtime import topics
from runtime.errors import PushlaneError
from runtime.guard import Guard
from runtime.journal import Entry
from runtime.messages import EntryKind, Reply, Snapshot
from runtime.node import Node
from runtime.recorder.schema import message_type
from runtime.sample import Sample
from runtime.service import Service
from runtime.time import Time
from runtime.topics import TOPICS


class Execution:
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
        self._comparison = comparison
        self._start = start
        self._keep = keep

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
        if entry.kind == EntryKind.FINISHED:
            return self.node.finish(entry.time, finish)
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
        errors = result.differences.add(kind.FromString(recorded.payload), kind.FromString(sample.payload), event.time)
        row = TOPICS.get(entry.name)
        if self._comparison is Comparison.TOLERANCES and row is not None:
            errors = {name: error for name, error in errors.items() if error > row.allowed(name)}
            if not errors:
                return
        result.beyond += 1
        worst = max(errors, key=lambda name: errors[name], default="")
        text = f"'{entry.name}' {entry.sequence} differs" + _by(worst, errors.get(worst, 0.0))
        self._diverge(result, event, text, sample, entry)

    def _diverge(
        self, result: TopicResult, event: Entry, text: str, sample: Sample | None, entry: Entry | None = None
    ) -> None:
        if result.first is None:
            result.first = event.time
        if not self.result.inputs:
            self.result.inputs = self._known(event)
        topic = entry.name if entry else (sample.topic if sample else "")
        sequence = entry.sequence if entry else (sample.sequence if sample else 0)
        number = entry.number if entry else event.number
        self.result.findings.append(
            Finding(self.name, number, event.time, f"{text}, while handling {event}", topic, sequence)
        )

    def _known(self, event: Entry) -> list[InputValue]:
        """Return the newest message of every input, the one being handled last."""
        found = []
        for topic, sequence in sorted(self.node.host.consumed.items(), key=lambda item: item[0] == event.name):
            message = self.node.service.latest.get(topic)
            text = "" if message is None else MessageToString(message, as_one_line=True)
            found.append(InputValue(topic, sequence, text))
        return found

    def _compare_snapshot(self, entry: Entry, sample: Sample) -> None:
        recorded = self.recording.snapshots.get((self.name, entry.sequence))
        if recorded is None or recorded.SerializeToString(deterministic=True) == sample.payload:
            return
        if self._comparison is Comparison.TOLERANCES:
            mine = Snapshot.FromString(sample.payload)
            if (recorded.time, recorded.entry, recorded.digest) != (mine.time, mine.entry, entry.digest):
                self._find(entry, f"snapshot {entry.sequence} of '{self.name}' is not of its place in the journal")
            # State that differs in last digits drifts apart; taking up the recorded one bounds that.
            self.node.resume(recorded)
            return
        if not self.result.findings:
            self._find(entry, f"snapshot {entry.sequence} of '{self.name}' differs")

    def _find(self, entry: Entry, text: str, topic: str = "", sequence: int = 0) -> None:
        topic, sequence = (topic, sequence) if topic else (entry.name, entry.sequence)
        self.result.findings.append(Finding(self.name, entry.number, entry.time, text, topic, sequence))


def _by(name: str, error: float) -> str:
    """Say which field differs most, and by how much where it is a number."""
    if not name:
        return ""
    return f", in {name}" if math.isinf(error) else f", {name} by {error:.3g}"
