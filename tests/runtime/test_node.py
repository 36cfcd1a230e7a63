from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from runtime import state, topics
from runtime.guard import Guard
from runtime.journal import Entry, entries
from runtime.messages import (
    CancelRequest,
    Corridor,
    EntryKind,
    Journal,
    Odometry,
    Polyline,
    PushTarget,
    Reply,
    Request,
    RobotPose,
    Snapshot,
    VelocityCommand,
)
from runtime.node import BadHandler, Node
from runtime.sample import BadMessage, Sample
from runtime.service import Answer, Effects, Input, Output, Publication, RequestInput, Service, Timer, on
from runtime.time import MILLISECOND, Time
from tests.support import Count, Listener, Nothing, Pace

Handler = Callable[[Any, int], object]


class Puppet(Service):
    """Does what the test hands it."""

    name = "puppet"
    Config = Nothing
    odometry = Input(topics.ODOMETRY)
    target = Output(topics.PUSH_TARGET)
    corridor = Output(topics.CORRIDOR)
    tick = Timer(0.1)
    cancel = RequestInput("push/cancel", CancelRequest)

    def __init__(self, script: Callable[[Puppet], object]) -> None:
        super().__init__(Nothing())
        self.state = Count()
        self.script = script

    @on(odometry)
    def hear(self, odometry: Odometry, now: Time) -> Any:
        return self.script(self)

    @on(tick)
    def beat(self, now: Time) -> Any:
        return self.script(self)

    @on(cancel)
    def answer(self, cancel: CancelRequest, now: Time) -> Any:
        return self.script(self)


ODOMETRY = Sample("odometry", 1, 5, Odometry(stamp=5).SerializeToString())
CANCEL = Request(id=4, name="push/cancel", type="pushlane.CancelRequest", payload=b"")


def hear(script: Callable[[Puppet], object]) -> list[Sample]:
    return Node(Puppet(script), None).consume(ODOMETRY, 10, 20)


def beat(script: Callable[[Puppet], object]) -> list[Sample]:
    return Node(Puppet(script), None).fire("tick", 1, 10, 20)


def ask(script: Callable[[Puppet], object]) -> list[Sample]:
    return Node(Puppet(script), None).ask(CANCEL, 10, 20)


def journal(node: Node) -> list[Entry]:
    batch = node.flush(0)
    return [] if batch is None else list(entries([Journal.FromString(batch.payload)]))


def test_what_a_handler_yields_is_published_with_its_end_numbered_by_topic() -> None:
    node = Node(Puppet(lambda p: [p.target(PushTarget(stamp=1)), p.say("hm", 5), p.target(PushTarget(stamp=2))]), None)
    first = node.consume(ODOMETRY, 10, 20)
    second = node.fire("tick", 1, 30, 40)
    assert [(sample.topic, sample.sequence, sample.time) for sample in [*first, *second]] == [
        ("push/target", 1, 20),
        ("log/puppet", 1, 20),
        ("push/target", 2, 20),
        ("push/target", 3, 40),
        ("log/puppet", 2, 40),
        ("push/target", 4, 40),
    ]
    assert PushTarget.FromString(first[2].payload) == PushTarget(stamp=2)


def test_a_message_is_encoded_as_it_was_when_it_was_yielded() -> None:
    def script(puppet: Puppet) -> Iterator[Publication]:
        target = PushTarget(stamp=1)
        yield puppet.target(target)
        target.stamp = 2
        yield puppet.target(target)

    assert [PushTarget.FromString(sample.payload).stamp for sample in hear(script)] == [1, 2]


def test_the_journal_tells_the_life_of_a_node() -> None:
    node = Node(Puppet(lambda p: [p.target(PushTarget())]), None)
    node.begin(7)
    node.consume(ODOMETRY, 10, 20)
    node.fire("tick", 3, 30, 40)
    assert [(e.kind, e.name, e.sequence, e.time) for e in journal(node)] == [
        (EntryKind.STARTED, "", 0, 7),
        (EntryKind.SNAPSHOT, "", 1, 7),
        (EntryKind.MESSAGE, "odometry", 1, 10),
        (EntryKind.PRODUCED, "push/target", 1, 20),
        (EntryKind.TIMER, "tick", 3, 30),
        (EntryKind.PRODUCED, "push/target", 2, 40),
    ]
    assert node.flush(50) is None


@pytest.mark.parametrize(
    ("script", "path"),
    [
        (lambda p: [p.target(PushTarget(distance_to_go=math.nan))], "'push/target' with distance_to_go"),
        (lambda p: [p.target(PushTarget(target={"x": 1, "y": math.inf}))], r"'push/target' with target\.y"),
        (
            lambda p: [p.corridor(Corridor(edge_push=[Polyline(), Polyline(x=[1, 2, -math.inf])]))],
            r"'corridor' with edge_push\[1\]\.x\[2\]",
        ),
    ],
)
def test_a_publication_that_is_not_finite_is_refused_by_service_topic_and_field(
    script: Callable[[Puppet], object], path: str
) -> None:
    for event in (hear, beat, ask):
        with pytest.raises(BadHandler, match=f"service 'puppet' published {path} not finite"):
            event(script)


@pytest.mark.parametrize(
    ("script", "message"),
    [
        (lambda p: [Publication("robot/pose", RobotPose())], "'robot/pose', which it does not declare"),
        (lambda p: [Publication("log/other", PushTarget())], "'log/other', which it does not declare"),
        (lambda p: [PushTarget()], "yielded"),
        (lambda p: [None], "yielded None"),
        (lambda p: [p.target], "yielded"),
        (lambda p: p.target(PushTarget()), "'puppet'"),  # forgot to yield
        (lambda p: 3, "'puppet'"),
        (lambda p: [Publication("push/target", VelocityCommand())], "'push/target'.*VelocityCommand"),
    ],
    ids=[
        "undeclared",
        "another's log",
        "a bare message",
        "None",
        "an output",
        "returned not yielded",
        "a number",
        "another type",
    ],
)
def test_what_a_handler_may_not_yield_is_refused_by_service(script: Callable[[Puppet], object], message: str) -> None:
    for event in (hear, beat):
        with pytest.raises(BadHandler, match=message):
            event(script)


@pytest.mark.parametrize("event", [hear, beat])
def test_only_requests_are_answered(event: Callable[[Callable[[Puppet], object]], object]) -> None:
    with pytest.raises(BadHandler, match="'puppet'"):
        event(lambda p: [Answer(accepted=True)])


@pytest.mark.parametrize("count", [0, 2, 3])
def test_a_request_needs_exactly_one_answer(count: int) -> None:
    with pytest.raises(BadHandler, match=f"'puppet' gave {count} answers to 'push/cancel'"):
        ask(lambda p: [p.cancel.accept()] * count)
    if count == 0:
        with pytest.raises(BadHandler, match="'puppet' gave 0 answers"):
            ask(lambda p: None)


def test_a_reply_comes_after_what_the_request_made_the_service_say() -> None:
    target, reply = ask(lambda p: [p.cancel.refuse("no push"), p.target(PushTarget())])
    assert (target.topic, reply.topic, reply.sequence, reply.time) == ("push/target", "reply/puppet", 1, 20)
    assert Reply.FromString(reply.payload) == Reply(id=4, name="push/cancel", accepted=False, reason="no push")


@pytest.mark.parametrize(
    ("payload", "message"),
    [
        (b"\xff\xff\xff", "'odometry': 3 bytes are no Odometry"),
        (b"\x12\x7f\x00", "'odometry': 3 bytes are no Odometry"),
        (Odometry(covariance=[1, math.nan]).SerializeToString(), r"'odometry': covariance\[1\] is not finite"),
        (Odometry(pose={"theta": math.inf}).SerializeToString(), r"'odometry': pose\.theta is not finite"),
    ],
)
def test_a_bad_payload_is_refused_and_leaves_no_trace(payload: bytes, message: str) -> None:
    node = Node(Puppet(lambda p: None), None)
    with pytest.raises(BadMessage, match=message):
        node.consume(Sample("odometry", 1, 5, payload), 10, 10)
    assert journal(node) == []
    assert node.host.latest == {} and node.host.consumed == {} and node.service.latest == {}


@given(st.binary(max_size=30))
def test_noise_as_payload_is_a_message_or_refused(payload: bytes) -> None:
    node = Node(Puppet(lambda p: None), None)
    try:
        node.consume(Sample("odometry", 1, 5, payload), 10, 10)
    except BadMessage:
        assert journal(node) == []
    else:
        assert len(journal(node)) == 1


def test_a_bad_request_payload_is_refused() -> None:
    with pytest.raises(BadMessage, match="'push/cancel': 1 bytes are no CancelRequest"):
        Node(Puppet(lambda p: None), None).ask(Request(id=1, name="push/cancel", payload=b"\xff"), 1, 1)


def test_a_period_that_is_not_above_zero_is_refused() -> None:
    for period in (0.0, -1.0, 1e-10):
        with pytest.raises(BadHandler, match="'listener': the period of timer 'beat'"):
            Node(Listener(Pace(period)), None)


def test_timers_are_due_by_the_plan() -> None:
    node = Node(Listener(Pace(0.1)), None)
    node.begin(1000)
    assert node.due() == [(1000 + 100 * MILLISECOND, "beat")]
    node.fire("beat", 4, 1000 + 450 * MILLISECOND, 1000 + 450 * MILLISECOND)
    assert node.due() == [(1000 + 500 * MILLISECOND, "beat")]


def test_an_error_in_a_handler_leaves_the_guard_open_for_the_rest() -> None:
    def script(puppet: Puppet) -> object:
        raise ZeroDivisionError

    with Guard() as guard:
        with pytest.raises(ZeroDivisionError):
            Node(Puppet(script), guard).consume(ODOMETRY, 1, 1)
        assert guard.node is None


@dataclass
class Tally:
    """A state of every kind there is."""

    n: int = 0
    level: float = 0.0
    window: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    seen: dict[str, int] = field(default_factory=dict)
    last: Odometry | None = None
    random: np.random.Generator = field(default_factory=lambda: np.random.default_rng(5))


class Dreamer(Service):
    """Draws, counts and remembers; keeps something derived beside its state."""

    name = "dreamer"
    Config = Nothing
    odometry = Input(topics.ODOMETRY)
    command = Input(topics.COMMAND)
    pose = Output(topics.ROBOT_POSE)
    fast = Timer(0.01)
    slow = Timer(0.03)
    cancel = RequestInput("push/cancel", CancelRequest)
    state: Tally

    def __init__(self, config: Nothing) -> None:
        super().__init__(config)
        self.state = Tally()
        self.total = 0.0
        self.pending = 0

    def freeze(self) -> None:
        self.state.n += self.pending
        self.pending = 0

    def thaw(self) -> None:
        self.total = float(self.state.window.sum())

    @on(odometry)
    def hear(self, odometry: Odometry, now: Time) -> Effects:
        self.state.last = odometry
        self.state.window = np.roll(self.state.window, 1)
        self.state.window[0] = odometry.pose.x
        self.total = float(self.state.window.sum())
        self.state.level += self.state.random.normal() * self.total
        self.state.seen[f"s{odometry.driver_sequence % 5}"] = odometry.driver_sequence
        yield self.report(now)

    @on(fast)
    def tick(self, now: Time) -> None:
        self.state.level += int(self.state.random.integers(0, 10, dtype=np.uint32))
        self.pending += 1

    @on(slow)
    def tock(self, now: Time) -> Effects:
        if self.state.last is not None:
            yield self.report(now)

    @on(cancel)
    def answer(self, cancel: CancelRequest, now: Time) -> Effects:
        yield self.cancel.refuse(cancel.reason) if self.command is None else self.cancel.accept()
        yield self.say(f"{self.state.n + self.pending} {self.state.level}", now)

    def report(self, now: Time) -> Publication:
        command = 0.0 if self.command is None else self.command.psi_push
        covariance = [self.state.level, self.total, command, float(self.state.n + self.pending)]
        covariance += [float(self.state.seen[name]) for name in sorted(self.state.seen)]
        return self.pose(RobotPose(stamp=now, covariance=covariance))


EVENTS = st.lists(
    st.tuples(st.sampled_from(["odometry", "command", "fast", "slow", "cancel"]), st.integers(0, 50)),
    min_size=1,
    max_size=25,
)


def happen(node: Node, index: int, event: tuple[str, int]) -> list[Sample]:
    """Give `node` event number `index`."""
    kind, value = event
    now = 1000 * (index + 1)
    if kind == "odometry":
        odometry = Odometry(stamp=now, driver_sequence=value, pose={"x": value / 7})
        return node.consume(Sample("odometry", index, now, odometry.SerializeToString()), now, now + value)
    if kind == "command":
        command = VelocityCommand(stamp=now, psi_push=value / 50)
        return node.consume(Sample("command", index, now, command.SerializeToString()), now, now + value)
    if kind == "cancel":
        payload = CancelRequest(reason=f"because {value}").SerializeToString()
        return node.ask(Request(id=index, name="push/cancel", payload=payload), now, now + value)
    return node.fire(kind, index, now, now + value)


@settings(max_examples=60)
@given(EVENTS, st.data())
def test_a_service_resumed_from_a_snapshot_goes_on_as_if_it_had_never_stopped(
    events: list[tuple[str, int]], data: st.DataObject
) -> None:
    cut = data.draw(st.integers(0, len(events)))
    whole = Node(Dreamer(Nothing()), None)
    whole.begin(3)
    for index, event in enumerate(events[:cut]):
        happen(whole, index, event)
    snapshot = Snapshot.FromString(whole.take_snapshot(1000 * cut + 1).payload)
    journal(whole)
    resumed = Node(Dreamer(Nothing()), None)
    resumed.resume(snapshot)
    assert resumed.due() == whole.due()
    for index, event in enumerate(events[cut:], cut):
        assert happen(resumed, index, event) == happen(whole, index, event)
    assert resumed.take_snapshot(10**6) == whole.take_snapshot(10**6)
    assert journal(resumed) == journal(whole)
    assert resumed.journal.digest == whole.journal.digest


def test_a_snapshot_says_where_it_stands_in_the_journal() -> None:
    node = Node(Dreamer(Nothing()), None)
    node.begin(3)
    happen(node, 0, ("odometry", 1))
    snapshot = Snapshot.FromString(node.take_snapshot(50).payload)
    rows = journal(node)
    assert snapshot.node == "dreamer" and snapshot.number == 2 and snapshot.time == 50
    assert (rows[snapshot.entry].kind, rows[snapshot.entry].digest) == (EntryKind.SNAPSHOT, snapshot.digest)
    assert rows[-1].number == snapshot.entry


def test_a_snapshot_does_not_change_with_the_service() -> None:
    node = Node(Dreamer(Nothing()), None)
    snapshot = Snapshot.FromString(node.begin(3)[0].payload)
    before = snapshot.service
    happen(node, 0, ("odometry", 4))
    assert snapshot.service == before
    fresh = Node(Dreamer(Nothing()), None)
    fresh.resume(snapshot)
    assert fresh.service.state.last is None  # type: ignore[attr-defined]


def test_a_snapshot_of_another_service_is_refused() -> None:
    snapshot = Snapshot.FromString(Node(Puppet(lambda p: None), None).begin(0)[0].payload)
    with pytest.raises(state.BadSnapshot, match="puppet"):
        Node(Dreamer(Nothing()), None).resume(snapshot)


def test_a_snapshot_with_an_unknown_input_is_refused() -> None:
    node = Node(Dreamer(Nothing()), None)
    snapshot = Snapshot.FromString(node.begin(0)[0].payload)
    node.host.latest["scan"] = b""
    snapshot.host = state.encode(node.host)
    with pytest.raises(state.BadSnapshot, match="input 'scan'"):
        Node(Dreamer(Nothing()), None).resume(snapshot)


@given(st.sampled_from(["service", "host"]), st.data())
def test_a_damaged_snapshot_is_refused_or_read_and_nothing_else(part: str, data: st.DataObject) -> None:
    node = Node(Dreamer(Nothing()), None)
    node.begin(0)
    happen(node, 0, ("odometry", 3))
    snapshot = Snapshot.FromString(node.take_snapshot(2000).payload)
    content = bytearray(getattr(snapshot, part))
    content[data.draw(st.integers(0, len(content) - 1))] ^= data.draw(st.integers(1, 255))
    setattr(snapshot, part, bytes(content))
    try:
        Node(Dreamer(Nothing()), None).resume(snapshot)
    except state.BadSnapshot:
        return
