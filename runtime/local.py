"""`local` mode: one push, all services in this process, in virtual time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from runtime import topics
from runtime.errors import PushlaneError
from runtime.guard import Guard
from runtime.messages import PushGoal, PushPhase, PushStatus, Reply
from runtime.node import Node
from runtime.sample import Sample
from runtime.scheduler import Scheduler, Sink, Timing
from runtime.service import Service
from runtime.steppable import Steppable
from runtime.time import MILLISECOND, SECOND, Time, nanoseconds

GOAL_TIME: Time = 200 * MILLISECOND
"""When the goal is asked for: by then every input has been published once."""

_SLICE: Time = 500 * MILLISECOND
_EPILOGUE: Time = 500 * MILLISECOND
_GRACE: Time = 30 * SECOND


class GoalRefused(PushlaneError):
    """The task service did not take the goal."""


class Interrupted(PushlaneError):
    """Whoever watches the run wants it to end. Raised between events, so that the recording ends in good order."""

    exit_code = 130


@dataclass
class PushResult:
    """What came of a push.

    Attributes:
        status: the last one published; its phase is ENDED unless the run was cut short.
        end: logical time at which the run ended, ns.
        counts: topic -> messages published.
    """

    status: PushStatus
    end: Time
    counts: dict[str, int] = field(default_factory=dict)


def push(
    services: Sequence[Service],
    goal: PushGoal,
    sinks: Sequence[Sink] = (),
    timing: Timing | None = None,
    watch: Callable[[Time, PushStatus], None] | None = None,
    guarded: bool = True,
) -> PushResult:
    """Run `services` until the push to `goal` has ended.

    Args:
        services: freshly built, drivers first; the order breaks ties.
        goal: as for the request push/goal.
        sinks: each is given every sample.
        watch: called about twice a simulated second with the time and the newest status; may raise Interrupted.
        guarded: block clocks and randomness in handlers; off only to time the guard itself.

    Raises:
        GoalRefused: the task service refused, with its reason.
    """
    if not guarded:
        return push_nodes([Node(service, None) for service in services], goal, sinks, timing, watch)
    with Guard() as guard:
        return push_nodes([Node(service, guard) for service in services], goal, sinks, timing, watch)


def push_nodes(
    nodes: Sequence[Steppable],
    goal: PushGoal,
    sinks: Sequence[Sink] = (),
    timing: Timing | None = None,
    watch: Callable[[Time, PushStatus], None] | None = None,
) -> PushResult:
    """Run `nodes`, here or in other processes, until the push to `goal` has ended; otherwise as `push`."""
    return _Run(tuple(sinks)).go(nodes, goal, timing, watch)


class _Run:
    """Watches the stream for the end of the push."""

    def __init__(self, sinks: tuple[Sink, ...]) -> None:
        self._sinks = sinks
        self._counts: dict[str, int] = {}
        self._status = PushStatus()
        self._ended: Time | None = None
        self._refusal: str | None = None

    def go(
        self,
        nodes: Sequence[Steppable],
        goal: PushGoal,
        timing: Timing | None,
        watch: Callable[[Time, PushStatus], None] | None,
    ) -> PushResult:
        scheduler = Scheduler(nodes, self._take, timing)
        scheduler.request("push/goal", goal, at=GOAL_TIME)
        limit = GOAL_TIME + nanoseconds(goal.time_limit or 400.0) + _GRACE
        while scheduler.now < limit and self._ended is None and self._refusal is None:
            scheduler.run(scheduler.now + _SLICE)
            if watch is not None:
                try:
                    watch(scheduler.now, self._status)
                except Interrupted:
                    scheduler.finish()
                    raise
        if self._ended is not None:
            scheduler.run(max(scheduler.now, self._ended + _EPILOGUE))
        scheduler.finish()
        if self._refusal is not None:
            raise GoalRefused(f"the goal was refused: {self._refusal}")
        return PushResult(self._status, scheduler.now, self._counts)

    def _take(self, sample: Sample) -> None:
        self._counts[sample.topic] = self._counts.get(sample.topic, 0) + 1
        for sink in self._sinks:
            sink(sample)
        if sample.topic == topics.PUSH_STATUS.name:
            self._status = PushStatus.FromString(sample.payload)
            if self._status.phase == PushPhase.ENDED and self._ended is None:
                self._ended = sample.time
        elif sample.topic.startswith("reply/"):
            reply = Reply.FromString(sample.payload)
            if not reply.accepted:
                self._refusal = reply.reason
