"""A live host: one service, one loop, one queue, over Zenoh and in real time; and its wire, where it has one.

Run by the launcher as `python -m runtime.live.host NAME ...`. The loop decides what comes next (a due timer before
waiting messages) and the journal says what it decided, so that a replay decides the same.
"""

from __future__ import annotations

import gc
import queue
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress

import zenoh
from google.protobuf.message import Message

from runtime import topics
from runtime.bus import envelope
from runtime.bus.keys import Keys
from runtime.live.beat import beat
from runtime.live.clock import Clock
from runtime.live.config import LiveConfig
from runtime.live.inbox import Arrivals, Busy, Inbox
from runtime.live.outlet import Outlet
from runtime.live.wire import Wire
from runtime.messages import Health, InputHealth, Reply, Request, Snapshot
from runtime.node import Node
from runtime.sample import INCARNATION, BadMessage, Sample
from runtime.time import SECOND, Time, nanoseconds, seconds
from runtime.topics import TOPICS, Delivery

_Entry = tuple[Sample, Message] | tuple[str, zenoh.Query]
_OnQuery = Callable[[zenoh.Query], None]

_LOG_EVERY = 1.0
_LATCHED_LIMIT = 0.5
_LONGEST_REFUSAL = 200


class LiveHost:
    """Runs `node` until told to stop.

    Args:
        incarnation: how often this service was restarted in this session.
        last: a snapshot to go on from.
        wire: joins the service to a device or a socket. What it brings is published here, and by nobody else.
    """

    def __init__(
        self,
        node: Node,
        session: zenoh.Session,
        keys: Keys,
        config: LiveConfig,
        incarnation: int = 0,
        last: Snapshot | None = None,
        wire: Wire | None = None,
    ) -> None:
        self._node = node
        self._session = session
        self._keys = keys
        self._config = config
        self._incarnation = incarnation
        self._last = last
        self._clock = Clock()
        contract = node.contract
        latest = frozenset(name for name, one in contract.inputs.items() if one.delivery is Delivery.LATEST)
        self._wire = wire
        self._brought = incarnation * INCARNATION
        self._arrivals: Arrivals[zenoh.Sample | zenoh.Query | Message] = Arrivals()
        self._inbox: Inbox[_Entry] = Inbox(latest)
        self._stopped = threading.Event()
        self._outlet = Outlet(node.name, session, keys, config.kept, wire)
        self._send = self._outlet.send
        self._requests = incarnation * INCARNATION
        self._busy = Busy()
        self._complained: dict[str, float] = {}
        self._chores: dict[Callable[[Time], object], Time] = {}
        self._health = 0

    def stop(self) -> None:
        """End the loop soon. May be called from a signal handler."""
        self._stopped.set()

    def run(self) -> None:
        """Live until stopped."""
        declared = self._declare()
        try:
            self._send(self._node.begin(self._clock.now(), self._incarnation, self._last))
            self._ask_for_latched()
            if self._wire is not None:
                bring, topic = self._arrivals.put, self._wire.brings
                self._wire.open(lambda message: bring(topic, message), self._clock.now)
            # What is there by now stays: the collector of garbage need not go through it again and again.
            gc.freeze()
            try:
                self._loop()
            finally:
                # Last words also where the loop broke off: a driver's are zero.
                self._outlet.send_last(self._node.end(self._clock.now()))
            self._outlet.see_off()
        finally:
            if self._wire is not None:
                self._wire.close()
            for one in declared:
                one.undeclare()

    def _declare(self) -> list[zenoh.Subscriber[None] | zenoh.Queryable[None] | zenoh.LivelinessToken]:
        session, keys, contract = self._session, self._keys, self._node.contract
        declared: list[zenoh.Subscriber[None] | zenoh.Queryable[None] | zenoh.LivelinessToken] = [
            session.declare_subscriber(keys.topic(topic), self._receiver(topic))
            for topic in contract.inputs
            if self._wire is None or topic != self._wire.brings
        ]
        declared += [session.declare_queryable(keys.request(name), self._asker(name)) for name in contract.requests]
        latched = [topic for topic in contract.outputs if TOPICS[topic].latched]
        declared += [session.declare_queryable(keys.latched(topic), self._outlet.teller(topic)) for topic in latched]
        declared.append(session.declare_queryable(keys.snapshot(self._node.name), self._asker("@snapshot")))
        declared.append(session.declare_queryable(keys.sent(self._node.name), self._outlet.send_again))
        declared.append(session.liveliness().declare_token(keys.node(self._node.name)))
        return declared

    def _loop(self) -> None:
        node, clock, arrivals, inbox = self._node, self._clock, self._arrivals, self._inbox
        timers = {name: due for due, name in node.due()}
        chores = self._chores = {
            self._flush: nanoseconds(self._config.journal_period),
            self._beat: nanoseconds(self._config.beat_period),
            self._report: nanoseconds(self._config.health_period),
            self._remind: nanoseconds(self._config.remind_period),
            self._snap: nanoseconds(self._config.snapshot_period),
        }
        now = clock.now()
        chores_due = {chore: now + period for chore, period in chores.items()}
        due = now
        while not self._stopped.is_set():
            now = clock.now()
            if now >= due:
                timer = min(timers, key=timers.__getitem__, default="")
                if timer and timers[timer] <= now:
                    period = node.period(timer)
                    number = (now - node.start) // period  # what was missed is left out, not piled up
                    timers[timer] = node.start + (number + 1) * period
                    begin = clock.now()
                    self._handle(node.fire(timer, number, begin, begin), begin)
                else:
                    chore = min(chores_due, key=chores_due.__getitem__)
                    if chores_due[chore] <= now:
                        chore(now)
                        chores_due[chore] = now + chores[chore]
                due = min(*timers.values(), *chores_due.values())
                continue
            # All that came is looked at before one is handled: of latest-only inputs that is the newest.
            waiting = len(arrivals)
            if waiting:
                take, oldest = self._take, arrivals.oldest
                with suppress(queue.Empty):  # a flood was shortened meanwhile
                    for _ in range(waiting):
                        take(oldest())
                now = clock.now()
            entry = inbox.get()
            if entry is None:
                self._take(arrivals.get(seconds(due - now)))
            elif isinstance(entry[0], Sample):
                self._consume(entry[0], entry[1], now)  # type: ignore[arg-type]
            else:
                self._answer(*entry)  # type: ignore[arg-type]

    def _handle(self, samples: list[Sample], begin: Time) -> None:
        """Send what a handler gave that began at `begin`."""
        self._busy.add(self._clock.now() - begin)
        if samples:
            self._send(samples)

    def _consume(self, sample: Sample, message: Message, begin: Time) -> None:
        self._handle(self._node.consume(sample, begin, begin, message), begin)
        count = self._inbox.counts[sample.topic]
        count.consumed += 1
        count.age = (begin - sample.time) / SECOND

    def _answer(self, name: str, query: zenoh.Query) -> None:
        payload = b"" if query.payload is None else bytes(query.payload)
        if name == "@snapshot":
            query.reply(str(query.key_expr), self._snap(self._clock.now()))
            query.drop()
            return
        self._requests += 1
        source = self._node.contract.requests[name]
        request = Request(id=self._requests, name=name, type=source.message.DESCRIPTOR.full_name, payload=payload)
        topic = topics.request(self._node.name).name
        now = self._clock.now()
        try:
            samples = self._node.ask(request, now, now)
        except BadMessage as error:
            answer = Reply(id=request.id, name=name, accepted=False, reason=str(error)).SerializeToString()
            self._complain(name, str(error))
        else:
            self._send([Sample(topic, request.id, now, request.SerializeToString(deterministic=True)), *samples])
            answer = samples[-1].payload
        query.reply(str(query.key_expr), answer)
        query.drop()

    def _receiver(self, topic: str) -> Callable[[zenoh.Sample], None]:
        put = self._arrivals.put
        return lambda sample: put(topic, sample)

    def _take(self, arrival: tuple[str, zenoh.Sample | zenoh.Query | Message] | None) -> None:
        """Look at what came."""
        if arrival is None:
            return
        name, what = arrival
        if isinstance(what, zenoh.Sample):
            attachment = what.attachment
            self._accept(name, bytes(what.payload), None if attachment is None else bytes(attachment))
        elif isinstance(what, Message):
            self._bring(name, what)
        elif not self._inbox.ask((name, what)):
            what.reply_err(f"'{name}': too many requests wait")
            what.drop()

    def _accept(self, topic: str, payload: bytes, attachment: bytes | None) -> None:
        """Put what came in the queue, or refuse it: here is the edge."""
        if len(payload) > self._config.largest:
            self._complain(topic, f"'{topic}' came with {len(payload)} bytes, more than {self._config.largest}")
            return
        try:
            sample = envelope.unpack(topic, payload, attachment)
            refusal = self._inbox.put(sample, (sample, self._node.parsed(sample)))
        except (envelope.BadEnvelope, BadMessage) as error:
            refusal = str(error)
        if refusal:
            self._complain(topic, refusal)

    def _ask_for_latched(self) -> None:
        for topic, source in self._node.contract.inputs.items():
            if not source.topic.latched:
                continue
            for reply in self._session.get(self._keys.latched(topic), timeout=_LATCHED_LIMIT):
                if reply.ok is not None and reply.ok.attachment is not None:
                    self._accept(topic, bytes(reply.ok.payload), bytes(reply.ok.attachment))

    def _asker(self, name: str) -> _OnQuery:
        put = self._arrivals.put
        return lambda query: put(name, query)

    def _bring(self, topic: str, message: Message) -> None:
        """Number and publish what the wire brought, and put it in the queue: by its name the journal tells of it."""
        self._brought += 1
        payload = message.SerializeToString(deterministic=True)
        sample = Sample(topic, self._brought, self._clock.now(), payload)
        try:
            # As from anywhere else: here is the edge.
            entry = (sample, self._node.parsed(sample))
        except BadMessage as error:
            self._complain(topic, str(error))
            return
        self._outlet.publish(sample)
        self._inbox.put(sample, entry)

    def _remind(self, _: Time) -> None:
        self._outlet.remind()

    def _flush(self, now: Time) -> None:
        batch = self._node.flush(now)
        if batch is not None:
            self._send([batch])

    def _snap(self, now: Time) -> bytes:
        sample = self._node.take_snapshot(now)
        self._send([sample])
        # A large state, as a filter's maps are, takes long to give and fills links: it is given more seldom.
        pause = max(self._config.snapshot_period, len(sample.payload) / self._config.snapshot_rate)
        self._chores[self._snap] = nanoseconds(pause)
        return sample.payload

    def _beat(self, _: Time) -> None:
        if not beat():
            print(f"{self._node.name}: the launcher is gone", file=sys.stderr, flush=True)
            self.stop()

    def _report(self, now: Time) -> None:
        busy, self._busy = self._busy, Busy()
        rows = []
        for topic in self._node.contract.inputs:
            count = self._inbox.count(topic)
            dropped = count.dropped + self._arrivals.dropped.get(topic, 0)
            row = InputHealth(topic=topic, consumed=count.consumed, dropped=dropped, age=count.age)
            row.lost, row.refused, row.repeated, row.refusal = count.lost, count.refused, count.repeated, count.refusal
            rows.append(row)
        self._health += 1
        health = Health(
            stamp=now,
            node=self._node.name,
            inputs=rows,
            handled=busy.events,
            queue_length=len(self._inbox) + len(self._arrivals),
            busy_mean=seconds(busy.total // busy.events) if busy.events else 0.0,
            busy_max=seconds(busy.longest),
        )
        topic = topics.health(self._node.name).name
        sequence = self._incarnation * INCARNATION + self._health
        self._send([Sample(topic, sequence, now, health.SerializeToString(deterministic=True))])

    def _complain(self, topic: str, text: str) -> None:
        """Count a payload that was refused, and say so at most once a second."""
        count = self._inbox.count(topic)
        count.refused += 1
        count.refusal = text[:_LONGEST_REFUSAL]
        now = time.monotonic()
        if now - self._complained.get(topic, -_LOG_EVERY) >= _LOG_EVERY:
            self._complained[topic] = now
            print(f"{self._node.name}: refused: {text}", file=sys.stderr, flush=True)
