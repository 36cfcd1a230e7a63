"""The deterministic virtual-time scheduler of `local` mode: all nodes in one process, as fast as it goes.

Order of events. Events are handled by time; at one time first messages and requests in the order in which they
were sent, then timers in the order of the nodes, then snapshots. A message reaches a node its link's latency after
it was published. A handler takes its node's duration of logical time: the node hears nothing meanwhile, and what
the handler publishes goes out at its end. With the same nodes, links, seed and requests the order is always the
same.
"""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from runtime import topics
from runtime.errors import PushlaneError
from runtime.messages import Request
from runtime.sample import Sample
from runtime.steppable import Steppable
from runtime.time import MILLISECOND, SECOND, Time
from runtime.topics import TOPICS, Delivery

Sink = Callable[[Sample], None]

_Work = Callable[[Steppable, Time, Time], list[Sample]]

_SEND, _MESSAGE, _TIMER, _SNAPSHOT, _FLUSH = range(5)
_WAKE = _MESSAGE


class BadSystem(PushlaneError):
    """The services do not make a system: a topic with two publishers, an unknown node, and the like."""


@dataclass(frozen=True)
class Timing:
    """How slow links and services are, in logical time.

    Attributes:
        latency: ns from publication to arrival, by (topic, node) or by (topic, "*").
        duration: ns that every handler of a node takes, by node.
        snapshot_period: ns between the snapshots of each node.
        journal_period: ns between the journal batches of each node.
    """

    latency: Mapping[tuple[str, str], Time] = field(default_factory=dict)
    duration: Mapping[str, Time] = field(default_factory=dict)
    snapshot_period: Time = 5 * SECOND
    journal_period: Time = 100 * MILLISECOND

    def link(self, topic: str, node: str) -> Time:
        """Return the latency from the publisher of `topic` to `node`."""
        return self.latency.get((topic, node), self.latency.get((topic, "*"), 0))


@dataclass
class _Seat:
    """A node's place in the scheduler."""

    node: Steppable
    index: int
    duration: Time
    inbox: deque[tuple[_Work, str | None]] = field(default_factory=deque)
    free_at: Time = 0
    dropped: int = 0
    waking: bool = False


class Scheduler:
    """Runs nodes in virtual time.

    Args:
        nodes: in the order that breaks ties between their timers; drivers first.
        sink: is given every sample, journals and snapshots included, in the order of sending.
        timing: latencies and durations.
        start: logical time at which all nodes start, ns.

    Raises:
        BadSystem: two nodes share a name or an output, or a node takes what is for scoring only.
    """

    def __init__(self, nodes: Iterable[Steppable], sink: Sink, timing: Timing | None = None, start: Time = 0) -> None:
        self.now = start
        self._timing = timing or Timing()
        self._sink = sink
        self._seats: dict[str, _Seat] = {}
        for index, node in enumerate(nodes):
            if node.name in self._seats:
                raise BadSystem(f"two services are called '{node.name}'")
            self._seats[node.name] = _Seat(node, index, self._timing.duration.get(node.name, 0))
        self._check_timing()
        self._queue: list[tuple[Time, int, int, int, Callable[[], None]]] = []
        self._count = 0
        self._requests = 0
        self._listeners = self._connect()
        self._stopped = False
        self._unsent: dict[int, list[Sample]] = {}
        for seat in self._seats.values():
            seat.free_at = start
            for sample in seat.node.begin(start):
                self._sink(sample)
        for seat in self._seats.values():
            self._arm_all(seat)
        self._at(start + self._timing.snapshot_period, _SNAPSHOT, 0, self._snapshot_all)
        self._at(start + self._timing.journal_period, _FLUSH, 0, self._flush_all)

    def request(self, name: str, message: object, at: Time | None = None) -> int:
        """Send the request `name` from outside, now or at a later time. Returns its id.

        Raises:
            BadSystem: no node answers such a request, or `message` is of another type.
        """
        seat = next((s for s in self._seats.values() if name in s.node.contract.requests), None)
        if seat is None:
            raise BadSystem(f"no service answers the request '{name}'")
        kind = seat.node.contract.requests[name].message
        if not isinstance(message, kind):
            raise BadSystem(f"request '{name}' takes a {kind.__name__}, not a {type(message).__name__}")
        self._requests += 1
        request = Request(
            id=self._requests,
            name=name,
            type=kind.DESCRIPTOR.full_name,
            payload=message.SerializeToString(deterministic=True),
        )
        time = self.now if at is None else at
        payload = request.SerializeToString(deterministic=True)
        sample = Sample(topics.request(seat.node.name).name, request.id, time, payload)

        def arrive() -> None:
            self._sink(sample)
            self._deliver(seat, lambda node, now, finish: node.ask(request, now, finish), None)

        self._at(time, _MESSAGE, 0, arrive)
        return request.id

    def run(self, until: Time) -> None:
        """Handle all events up to and including the time `until`, or until `stop`."""
        queue = self._queue
        while queue and not self._stopped and queue[0][0] <= until:
            event = heapq.heappop(queue)
            self.now = event[0]
            event[4]()
        if not self._stopped:
            self.now = max(self.now, until)

    def stop(self) -> None:
        """End `run` after the event that is being handled. May be called from the sink."""
        self._stopped = True

    def finish(self) -> None:
        """Write out what handlers have given but not sent yet, and what the journals still hold.

        Call once, after the last `run`.
        """
        for samples in self._unsent.values():
            for sample in samples:
                self._sink(sample)
        self._unsent.clear()
        for seat in self._seats.values():
            for sample in seat.node.end(self.now):
                self._sink(sample)

    @property
    def dropped(self) -> dict[str, int]:
        """Return how many stale messages of latest-only inputs each node dropped unhandled."""
        return {name: seat.dropped for name, seat in self._seats.items()}

    def _connect(self) -> dict[str, list[tuple[_Seat, Time, bool]]]:
        publishers: dict[str, str] = {}
        answerers: dict[str, str] = {}
        listeners: dict[str, list[tuple[_Seat, Time, bool]]] = {}
        for name, seat in self._seats.items():
            for topic in seat.node.contract.outputs:
                if topic in publishers:
                    raise BadSystem(f"topic '{topic}' has two publishers: '{publishers[topic]}' and '{name}'")
                publishers[topic] = name
            for request in seat.node.contract.requests:
                if request in answerers:
                    raise BadSystem(f"request '{request}' is answered by '{answerers[request]}' and '{name}'")
                answerers[request] = name
            for topic, source in seat.node.contract.inputs.items():
                if source.topic.scoring_only and not seat.node.contract.sees_truth:
                    raise BadSystem(f"service '{name}' subscribes to '{topic}', which is for scoring only")
                latest = source.delivery is Delivery.LATEST
                latency = self._timing.link(topic, name)
                listeners.setdefault(topic, []).append((seat, latency, latest))
        return listeners

    def _check_timing(self) -> None:
        timing = self._timing
        for topic, node in timing.latency:
            if topic not in TOPICS:
                raise BadSystem(f"timing names a topic '{topic}'; there are {', '.join(TOPICS)}")
            if node not in ("*", *self._seats):
                raise BadSystem(f"timing names a service '{node}'; there are {', '.join(self._seats)}")
        unknown = sorted(set(timing.duration) - set(self._seats))
        if unknown:
            raise BadSystem(f"timing names a service '{unknown[0]}'; there are {', '.join(self._seats)}")
        for what, value in (*timing.latency.items(), *timing.duration.items()):
            if value < 0:
                raise BadSystem(f"timing of {what} is {value} ns, expected 0 or more")
        for what, value in (("snapshot", timing.snapshot_period), ("journal", timing.journal_period)):
            if value <= 0:
                raise BadSystem(f"the {what} period is {value} ns, expected more than 0")

    def _at(self, time: Time, rank: int, order: int, event: Callable[[], None]) -> None:
        self._count += 1
        heapq.heappush(self._queue, (time, rank, order, self._count, event))

    def _arm_all(self, seat: _Seat) -> None:
        for due, timer in seat.node.due():
            self._arm(seat, due, timer)

    def _arm(self, seat: _Seat, due: Time, timer: str) -> None:
        period = seat.node.period(timer)
        number = (due - seat.node.start) // period

        def fire() -> None:
            # A firing that still waits when the next is due is dropped: a slow service must not pile them up.
            self._deliver(seat, lambda node, now, finish: node.fire(timer, number, now, finish), timer)
            self._arm(seat, due + period, timer)

        self._at(due, _TIMER, seat.index, fire)

    def _send(self, samples: Iterable[Sample]) -> None:
        for sample in samples:
            self._sink(sample)
            for seat, latency, latest in self._listeners.get(sample.topic, ()):
                self._send_to(seat, sample, sample.time + latency, latest)

    def _send_at(self, samples: list[Sample], time: Time) -> None:
        """Send now, or when the handler that gave them is through."""
        if time <= self.now:
            self._send(samples)
        elif samples:
            self._unsent[self._count + 1] = samples
            self._at(time, _SEND, 0, self._send_later(self._count + 1))

    def _send_later(self, key: int) -> Callable[[], None]:
        return lambda: self._send(self._unsent.pop(key))

    def _send_to(self, seat: _Seat, sample: Sample, time: Time, latest: bool) -> None:
        def arrive() -> None:
            self._deliver(
                seat,
                lambda node, now, finish: node.consume(sample, now, finish),
                sample.topic if latest else None,
            )

        self._at(time, _MESSAGE, 0, arrive)

    def _deliver(self, seat: _Seat, work: _Work, replaces: str | None) -> None:
        if seat.free_at <= self.now and not seat.inbox:
            self._work(seat, work)
            return
        waiting = [topic for _, topic in seat.inbox] if replaces is not None else []
        if replaces in waiting:
            # In the place of the old one: at the back of the queue a busy service would never come to it.
            seat.inbox[waiting.index(replaces)] = (work, replaces)
            seat.dropped += replaces in seat.node.contract.inputs
            return
        seat.inbox.append((work, replaces))
        self._wake_later(seat)

    def _wake_later(self, seat: _Seat) -> None:
        if not seat.waking:
            seat.waking = True
            self._at(max(seat.free_at, self.now), _WAKE, 0, lambda: self._wake(seat))

    def _wake(self, seat: _Seat) -> None:
        seat.waking = False
        while seat.inbox and seat.free_at <= self.now:
            work, _ = seat.inbox.popleft()
            self._work(seat, work)
        if seat.inbox:
            self._wake_later(seat)

    def _work(self, seat: _Seat, work: _Work) -> None:
        finish = self.now + seat.duration
        seat.free_at = finish
        self._send_at(work(seat.node, self.now, finish), finish)

    def _snapshot_all(self) -> None:
        def snapshot(node: Steppable, now: Time, _: Time) -> list[Sample]:
            return [node.take_snapshot(now)]

        for seat in self._seats.values():
            self._deliver(seat, snapshot, None)
        self._at(self.now + self._timing.snapshot_period, _SNAPSHOT, 0, self._snapshot_all)

    def _flush_all(self) -> None:
        for seat in self._seats.values():
            self._flush(seat)
        self._at(self.now + self._timing.journal_period, _FLUSH, 0, self._flush_all)

    def _flush(self, seat: _Seat) -> None:
        sample = seat.node.flush(self.now)
        if sample is not None:
            self._sink(sample)
