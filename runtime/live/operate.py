"""What an operator does with a running system: ask for a push, follow it, cancel it."""

from __future__ import annotations

import threading
from collections.abc import Callable

import zenoh
from google.protobuf.message import Message

from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import client
from runtime.errors import PushlaneError
from runtime.messages import CancelRequest, PushGoal, PushOutcome, PushPhase, PushStatus, Reply

_ANSWER_LIMIT = 3.0
_SILENCE_LIMIT = 10.0
_LINE_EVERY = 5.0


class Refused(PushlaneError):
    """The service did not take the request; the message is its reason."""


class NoAnswer(PushlaneError):
    """No service answers the request: the system does not run, or not that part of it."""


def ask(bus: BusConfig, name: str, message: Message) -> None:
    """Ask the request `name`.

    Raises:
        NoBus, NoAnswer, Refused: see there.
    """
    with client(bus) as session:
        _ask(session, Keys(bus.robot), name, message)


def follow_push(bus: BusConfig, goal: PushGoal, say: Callable[[str], None], live: bool = False) -> bool:
    """Ask for a push and follow it to its end. Returns whether the object was delivered.

    Ctrl-C cancels the push.

    Raises:
        NoBus, NoAnswer, Refused: see there.
    """
    keys = Keys(bus.robot)
    news: list[PushStatus] = []
    changed = threading.Event()

    def hear(sample: zenoh.Sample) -> None:
        news.append(PushStatus.FromString(bytes(sample.payload)))
        changed.set()

    with client(bus) as session:
        subscriber = session.declare_subscriber(keys.topic("push/status"), hear)
        try:
            _ask(session, keys, "push/goal", goal)
            status = _follow(news, changed, say, 0.5 if live else _LINE_EVERY)
        except KeyboardInterrupt:
            _ask(session, keys, "push/cancel", CancelRequest(reason="cancelled by the operator"))
            say("cancelled")
            return False
        finally:
            subscriber.undeclare()
    reason = f" ({status.reason})" if status.reason else ""
    say(
        f"{PushOutcome.Name(status.outcome)}{reason}: {status.distance_left:.3f} m left after {status.elapsed:.1f} s, "
        f"robot path {status.robot_path_length:.2f} m, object path {status.object_path_length:.2f} m"
    )
    return status.outcome == PushOutcome.DELIVERED


def _follow(news: list[PushStatus], changed: threading.Event, say: Callable[[str], None], every: float) -> PushStatus:
    said = -every
    while True:
        if not changed.wait(_SILENCE_LIMIT):
            say(f"no news for {_SILENCE_LIMIT:g} s; still waiting")
            continue
        changed.clear()
        status = news[-1]
        if status.phase == PushPhase.ENDED:
            return status
        if status.elapsed - said >= every:
            said = status.elapsed
            phase = PushPhase.Name(status.phase).lower()
            say(f"{status.elapsed:7.1f} s  {phase:<8}  {status.distance_left:5.2f} m left")


def _ask(session: zenoh.Session, keys: Keys, name: str, message: Message) -> None:
    payload = message.SerializeToString(deterministic=True)
    for answer in session.get(keys.request(name), payload=payload, timeout=_ANSWER_LIMIT):
        if answer.ok is None:
            continue
        reply = Reply.FromString(bytes(answer.ok.payload))
        if not reply.accepted:
            raise Refused(f"'{name}' was refused: {reply.reason}")
        return
    raise NoAnswer(f"no service answered '{name}' within {_ANSWER_LIMIT:g} s: is the system running?")
