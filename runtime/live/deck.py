"""The recorder of a system: records when asked to, and answers what it does.

Requests and replies go over the bus like those of services, and so into the recording that runs.
"""

from __future__ import annotations

import queue
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import msgspec
import zenoh
from google.protobuf.message import Message

from runtime import topics
from runtime.bus import envelope
from runtime.bus.keys import Keys
from runtime.errors import PushlaneError
from runtime.live.beat import beat
from runtime.live.clock import Clock
from runtime.live.config import LiveConfig
from runtime.live.part import free_name
from runtime.live.plan import Plan
from runtime.live.split import Split
from runtime.live.tape import RECORDER, Tape
from runtime.messages import RecordingQuery, RecordingStart, RecordingStatus, RecordingStop, Reply, Request
from runtime.sample import INCARNATION, Sample, parse
from runtime.time import Time

START, STOP, STATUS = "recording/start", "recording/stop", "recording/status"

_KINDS: dict[str, type[Message]] = {START: RecordingStart, STOP: RecordingStop, STATUS: RecordingQuery}
_LOOK_EVERY = 0.1


class Refused(PushlaneError):
    """A request cannot be granted; the message is its reason."""


class _Order(msgspec.Struct, frozen=True):
    """What is being recorded, as it is kept for a recorder that takes over from one that died."""

    path: str
    topics: list[str]
    split: str


class Deck:
    """Records to the folder of `[live] recordings`.

    Args:
        state: file that says what is being recorded; there while something is.
        incarnation: how often the recorder was restarted in this session.
    """

    def __init__(self, session: zenoh.Session, keys: Keys, plan: Plan, state: Path, incarnation: int) -> None:
        self._session = session
        self._keys = keys
        self._plan = plan
        self._live = msgspec.convert(plan.sections.get("live", {}), LiveConfig)
        self._state = state
        self._clock = Clock()
        self._requests = incarnation * INCARNATION
        self._replies = incarnation * INCARNATION
        self._asked: queue.SimpleQueue[tuple[str, zenoh.Query]] = queue.SimpleQueue()
        self._tape: Tape | None = None
        self._closer: threading.Thread | None = None
        self._last = RecordingStatus()

    def run(self, stop: threading.Event, file: Path | None) -> None:
        """Answer until `stop`, then end the recording.

        Args:
            file: record here from the start, unless a recorder before this one was told otherwise.

        Raises:
            CannotRecord: `file` cannot be opened.
        """
        declared = [self._session.declare_queryable(self._keys.request(name), self._asker(name)) for name in _KINDS]
        token = self._session.liveliness().declare_token(self._keys.node(RECORDER))
        try:
            self._take_over(file)
            while not stop.is_set() and beat():
                self._look()
                try:
                    asked = self._asked.get(timeout=_LOOK_EVERY)
                except queue.Empty:
                    continue
                self._answer(*asked)
        finally:
            for one in declared:
                one.undeclare()
            self._end()
            if self._closer is not None:
                self._closer.join()
            token.undeclare()

    def _take_over(self, file: Path | None) -> None:
        if self._state.exists():
            order = msgspec.json.decode(self._state.read_bytes(), type=_Order)
            path = free_name(Path(order.path), 1)
            self._start(_Order(str(path), order.topics, order.split))
        elif file is not None:
            self._start(_Order(str(file), [], self._live.split))

    def _start(self, order: _Order) -> None:
        self._tape = Tape(
            self._session, self._keys, Path(order.path), self._plan, order.topics, Split.parse(order.split), _say
        )
        self._state.write_bytes(msgspec.json.encode(order))

    def _look(self) -> None:
        """End a recording that broke off: the system goes on without."""
        if self._tape is not None and self._tape.failure is not None:
            _say(f"recording ended: {self._tape.failure}")
            self._end()

    def _end(self) -> None:
        """End the recording, on a thread: this loop must go on to show that it lives."""
        tape, self._tape = self._tape, None
        if tape is None:
            return
        self._state.unlink(missing_ok=True)
        self._last = _status(tape, recording=True)  # until its file is whole
        self._closer = threading.Thread(target=self._close, args=(tape,), name="deck-closes")
        self._closer.start()

    def _close(self, tape: Tape) -> None:
        try:
            tape.close()
        except PushlaneError as error:
            self._last = _status(tape, failure=str(error))
        else:
            self._last = _status(tape)
        for line in tape.summary():
            _say(line)

    def _asker(self, name: str) -> Callable[[zenoh.Query], None]:
        return lambda query: self._asked.put((name, query))

    def _answer(self, name: str, query: zenoh.Query) -> None:
        payload = b"" if query.payload is None else bytes(query.payload)
        if name == STATUS:
            query.reply(str(query.key_expr), self._status().SerializeToString(deterministic=True))
            query.drop()
            return
        self._requests += 1
        request = Request(id=self._requests, name=name, type=_KINDS[name].DESCRIPTOR.full_name, payload=payload)
        reply = Reply(id=request.id, name=name, accepted=True)
        now = self._clock.now()
        try:
            message = parse(_KINDS[name], payload, name)
            if isinstance(message, RecordingStart):
                self._start(self._order(message))
            elif self._tape is None:
                raise Refused("nothing is being recorded")
        except PushlaneError as error:
            reply.accepted, reply.reason = False, str(error)
        # Before a recording ends, so that it holds the request that ended it.
        self._publish(topics.request(RECORDER).name, request.id, now, request)
        self._replies += 1
        self._publish(topics.reply(RECORDER).name, self._replies, self._clock.now(), reply)
        query.reply(str(query.key_expr), reply.SerializeToString(deterministic=True))
        query.drop()
        if name == STOP and reply.accepted:
            self._end()

    def _order(self, wanted: RecordingStart) -> _Order:
        if self._tape is not None:
            raise Refused(f"{self._tape.paths[-1]} is being recorded already")
        if self._closer is not None and self._closer.is_alive():
            raise Refused("the recording before is still being ended")
        name = wanted.name or default_name(self._plan.robot)
        if Path(name).name != name or name in {".", ".."}:
            raise Refused(f"'{name}' is no plain file name: recordings go to the folder that [live] recordings names")
        path = Path(self._live.recordings) / (name if name.endswith(".mcap") else f"{name}.mcap")
        if path.exists():
            raise Refused(f"{path} is there already: choose another name")
        Split.parse(wanted.split)
        return _Order(str(path), list(wanted.topics), wanted.split or self._live.split)

    def _status(self) -> RecordingStatus:
        return self._last if self._tape is None else _status(self._tape, recording=True)

    def _publish(self, topic: str, sequence: int, now: Time, message: Message) -> None:
        sample = Sample(topic, sequence, now, message.SerializeToString(deterministic=True))
        self._session.put(
            self._keys.topic(topic), sample.payload, attachment=envelope.pack(sample.sequence, sample.time)
        )


def default_name(robot: str) -> str:
    """Return a file name made of robot, date and time."""
    return f"{robot}-{time.strftime('%Y%m%d-%H%M%S')}.mcap"


def _status(tape: Tape, recording: bool = False, failure: str = "") -> RecordingStatus:
    return RecordingStatus(
        recording=recording,
        file=str(tape.paths[-1]),
        parts=len(tape.paths),
        messages=tape.count,
        seconds=tape.seconds,
        missed=tape.gaps.total,
        failure=failure,
    )


def _say(text: str) -> None:
    print(f"{RECORDER}: {text}", file=sys.stderr, flush=True)
