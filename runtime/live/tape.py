"""Writes a running system down: one file, or parts that each replay alone.

At a split both parts are written for a while: the new one begins, every service is asked for a snapshot, and the old
one ends when it holds every service's journal up to that snapshot. So every message is in at least one part.
"""

from __future__ import annotations

import fnmatch
import queue
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import msgspec
import zenoh
from google.protobuf.message import DecodeError

from runtime import topics
from runtime.bus import envelope
from runtime.bus.keys import Keys
from runtime.errors import PushlaneError
from runtime.live.clock import Clock
from runtime.live.gaps import Gaps
from runtime.live.inbox import follows
from runtime.live.part import Part, free_name
from runtime.live.plan import Plan
from runtime.live.sent import Missing
from runtime.live.split import Split
from runtime.messages import EntryKind, Journal, Log, Snapshot
from runtime.recorder import header
from runtime.recorder.schema import message_type
from runtime.sample import BadMessage, Sample, parse
from runtime.topics import TOPICS

RECORDER = "recorder"

_SETTLE = 0.3
"""s that a message may be under way: what was sent before must have been handled, or written, after it."""
_ANSWER_LIMIT = 5.0
_GIVE_UP = 60.0
_OVERDUE = 1.0
_OVERLAP_LIMIT = 3.0
_LOOK_EVERY = 0.2


@dataclass(frozen=True)
class _Answer:
    """A latched value, which may also come by subscription."""

    sample: Sample


@dataclass(frozen=True)
class _Late:
    """Messages of `topic` that were missed, as far as their sender still had them; `text` says which those were."""

    topic: str
    text: str
    time: int
    samples: list[Sample]


@dataclass(frozen=True)
class _Begin:
    """The snapshot that a service gave when asked for one."""

    node: str
    number: int
    entry: int


@dataclass(frozen=True)
class _Asked:
    """All services were asked for a snapshot."""


_Item = Sample | _Answer | _Late | _Begin | _Asked | None


class Tape:
    """Subscribes to everything and writes it down on one thread of its own.

    Args:
        path: of the first part; the others are called after it, with -2, -3, ...
        patterns: of topics to record; the runtime's own topics are always recorded, for replay needs them.
        say: is given lines for people.

    Raises:
        CannotRecord: the file cannot be opened, or is there already.
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: Keys,
        path: Path,
        plan: Plan,
        patterns: Sequence[str] = (),
        split: Split | None = None,
        say: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._session = session
        self._keys = keys
        self._base = path
        self._patterns = patterns or ("*",)
        self._split = split or Split()
        self._say = say
        self._header = header.of_this_machine("live", plan.seed, plan.nodes, list(patterns))
        self._config = plan.config()
        self._clock = Clock()
        self._began = time.monotonic()
        self._queue: queue.SimpleQueue[_Item] = queue.SimpleQueue()
        self._closing = threading.Event()
        self._latched: dict[str, Sample] = {}
        self._lines = 0
        self._asking: list[threading.Thread] = []
        self._behind: dict[str, tuple[int, int]] = {}
        self._running: list[str] = []
        self.gaps = Gaps()
        self.refused: dict[str, int] = {}
        self.count = 0
        self.paths = [path]
        self.failure: PushlaneError | None = None
        self._part = Part(path, self._header, self._config)
        self._part_began = self._began
        self._old: Part | None = None
        self._until: dict[str, int] = {}
        self._overlap_ends: float | None = None
        self._beginning = True
        self._thread = threading.Thread(target=self._run, name="tape")
        self._thread.start()
        self._subscriber = session.declare_subscriber(keys.everything(), self._receive)
        self._ask(latched=True)

    @property
    def seconds(self) -> float:
        """Return how long this records, s."""
        return time.monotonic() - self._began

    def close(self) -> None:
        """Write what is on its way and end the file. Takes about half a second.

        Raises:
            CannotRecord: that was not possible.
        """
        time.sleep(_SETTLE)
        self._running = [
            str(reply.ok.key_expr).rpartition("/")[2]
            for reply in self._session.liveliness().get(self._keys.node("*"), timeout=1.0)
            if reply.ok is not None
        ]
        last = time.monotonic() + _OVERLAP_LIMIT
        for thread in self._asking:
            thread.join(max(0.0, last - time.monotonic()))
        self._closing.set()
        self._subscriber.undeclare()
        self._queue.put(None)
        self._thread.join()
        if self.failure is not None:
            raise self.failure

    def summary(self) -> Iterable[str]:
        """Return what was recorded and what was missed, in lines for people."""
        files = str(self.paths[0]) if len(self.paths) == 1 else f"{len(self.paths)} parts, {self.paths[0]} and on"
        yield f"{self.count} messages in {self.seconds:.1f} s recorded to {files}"
        for topic, missed in sorted(self.gaps.missed.items()):
            what = "journal entries" if topic.startswith("journal/") else "messages"
            yield f"missed {missed} {what} of '{topic}': log/{RECORDER} says where"
        for topic, count in sorted(self.refused.items()):
            yield f"refused {count} of '{topic}', which were no messages"

    def _receive(self, sample: zenoh.Sample) -> None:
        with suppress(envelope.BadEnvelope):  # no message of ours: a service that consumes it counts and reports it
            self._queue.put(envelope.opened(self._keys.name(str(sample.key_expr)), sample))

    def _ask(self, latched: bool) -> None:
        """Ask for what a part begins with, on a thread: answers may take long, and the messages go on."""
        thread = threading.Thread(target=self._ask_all, args=(latched,), name="tape-asks", daemon=True)
        self._asking.append(thread)
        thread.start()

    def _ask_all(self, latched: bool) -> None:
        try:
            if latched:
                self._ask_latched()
            # What was sent before the part began must have reached the queues before the question.
            self._closing.wait(_SETTLE)
            # All answer under the key that was asked, of which consolidation would keep one.
            every = zenoh.ConsolidationMode.NONE
            for reply in self._session.get(self._keys.snapshot("*"), timeout=_ANSWER_LIMIT, consolidation=every):
                if reply.ok is not None:
                    snapshot = Snapshot.FromString(bytes(reply.ok.payload))
                    self._queue.put(_Begin(snapshot.node, snapshot.number, snapshot.entry))
        except zenoh.ZError:
            pass  # the session was closed meanwhile
        finally:
            self._queue.put(_Asked())

    def _ask_latched(self) -> None:
        for topic, row in TOPICS.items():
            if not row.latched:
                continue
            for reply in self._session.get(self._keys.latched(topic), timeout=1.0):
                if reply.ok is not None and reply.ok.attachment is not None:
                    self._queue.put(_Answer(envelope.opened(topic, reply.ok)))

    def _run(self) -> None:
        try:
            self._write_all()
        except PushlaneError as error:
            self.failure = error
        for part in (self._old, self._part):
            if part is not None:
                try:
                    part.close(self._running, "")
                except PushlaneError as error:
                    self.failure = self.failure or error

    def _write_all(self) -> None:
        looked = asked = time.monotonic()
        while True:
            try:
                item = self._queue.get(timeout=_LOOK_EVERY)
            except queue.Empty:
                pass
            else:
                if item is None:
                    return
                self._take(item)
            now = time.monotonic()
            if now - looked >= _LOOK_EVERY:
                looked = now
                self._look_at_parts(now)
            if now - asked >= _OVERDUE:
                asked = now
                self._look_for_missing()

    def _take(self, item: Sample | _Answer | _Late | _Begin | _Asked) -> None:
        if isinstance(item, _Begin):
            self._part.begin(item.node, item.number)
            self._until[item.node] = item.entry
        elif isinstance(item, _Asked):
            for node in self._part.begin_all():
                self._log(f"'{node}' gave no snapshot: {self._part.path.name} may begin in the middle of its journal")
            self._beginning = False
            self._overlap_ends = time.monotonic() + _OVERLAP_LIMIT
        elif isinstance(item, _Answer):
            self._write(item.sample)
        elif isinstance(item, _Late):
            for sample in item.samples:
                if item.topic.startswith("journal/"):
                    self._read(sample)
                self._write(sample)
            self._log(f"{item.text}: {len(item.samples)} messages of these came when asked for", item.time)
        elif not self._refused(item):
            self._note_gap(item)
            self._write(item)

    def _refused(self, sample: Sample) -> bool:
        """Return whether this is no message of its topic, and count it. A number from nowhere would be a huge gap."""
        try:
            kind = message_type(sample.topic)
        except KeyError:
            return True  # a key that is no topic of ours
        try:
            parse(kind, sample.payload, sample.topic)
            reason = "" if follows(sample.sequence, self.gaps.last(sample.topic)) else "its number is from nowhere"
        except BadMessage as error:
            reason = str(error)
        if reason and not self.refused.get(sample.topic):
            self._log(f"'{sample.topic}': what is no message is not recorded, and counted: {reason}"[:300])
        if reason:
            self.refused[sample.topic] = self.refused.get(sample.topic, 0) + 1
        return bool(reason)

    def _write(self, sample: Sample) -> None:
        row = TOPICS.get(sample.topic)
        if row is not None and not any(fnmatch.fnmatch(sample.topic, pattern) for pattern in self._patterns):
            return
        if row is not None and row.latched:
            self._latched[sample.topic] = sample
        try:
            self._part.write(sample)
            if self._old is not None:
                self._old.write(sample)
        except KeyError:
            return  # a key that is no topic of ours
        self.count += 1

    def _note_gap(self, sample: Sample) -> None:
        kind = sample.topic.partition("/")[0]
        try:
            first = self._read(sample) if kind == "journal" else None
        except DecodeError:
            return
        missed = self.gaps.take(sample, first)
        if missed:
            self._log(missed, sample.time)
            self._start_asking(sample.topic, self.gaps.wanted, missed, sample.time)

    def _read(self, sample: Sample) -> int:
        """Learn from a journal what was sent. Returns the number of its first entry."""
        batch = Journal.FromString(sample.payload)
        for kind, name, sequence in zip(batch.kind, batch.name, batch.sequence, strict=False):
            if kind == EntryKind.PRODUCED and name < len(batch.names):
                self.gaps.give(batch.names[name], sequence)
        return batch.first

    def _look_for_missing(self) -> None:
        """Ask for messages that a journal names and that have not come for as long as one may be under way."""
        behind = self.gaps.behind()
        for topic, wanted in behind.items():
            if self._behind.get(topic) == wanted:
                self.gaps.pass_over(topic, wanted[1])
                self._start_asking(topic, wanted, f"missed '{topic}' {wanted[0]} to {wanted[1]}", self._clock.now())
        self._behind = behind

    def _start_asking(self, topic: str, wanted: tuple[int, int], text: str, at: int) -> None:
        thread = threading.Thread(target=self._ask_again, args=(topic, wanted, text, at), name="tape-asks", daemon=True)
        self._asking.append(thread)
        thread.start()

    def _ask_again(self, topic: str, wanted: tuple[int, int], text: str, at: int) -> None:
        """Ask for messages that did not come, on a thread of its own."""
        found: dict[int, Sample] = {}
        question = msgspec.json.encode(Missing(topic, *wanted))
        give_up = time.monotonic() + _GIVE_UP
        while time.monotonic() < give_up and not self._closing.is_set():
            try:
                for reply in self._session.get(
                    self._keys.sent("*"),
                    payload=question,
                    timeout=_ANSWER_LIMIT,
                    consolidation=zenoh.ConsolidationMode.NONE,
                ):
                    if reply.ok is not None and reply.ok.attachment is not None:
                        one = envelope.opened(topic, reply.ok)
                        found[one.sequence] = one
            except zenoh.ZError:
                break  # the session was closed meanwhile
            if found:
                break
            # Its link is back, but not yet what it answers for; or is broken again.
            self._closing.wait(_OVERDUE)
        self._queue.put(_Late(topic, text, at, list(found.values())))

    def _log(self, text: str, at: int | None = None) -> None:
        """Write a line into the recording, at the place that it speaks of."""
        self._say(text)
        self._lines += 1
        now = self._clock.now() if at is None else at
        line = Log(level=Log.WARNING, message=text, name=RECORDER)
        line.timestamp.FromNanoseconds(now)
        self._write(Sample(topics.log(RECORDER).name, self._lines, now, line.SerializeToString(deterministic=True)))

    def _look_at_parts(self, now: float) -> None:
        if self._old is not None:
            self._end_old(now)
        elif not self._beginning and self._is_full(now):
            self._begin_part(now)

    def _is_full(self, now: float) -> bool:
        if now - self._part_began >= self._split.time:
            return True
        return self._part.path.stat().st_size >= self._split.size

    def _begin_part(self, now: float) -> None:
        path = free_name(self._base, 2)
        part = Part(path, self._header, self._config)
        self.paths.append(path)
        self._old, self._part, self._part_began = self._part, part, now
        self._until, self._overlap_ends, self._beginning = {}, None, True
        for sample in self._latched.values():
            part.write(sample)
        self._ask(latched=False)

    def _end_old(self, now: float) -> None:
        """End the old part once it holds all that comes before the snapshots of the new one."""
        old = self._old
        if old is None or self._overlap_ends is None:
            return
        missing = [node for node, entry in self._until.items() if old.journals.get(node, -1) < entry]
        if missing and now < self._overlap_ends:
            return
        old.close(list(old.journals), self._part.path.name)
        self._old = None
        self._say(f"{old.path} is complete; {self._part.path} goes on")
