"""Whether the journals account for everything that was recorded, and say that they are whole."""

from __future__ import annotations

from replays.recording import Recording
from replays.result import Finding, NodeResult
from runtime import topics
from runtime.journal import Entry
from runtime.messages import EntryKind
from runtime.sample import INCARNATION, Sample
from runtime.service import Contract


def check(recording: Recording, name: str, contract: Contract, lives: list[list[Entry]], result: NodeResult) -> None:
    """Add to `result` what is recorded of the node `name` but stands in no journal, and journals without an end.

    Excused are only: what came before the recording joined, and the last moments of a life that was cut short, be
    it by the end of a file that was cut, by the death of the service, or because the recorder left it running and
    noted the entry up to which it had its journal.
    """
    _doubled(recording, name, contract, result)
    for index, rows in enumerate(lives):
        last = index == len(lives) - 1
        left = recording.running.get(name) == rows[-1].number
        cut_short = not last or recording.damage is not None or left
        if not result.complete:
            return  # a break was found and named; what comes after it was not read
        ended = next((row.kind for row in reversed(rows) if row.kind != EntryKind.PRODUCED), None)
        if ended != EntryKind.FINISHED and not cut_short:
            _find(result, rows[-1], f"journal of '{name}' has no end after {rows[-1]}: entries are missing")
        _unaccounted(recording, name, contract, rows, cut_short, result)
    result.findings.sort(key=lambda finding: finding.entry)


def _unaccounted(
    recording: Recording, name: str, contract: Contract, rows: list[Entry], cut_short: bool, result: NodeResult
) -> None:
    life = rows[0].number // INCARNATION
    given = {(entry.name, entry.sequence) for entry in rows if entry.kind == EntryKind.PRODUCED}
    excused = 0
    for topic in (*contract.outputs, topics.log(name).name):
        for sample in _samples(recording, topic, life):
            if (sample.topic, sample.sequence) in given or sample.time < rows[0].time:
                continue
            if cut_short and sample.time >= rows[-1].time:
                excused += 1
                continue
            text = f"'{topic}' {sample.sequence} was recorded, but no journal says that '{name}' gave it"
            result.findings.append(Finding(name, rows[-1].number, sample.time, text, topic, sample.sequence))
    if excused:
        note = f"the last {excused} messages of '{name}' came after its journal was cut off"
        result.note = "; ".join(part for part in (result.note, note) if part)


def _samples(recording: Recording, topic: str, life: int) -> list[Sample]:
    return [
        sample
        for (name, sequence), sample in recording.samples.items()
        if name == topic and (sequence - 1) // INCARNATION == life
    ]


def _doubled(recording: Recording, name: str, contract: Contract, result: NodeResult) -> None:
    for topic, sequence in recording.doubled:
        if topic in contract.outputs:
            text = f"the file holds '{topic}' {sequence} more than once"
            result.findings.append(Finding(name, 0, 0, text, topic, sequence))


def _find(result: NodeResult, entry: Entry, text: str) -> None:
    result.findings.append(Finding(result.node, entry.number, entry.time, text))
