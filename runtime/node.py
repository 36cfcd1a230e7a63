"""A node hosts one service: it decodes events, runs handlers under guard, numbers and journals what comes out.

Whoever schedules (the virtual-time scheduler, a replay, later a live loop) decides which event comes next and
when; a node never does. The same node therefore behaves the same in every mode.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from typing import Any

from google.protobuf.message import Message

from runtime import state, topics
from runtime.errors import PushlaneError
from runtime.finite import nonfinite, surely_finite
from runtime.guard import Guard
from runtime.journal import JournalWriter
from runtime.messages import EntryKind, Reply, Request, Snapshot
from runtime.sample import INCARNATION, BadMessage, Sample, parse
from runtime.service import Answer, Publication, Service
from runtime.time import Time, nanoseconds

_Out = tuple[str, bytes]  # topic, payload

# Looked up once: protobuf's enum wrappers find their values by a Python call.
_STARTED, _MESSAGE, _TIMER = EntryKind.STARTED, EntryKind.MESSAGE, EntryKind.TIMER
_REQUEST, _PRODUCED, _REPLIED = EntryKind.REQUEST, EntryKind.PRODUCED, EntryKind.REPLIED
_SNAPSHOT, _FINISHED = EntryKind.SNAPSHOT, EntryKind.FINISHED


class BadHandler(PushlaneError):
    """A service broke its contract while running: this is a mistake in the service."""

    exit_code = 1


@dataclass
class HostState:
    """What a node keeps beside its service's state."""

    start: Time = 0
    produced: dict[str, int] = field(default_factory=dict)  # topic -> last sequence
    consumed: dict[str, int] = field(default_factory=dict)  # topic -> last sequence
    fired: dict[str, int] = field(default_factory=dict)  # timer -> number of the last firing
    latest: dict[str, bytes] = field(default_factory=dict)  # topic -> newest payload consumed
    snapshots: int = 0


class Node:
    """Runs one service, event by event.

    Args:
        service: just built.
        guard: an open guard; None runs handlers unguarded (timing comparisons only).
    """

    def __init__(self, service: Service, guard: Guard | None) -> None:
        self.service = service
        self.name = service.name
        self.contract = service.contract
        self.host = HostState()
        self.journal = JournalWriter(self.name)
        self._guard = guard
        self._handlers: dict[str, Callable[..., Any]] = {
            source: getattr(service, method) for source, method in self.contract.handlers.items()
        }
        self._log = topics.log(self.name).name
        self._types = {name: output.topic.message for name, output in self.contract.outputs.items()}
        self._types[self._log] = topics.log(self.name).message
        self._kinds = {name: source.topic.message for name, source in self.contract.inputs.items()}
        self._periods = {
            name: nanoseconds(timer.seconds(service.config)) for name, timer in self.contract.timers.items()
        }
        short = [name for name, period in self._periods.items() if period <= 0]
        if short:
            raise BadHandler(f"service '{self.name}': the period of timer '{short[0]}' is not above 0")

    @property
    def start(self) -> Time:
        """Return when the service's life began, ns: timers count from there."""
        return self.host.start

    def begin(self, now: Time, incarnation: int = 0, last: Snapshot | None = None) -> list[Sample]:
        """Start the service's life at `now`. Returns its first snapshot.

        Args:
            incarnation: 0 for the first process of this service in a session, one more after each restart. Its
                numbers begin at `incarnation * INCARNATION`, so that no name is given twice.
            last: a snapshot of an earlier incarnation to go on from.

        Raises:
            BadSnapshot: `last` does not fit this service.
        """
        if last is not None:
            self._take_up(last)
        first = incarnation * INCARNATION
        self.host = HostState(start=now, latest=self.host.latest, consumed=self.host.consumed, snapshots=first)
        self.host.produced = dict.fromkeys((*self.contract.outputs, self._log, "reply"), first) if first else {}
        self.journal = JournalWriter(self.name, first=first)
        self.journal.add(_STARTED, "", incarnation, now)
        return [self.take_snapshot(now)]

    def resume(self, snapshot: Snapshot) -> None:
        """Go on from `snapshot` as if the service had never stopped.

        Raises:
            BadSnapshot: its bytes do not fit this service.
        """
        self._take_up(snapshot)
        self.journal = JournalWriter(self.name, first=snapshot.entry + 1, digest=snapshot.digest)

    def due(self) -> list[tuple[Time, str]]:
        """Return when each timer fires next: (due, timer)."""
        return [(self._due(name), name) for name in self._periods]

    def period(self, timer: str) -> Time:
        """Return the period of `timer` in ns."""
        return self._periods[timer]

    def parsed(self, sample: Sample) -> Message:
        """Return the message of one of the inputs that `sample` holds.

        Raises:
            BadMessage: it does not parse, or holds a number that is not finite.
        """
        return parse(self._kinds[sample.topic], sample.payload, sample.topic)

    def consume(self, sample: Sample, now: Time, finish: Time, message: Message | None = None) -> list[Sample]:
        """Give the service a message of one of its inputs at `now`; what it publishes is stamped `finish`.

        Args:
            message: what `parsed` gave for it, if that was asked already.

        Raises:
            BadMessage: the payload does not parse.
            BadHandler: the service broke its contract.
        """
        if message is None:
            message = self.parsed(sample)
        self.journal.add(_MESSAGE, sample.topic, sample.sequence, now, sample.payload)
        self.host.consumed[sample.topic] = sample.sequence
        self.host.latest[sample.topic] = sample.payload
        self.service.latest[sample.topic] = message
        handler = self._handlers.get(sample.topic)
        if handler is None:
            return []
        return self._publish(self._run(sample.topic, handler, message, now)[0], finish)

    def fire(self, timer: str, number: int, now: Time, finish: Time) -> list[Sample]:
        """Give the service firing `number` of `timer` at `now`. Firings that came too late may be left out."""
        self.host.fired[timer] = number
        self.journal.add(_TIMER, timer, number, now)
        return self._publish(self._run(timer, self._handlers[timer], now)[0], finish)

    def ask(self, request: Request, now: Time, finish: Time) -> list[Sample]:
        """Ask the service; its reply is the sample on the node's reply topic.

        Raises:
            BadMessage: the payload does not parse as the request's type.
        """
        source = self.contract.requests[request.name]
        message = parse(source.message, request.payload, request.name)
        self.journal.add(_REQUEST, request.name, request.id, now, request.payload)
        outs, answers = self._run(request.name, self._handlers[request.name], message, now)
        if len(answers) != 1:
            raise BadHandler(f"service '{self.name}' gave {len(answers)} answers to '{request.name}', not one")
        answer = answers[0]
        samples = self._publish(outs, finish)
        reply = Reply(id=request.id, name=request.name, accepted=answer.accepted, reason=answer.reason)
        payload = reply.SerializeToString(deterministic=True)
        self.journal.add(_REPLIED, request.name, request.id, finish, payload)
        return [*samples, Sample(topics.reply(self.name).name, self._number("reply"), finish, payload)]

    def take_snapshot(self, now: Time) -> Sample:
        """Return the node's whole state, and go on from it.

        Taking a snapshot is an event of the service's life like any other. The service takes up what it gave, so
        that one that goes on and one that is restored cannot differ in what a snapshot does not keep: a 0 where
        a 0.0 is declared, two names for one array, the order of a dict.
        """
        self.host.snapshots += 1
        service = self._frozen()
        snapshot = Snapshot(
            node=self.name,
            number=self.host.snapshots,
            time=now,
            entry=self.journal.number,
            service=service,
            host=state.encode(self.host),
        )
        self._restore(snapshot.service, snapshot.host)
        self.journal.add(_SNAPSHOT, "", snapshot.number, now, snapshot.service + snapshot.host)
        snapshot.digest = self.journal.digest
        payload = snapshot.SerializeToString(deterministic=True)
        return Sample(topics.snapshot(self.name).name, snapshot.number, now, payload)

    def end(self, now: Time) -> list[Sample]:
        """End the service's life in good order. Returns its last words and the last journal batch."""
        words = self.finish(now, now)
        batch = self.flush(now)
        return words if batch is None else [*words, batch]

    def finish(self, now: Time, finish: Time) -> list[Sample]:
        """Let the service say its last words at `now`, stamped `finish`."""
        self.journal.add(_FINISHED, "", 0, now)
        return self._publish(self._run("finish", self.service.finish, now)[0], finish)

    def flush(self, now: Time) -> Sample | None:
        """Return the journal entries since the last flush as a sample, or None if there are none."""
        batch = self.journal.batch()
        if batch is None:
            return None
        payload = batch.SerializeToString(deterministic=True)
        # The number of the batch's last entry grows from batch to batch, so it serves as sequence.
        return Sample(topics.journal(self.name).name, self.journal.number, now, payload)

    def _due(self, timer: str) -> Time:
        return self.host.start + (self.host.fired.get(timer, 0) + 1) * self._periods[timer]

    def _run(self, source: str, handler: Callable[..., Any], *args: object) -> tuple[list[_Out], list[Answer]]:
        """Run one handler. Messages are encoded as they are yielded: a handler may change its own afterwards."""
        guard = self._guard
        if guard is None:
            return self._collect(source, handler(*args))
        guard.enter(self.name, self.contract.handlers.get(source, source))
        try:
            return self._collect(source, handler(*args))
        finally:
            guard.leave()

    def _collect(self, source: str, effects: object) -> tuple[list[_Out], list[Answer]]:
        if effects is None:
            return [], []
        outs: list[_Out] = []
        answers: list[Answer] = []
        if not isinstance(effects, Iterable) or isinstance(effects, Publication | Answer | Message | str | bytes):
            raise BadHandler(
                f"service '{self.name}' returned {effects!r:.200} from the handler of '{source}': yield it"
            )
        for effect in effects:
            if isinstance(effect, Publication):
                outs.append(self._encode(effect, source))
            elif isinstance(effect, Answer) and source in self.contract.requests:
                answers.append(effect)
            else:
                raise BadHandler(f"service '{self.name}' yielded {effect!r:.200} in the handler of '{source}'")
        return outs, answers

    def _encode(self, effect: Publication, source: str) -> _Out:
        topic = effect.topic
        if topic not in self.contract.outputs and topic != self._log:
            raise BadHandler(f"service '{self.name}' published '{topic}', which it does not declare")
        if not isinstance(effect.message, self._types[topic]):
            kind = type(effect.message).__name__
            expected = self._types[topic].__name__
            raise BadHandler(f"service '{self.name}' published as '{topic}' a {kind}, expected {expected}")
        payload = effect.message.SerializeToString(deterministic=True)
        if not surely_finite(payload):
            bad = nonfinite(effect.message)
            if bad is not None:
                raise BadHandler(
                    f"service '{self.name}' published '{topic}' with {bad} not finite in the handler of '{source}'"
                )
        return topic, payload

    def _publish(self, outs: list[_Out], finish: Time) -> list[Sample]:
        samples = []
        for topic, payload in outs:
            sequence = self._number(topic)
            self.journal.add(_PRODUCED, topic, sequence, finish, payload)
            samples.append(Sample(topic, sequence, finish, payload))
        return samples

    def _frozen(self) -> bytes:
        with self._guarded("snapshot"):
            return self.service.snapshot()

    def _take_up(self, snapshot: Snapshot) -> None:
        if snapshot.node != self.name:
            raise state.BadSnapshot(f"a snapshot of '{snapshot.node}' is none of '{self.name}'")
        self._restore(snapshot.service, snapshot.host)

    def _restore(self, service: bytes, host: bytes) -> None:
        self.host = state.decode(HostState, host)
        latest = {}
        for topic, payload in self.host.latest.items():
            if topic not in self._kinds:
                raise state.BadSnapshot(f"snapshot of '{self.name}' has an input '{topic}' that it does not know")
            try:
                latest[topic] = parse(self._kinds[topic], payload, topic)
            except BadMessage as error:
                raise state.BadSnapshot(f"snapshot of '{self.name}': {error}") from error
        with self._guarded("restore"):
            self.service.restore(service, latest)

    def _guarded(self, what: str) -> AbstractContextManager[None]:
        return nullcontext() if self._guard is None else self._guard.strictly(self.name, what)

    def _number(self, topic: str) -> int:
        number = self.host.produced[topic] = self.host.produced.get(topic, 0) + 1
        return number
