"""What an operator does with a running system: ask for a push, follow it, cancel it, let it record itself."""

from __future__ import annotations

import math
import queue
from collections.abc import Callable

import zenoh
from google.protobuf.message import Message

from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import client
from runtime.errors import PushlaneError
from runtime.messages import (
    CancelRequest,
    PushGoal,
    PushOutcome,
    PushPhase,
    PushStatus,
    RecordingQuery,
    RecordingStatus,
    Reply,
    Snapshot,
)

_ANSWER_LIMIT = 3.0
_SILENCE_LIMIT = 10.0
_SILENCES = 3
_LINE_EVERY = 5.0


class Refused(PushlaneError):
    """The service did not take the request; the message is its reason."""


class PushLost(PushlaneError):
    """Nobody says any more how the push goes on."""


class NoAnswer(PushlaneError):
    """No service answers the request: the system does not run, or not that part of it."""


def ask(bus: BusConfig, name: str, message: Message) -> None:
    """Ask the request `name`.

    Raises:
        NoBus, NoAnswer, Refused: see there.
    """
    with client(bus) as session:
        _ask(session, Keys(bus.robot), name, message)


def recording_status(bus: BusConfig) -> RecordingStatus:
    """Return what the recorder of the system does.

    Raises:
        NoBus, NoAnswer: see there.
    """
    with client(bus) as session:
        return RecordingStatus.FromString(_answer(session, Keys(bus.robot), "recording/status", RecordingQuery()))


def ask_for_snapshots(bus: BusConfig, node: str = "*") -> list[Snapshot]:
    """Let `node`, or all, give and publish a snapshot. Returns them, by name.

    Raises:
        NoBus, NoAnswer: see there.
    """
    with client(bus) as session:
        # All answer under the key that was asked, of which consolidation would keep one.
        every = zenoh.ConsolidationMode.NONE
        answers = session.get(Keys(bus.robot).snapshot(node), timeout=_ANSWER_LIMIT, consolidation=every)
        found = [Snapshot.FromString(bytes(answer.ok.payload)) for answer in answers if answer.ok is not None]
    if not found:
        who = "no service" if node == "*" else f"no service '{node}'"
        raise NoAnswer(f"{who} gave a snapshot within {_ANSWER_LIMIT:g} s: is the system running?")
    return sorted(found, key=lambda one: one.node)


def follow_push(
    bus: BusConfig,
    goal: PushGoal,
    say: Callable[[str], None],
    show: Callable[[PushStatus, float], None] | None = None,
) -> bool:
    """Ask for a push and follow it to its end. Returns whether the object was delivered.

    Ctrl-C cancels the push.

    Args:
        say: is given lines for people; on the way only where there is no `show`.
        show: is given every status, and the m that were left at the beginning.

    Raises:
        NoBus, NoAnswer, Refused: see there.
        PushLost: the system went away, or forgot the push.
    """
    keys = Keys(bus.robot)
    news: queue.SimpleQueue[PushStatus] = queue.SimpleQueue()

    with client(bus) as session:
        before = _last_goal(session, keys)
        subscriber = session.declare_subscriber(
            keys.topic("push/status"), lambda sample: news.put(PushStatus.FromString(bytes(sample.payload)))
        )
        try:
            _ask(session, keys, "push/goal", goal)
            status = _follow(_News(session, keys, news, before, say), say, show)
        except KeyboardInterrupt:
            _ask(session, keys, "push/cancel", CancelRequest(reason="cancelled by the operator"))
            say("cancelled")
            return False
        finally:
            subscriber.undeclare()
    reason = f" ({status.reason})" if status.reason else ""
    turned = f" and {math.degrees(status.yaw_left):.0f} degrees to turn" if status.HasField("yaw_left") else ""
    say(
        f"{PushOutcome.Name(status.outcome)}{reason}: {_left(status, 3)}{turned} "
        f"after {status.elapsed:.1f} s, "
        f"robot path {status.robot_path_length:.2f} m, object path {status.object_path_length:.2f} m"
    )
    return status.outcome == PushOutcome.DELIVERED


def _last_goal(session: zenoh.Session, keys: Keys) -> int:
    """Return the id of the goal before ours: its last status is told again and again."""
    for answer in session.get(keys.latched("push/status"), timeout=1.0):
        if answer.ok is not None:
            return PushStatus.FromString(bytes(answer.ok.payload)).goal_id
    return 0


class _News:
    """Gives what is said of our push, and of no other.

    Args:
        before: id of the goal before ours.
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: Keys,
        heard: queue.SimpleQueue[PushStatus],
        before: int,
        say: Callable[[str], None],
    ) -> None:
        self._session = session
        self._keys = keys
        self._heard = heard
        self._before = before
        self._own = 0
        self._say = say

    def next(self) -> PushStatus:
        """Wait for the next status.

        Raises:
            PushLost: there is none to come.
        """
        silent = 0
        while True:
            try:
                status = self._heard.get(timeout=_SILENCE_LIMIT)
            except queue.Empty:
                silent += 1
                self._say(f"no news for {silent * _SILENCE_LIMIT:g} s; still waiting")
                if silent >= _SILENCES and not self._alive():
                    raise PushLost("the task service is gone: nobody knows how the push went on") from None
                continue
            if self._own and status.goal_id != self._own:
                raise PushLost(f"the system no longer speaks of goal {self._own}, but of {status.goal_id or 'none'}")
            if status.goal_id > self._before:
                self._own = status.goal_id
                return status

    def _alive(self) -> bool:
        answers = self._session.liveliness().get(self._keys.node("task"), timeout=1.0)
        return any(answer.ok is not None for answer in answers)


def _follow(news: _News, say: Callable[[str], None], show: Callable[[PushStatus, float], None] | None) -> PushStatus:
    said, start = -_LINE_EVERY, 0.0
    while True:
        status = news.next()
        start = max(start, status.distance_left)
        if show is not None:
            show(status, start)
        if status.phase == PushPhase.ENDED:
            return status
        if show is None and status.elapsed - said >= _LINE_EVERY:
            said = status.elapsed
            phase = PushPhase.Name(status.phase).lower()
            say(f"{status.elapsed:7.1f} s  {phase:<8}  {_left(status, 2)}")


def _left(status: PushStatus, digits: int) -> str:
    """Return in words how far the object is from its goal. An object that nobody has seen yet is at no distance."""
    return f"{status.distance_left:.{digits}f} m left" if status.distance_left else "object not seen yet"


def _ask(session: zenoh.Session, keys: Keys, name: str, message: Message) -> None:
    reply = Reply.FromString(_answer(session, keys, name, message))
    if not reply.accepted:
        raise Refused(f"'{name}' was refused: {reply.reason}")


def _answer(session: zenoh.Session, keys: Keys, name: str, message: Message) -> bytes:
    payload = message.SerializeToString(deterministic=True)
    for answer in session.get(keys.request(name), payload=payload, timeout=_ANSWER_LIMIT):
        if answer.ok is not None:
            return bytes(answer.ok.payload)
    raise NoAnswer(f"no service answered '{name}' within {_ANSWER_LIMIT:g} s: is the system running?")
