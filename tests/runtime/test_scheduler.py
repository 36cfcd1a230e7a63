from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from runtime import topics
from runtime.messages import CancelRequest, Journal, PushGoal, PushTarget, Reply, Request, Snapshot, Truth
from runtime.node import Node
from runtime.recorder.header import of_this_machine
from runtime.recorder.writer import Recorder
from runtime.sample import Sample
from runtime.scheduler import BadSystem, Scheduler, Timing
from runtime.service import Effects, Input, Output, RequestInput, Service, Timer, on
from runtime.time import MILLISECOND, SECOND, Time
from tests.support import (
    CommandSource,
    Count,
    Listener,
    Nothing,
    OdometrySource,
    Pace,
    Relay,
    Silent,
    Tape,
    run,
    schedule,
)

SLOW = Pace(1000.0)  # a beat that never comes


def ms(*times: float) -> list[Time]:
    return [round(time * MILLISECOND) for time in times]


def test_a_message_is_heard_at_once_where_nothing_delays_it() -> None:
    listener = Listener(SLOW)
    scheduler, _ = schedule([OdometrySource(Pace(0.1)), listener])
    scheduler.run(350 * MILLISECOND)
    assert listener.heard("odometry") == list(zip(ms(100, 200, 300), [1, 2, 3], strict=True))
    assert scheduler.now == 350 * MILLISECOND


def test_run_includes_its_end_and_goes_on_where_it_stopped() -> None:
    listener = Listener(SLOW)
    scheduler, _ = schedule([OdometrySource(Pace(0.1)), listener])
    for end in ms(100, 199, 200, 450):
        scheduler.run(end)
    assert listener.heard("odometry") == list(zip(ms(100, 200, 300, 400), [1, 2, 3, 4], strict=True))


def test_times_count_from_the_start() -> None:
    listener = Listener(SLOW)
    scheduler, tape = schedule([OdometrySource(Pace(0.1)), listener], start=7 * SECOND)
    scheduler.run(7 * SECOND + 250 * MILLISECOND)
    assert [time - 7 * SECOND for time, _ in listener.heard("odometry")] == ms(100, 200)
    assert {sample.time for sample in tape.of("snapshot/listener")} == {7 * SECOND}


def test_at_one_time_messages_come_before_timers() -> None:
    """The relay's beat and the message of the source before it are both due at 0.1 s."""
    listener = Listener(Pace(0.1))
    scheduler, _ = schedule([OdometrySource(Pace(0.1)), listener])
    scheduler.run(100 * MILLISECOND)
    assert [what for _, what, _ in listener.state.events] == ["odometry", "beat"]


def test_at_one_time_timers_come_in_the_order_of_the_nodes() -> None:
    """The listener's own timer is first where it stands first; the message that is sent after cannot precede it."""
    listener = Listener(Pace(0.1))
    scheduler, _ = schedule([listener, OdometrySource(Pace(0.1))])
    scheduler.run(100 * MILLISECOND)
    assert [what for _, what, _ in listener.state.events] == ["beat", "odometry"]


def test_at_one_time_messages_come_in_the_order_of_sending() -> None:
    listener = Listener(SLOW)
    scheduler, _ = schedule([CommandSource(Pace(0.1)), OdometrySource(Pace(0.1)), listener])
    scheduler.request("push/cancel", CancelRequest(), at=100 * MILLISECOND)
    scheduler.run(100 * MILLISECOND)
    assert [what for _, what, _ in listener.state.events] == ["cancel", "command", "odometry"]


def test_snapshots_come_after_all_else_of_their_time() -> None:
    listener = Listener(Pace(0.1))
    timing = Timing(snapshot_period=100 * MILLISECOND)
    scheduler, tape = schedule([OdometrySource(Pace(0.1)), listener], timing)
    scheduler.run(100 * MILLISECOND)
    snapshot = Snapshot.FromString(tape.of("snapshot/listener")[-1].payload)
    assert snapshot.time == 100 * MILLISECOND
    fresh = Node(Listener(Pace(0.1)), None)
    fresh.resume(snapshot)
    assert [what for _, what, _ in fresh.service.state.events] == ["odometry", "beat"]  # type: ignore[attr-defined]


def test_a_link_delays_by_topic_and_by_topic_and_node() -> None:
    general = {("odometry", "*"): 30 * MILLISECOND}
    for name, own, arrivals in (
        ("near", {("odometry", "near"): 0}, ms(100, 200, 300, 400, 500)),
        ("plain", {}, ms(130, 230, 330, 430)),
        ("far", {("odometry", "far"): 250 * MILLISECOND}, ms(350, 450)),
    ):
        listener = Listener(SLOW, name)
        scheduler, _ = schedule([OdometrySource(Pace(0.1)), listener], Timing(latency=general | own))
        scheduler.run(500 * MILLISECOND)
        assert listener.heard("odometry") == list(zip(arrivals, range(1, len(arrivals) + 1), strict=True))


def test_a_busy_service_lets_reliable_messages_wait_in_order() -> None:
    """A message each 0.1 s, 0.25 s of work for each: the k-th is begun at 0.1 + 0.25 (k - 1) s."""
    listener = Listener(SLOW)
    timing = Timing(duration={"listener": 250 * MILLISECOND})
    scheduler, _ = schedule([OdometrySource(Pace(0.1)), listener], timing)
    scheduler.run(SECOND)
    assert listener.heard("odometry") == list(zip(ms(100, 350, 600, 850), [1, 2, 3, 4], strict=True))
    assert scheduler.dropped == {"odometry-source": 0, "listener": 0}


def test_what_a_slow_handler_publishes_goes_out_at_its_end() -> None:
    listener = Listener(SLOW)
    timing = Timing(duration={"odometry-source": 40 * MILLISECOND})
    scheduler, tape = schedule([OdometrySource(Pace(0.1)), listener], timing)
    scheduler.run(330 * MILLISECOND)
    assert [time for time, _ in listener.heard("odometry")] == ms(140, 240)
    assert [sample.time for sample in tape.of("odometry")][:2] == ms(140, 240)


def test_the_sink_is_given_samples_in_the_order_of_sending() -> None:
    """A slow handler's messages go out at its end: not before those that others send meanwhile."""
    timing = Timing(duration={"odometry-source": 90 * MILLISECOND})
    scheduler, tape = schedule([OdometrySource(Pace(0.1)), CommandSource(Pace(0.03))], timing)
    scheduler.run(SECOND)
    times = [sample.time for sample in tape.samples if sample.topic in ("odometry", "command")]
    assert times == sorted(times)
    assert max(times) <= SECOND


def test_of_latest_only_messages_a_stale_one_is_dropped_and_counted() -> None:
    """Commands each 0.1 s, 0.24 s of work: at its end only the newest is left."""
    listener = Listener(SLOW)
    timing = Timing(duration={"listener": 240 * MILLISECOND})
    scheduler, tape = schedule([CommandSource(Pace(0.1)), listener], timing)
    scheduler.run(SECOND)
    scheduler.finish()
    assert listener.heard("command") == list(zip(ms(100, 340, 580, 820), [1, 3, 5, 8], strict=True))
    assert scheduler.dropped["listener"] == 5  # numbers 2, 4, 6, 7 and 9; 10 waits
    kinds = [
        (name, sequence)
        for batch in map(Journal.FromString, (sample.payload for sample in tape.of("journal/listener")))
        for name, sequence in zip((batch.names[i] for i in batch.name), batch.sequence, strict=True)
    ]
    assert [row for row in kinds if row[0] == "command"] == [("command", n) for n in (1, 3, 5, 8)]


def test_reliable_messages_keep_their_place_when_a_stale_one_is_dropped() -> None:
    listener = Listener(SLOW)
    timing = Timing(duration={"listener": 350 * MILLISECOND})
    scheduler, _ = schedule([OdometrySource(Pace(0.8)), CommandSource(Pace(0.1)), listener], timing)
    scheduler.run(8 * SECOND)
    assert [number for _, number in listener.heard("odometry")] == list(range(1, 1 + len(listener.heard("odometry"))))
    numbers = [number for _, number in listener.heard("command")]
    assert numbers == sorted(set(numbers)) and len(numbers) > 1


def test_timers_coalesce_and_keep_the_numbers_of_the_plan() -> None:
    """A beat each 0.1 s that takes 0.24 s: firing n is due at 0.1 n s, and only the newest waits."""
    scheduler, tape = schedule([Listener(Pace(0.1))], Timing(duration={"listener": 240 * MILLISECOND}))
    scheduler.run(SECOND)
    scheduler.finish()
    rows = [
        (time, sequence)
        for batch in map(Journal.FromString, (sample.payload for sample in tape.of("journal/listener")))
        for time, kind, sequence in zip(absolute(batch), batch.kind, batch.sequence, strict=True)
        if kind == 3
    ]
    assert rows == list(zip(ms(100, 340, 580, 820), [1, 3, 5, 8], strict=True))


def absolute(batch: Journal) -> list[Time]:
    times, time = [], 0
    for difference in batch.time:
        time += difference
        times.append(time)
    return times


def test_dropped_counts_messages_not_timers() -> None:
    scheduler, _ = schedule([Listener(Pace(0.1))], Timing(duration={"listener": 250 * MILLISECOND}))
    scheduler.run(SECOND)
    assert scheduler.dropped == {"listener": 0}


def test_a_crowded_inbox_does_not_fill_the_queue_of_events() -> None:
    """What waits for a busy service is one event, however much is dropped."""
    listener = Listener(Pace(0.007))
    timing = Timing(duration={"listener": 10 * MILLISECOND})
    scheduler, _ = schedule([CommandSource(Pace(0.001)), listener], timing)
    scheduler.run(2 * SECOND)
    assert len(scheduler._queue) < 20


def test_each_request_is_asked_at_its_time_and_answered() -> None:
    listener = Listener(SLOW)
    scheduler, tape = schedule([OdometrySource(Pace(0.1)), listener])
    second = scheduler.request("push/cancel", CancelRequest(reason="b"), at=150 * MILLISECOND)
    first = scheduler.request("push/cancel", CancelRequest(reason="a"), at=50 * MILLISECOND)
    assert len({first, second}) == 2
    scheduler.run(200 * MILLISECOND)
    assert [time for time, _ in listener.heard("cancel")] == ms(50, 150)
    asked = [Request.FromString(sample.payload) for sample in tape.of("request/listener")]
    assert [CancelRequest.FromString(request.payload).reason for request in asked] == ["a", "b"]
    assert {(request.name, request.type) for request in asked} == {("push/cancel", "pushlane.CancelRequest")}
    replies = [Reply.FromString(sample.payload) for sample in tape.of("reply/listener")]
    assert [(reply.id, reply.accepted) for reply in replies] == [(first, True), (second, True)]


def test_a_request_now_is_asked_now() -> None:
    listener = Listener(SLOW)
    scheduler, _ = schedule([listener])
    scheduler.run(70 * MILLISECOND)
    scheduler.request("push/cancel", CancelRequest())
    scheduler.run(80 * MILLISECOND)
    assert [time for time, _ in listener.heard("cancel")] == ms(70)


def test_a_request_in_the_past_does_not_turn_time_back() -> None:
    listener = Listener(Pace(0.1))
    scheduler, _ = schedule([listener])
    scheduler.run(SECOND)
    try:
        scheduler.request("push/cancel", CancelRequest(), at=SECOND // 2)
        scheduler.run(SECOND + 1)
    except BadSystem:
        return
    times = [time for time, _, _ in listener.state.events]
    assert times == sorted(times)


def test_requests_that_nobody_can_answer_are_refused() -> None:
    scheduler, _ = schedule([Listener(SLOW)])
    with pytest.raises(BadSystem, match="no service answers the request 'push/gaol'"):
        scheduler.request("push/gaol", PushGoal())
    with pytest.raises(BadSystem, match="takes a CancelRequest, not a PushGoal"):
        scheduler.request("push/cancel", PushGoal())


def test_snapshots_and_journals_come_in_their_periods() -> None:
    timing = Timing(snapshot_period=SECOND // 2, journal_period=SECOND // 4)
    scheduler, tape = schedule([OdometrySource(Pace(0.1)), Listener(SLOW)], timing)
    scheduler.run(2 * SECOND)
    scheduler.finish()
    for node in ("odometry-source", "listener"):
        snapshots = tape.of(f"snapshot/{node}")
        assert [sample.time for sample in snapshots] == ms(0, 500, 1000, 1500, 2000)
        assert [sample.sequence for sample in snapshots] == [1, 2, 3, 4, 5]
        journals = tape.of(f"journal/{node}")
        assert [sample.time for sample in journals] == ms(*range(250, 2001, 250), 2000)
        firsts = [Journal.FromString(sample.payload) for sample in journals]
        ends = [batch.first + len(batch.kind) for batch in firsts]
        assert [batch.first for batch in firsts] == [0, *ends[:-1]]


def test_a_quiet_service_publishes_no_empty_batches() -> None:
    scheduler, tape = schedule([Silent(Nothing())], Timing(snapshot_period=1000 * SECOND))
    scheduler.run(3 * SECOND)
    scheduler.finish()
    assert len(tape.of("journal/silent")) == 2  # its start and first snapshot, and its end


def test_finish_leaves_nothing_in_the_journals() -> None:
    scheduler, tape = schedule([OdometrySource(Pace(0.1))])
    scheduler.run(249 * MILLISECOND)
    scheduler.finish()
    rows = [Journal.FromString(sample.payload) for sample in tape.of("journal/odometry-source")]
    # started, snapshot, twice fired and produced, finished
    assert sum(len(batch.kind) for batch in rows) == 7


def test_stop_ends_the_run_after_the_event() -> None:
    tape = Tape()

    def sink(sample: Sample) -> None:
        tape(sample)
        if sample.topic == "odometry" and sample.sequence == 3:
            scheduler.stop()

    scheduler = Scheduler([Node(OdometrySource(Pace(0.1)), None)], sink)
    scheduler.run(SECOND)
    assert len(tape.of("odometry")) == 3
    assert scheduler.now == 300 * MILLISECOND


class Cheat(Service):
    name = "cheat"
    Config = Nothing
    truth = Input(topics.TRUTH)

    def __init__(self, config: Nothing) -> None:
        super().__init__(config)
        self.state = Count()


class Rival(OdometrySource):
    name = "rival"


class OtherAnswerer(Service):
    name = "other-answerer"
    Config = Nothing
    cancel = RequestInput("push/cancel", CancelRequest)

    def __init__(self, config: Nothing) -> None:
        super().__init__(config)
        self.state = Count()

    @on(cancel)
    def answer(self, cancel: CancelRequest, now: Time) -> Effects:
        yield self.cancel.accept()


@pytest.mark.parametrize(
    ("services", "timing", "message"),
    [
        (
            [OdometrySource(SLOW), Rival(SLOW)],
            None,
            "topic 'odometry' has two publishers: 'odometry-source' and 'rival'",
        ),
        ([Listener(SLOW, "twin"), Listener(SLOW, "twin")], None, "'twin'"),
        ([Cheat(Nothing())], None, "'truth'"),
        ([Listener(SLOW), OtherAnswerer(Nothing())], None, "'push/cancel'"),
        ([Listener(SLOW)], Timing(duration={"lissener": 1}), "'lissener'; there are listener"),
        ([Listener(SLOW)], Timing(latency={("odometry", "lissener"): 1}), "'lissener'"),
        ([Listener(SLOW)], Timing(latency={("odometri", "*"): 1}), "'odometri'"),
        ([Listener(SLOW)], Timing(latency={("odometry", "*"): -1}), "-1"),
        ([Listener(SLOW)], Timing(duration={"listener": -1}), "-1"),
        ([Listener(SLOW)], Timing(snapshot_period=0), "snapshot"),
        ([Listener(SLOW)], Timing(journal_period=0), "journal"),
    ],
    ids=[
        "two publishers",
        "one name twice",
        "scoring only",
        "two answerers",
        "unknown in duration",
        "unknown in latency",
        "unknown topic",
        "negative latency",
        "negative duration",
        "no snapshot period",
        "no journal period",
    ],
)
def test_what_makes_no_system_is_refused_by_name(services: list[Service], timing: Timing | None, message: str) -> None:
    with pytest.raises(BadSystem, match=message):
        schedule(services, timing)


class Truthteller(Service):
    """A driver may publish what is for scoring only."""

    name = "truthteller"
    Config = Pace
    truth = Output(topics.TRUTH)
    tick = Timer(lambda config: config.period)

    def __init__(self, config: Pace) -> None:
        super().__init__(config)
        self.state = Count()

    @on(tick)
    def tell(self, now: Time) -> Effects:
        yield self.truth(Truth(stamp=now))


def test_the_truth_may_be_published() -> None:
    scheduler, tape = schedule([Truthteller(Pace(0.1))])
    scheduler.run(100 * MILLISECOND)
    assert len(tape.of("truth")) == 1


TIMINGS = st.builds(
    Timing,
    latency=st.fixed_dictionaries(
        {},
        optional={
            ("odometry", "relay"): st.integers(0, 10**8),
            ("robot/pose", "*"): st.integers(0, 10**8),
            ("command", "*"): st.integers(0, 10**8),
        },
    ),
    duration=st.fixed_dictionaries({}, optional={"relay": st.integers(0, 10**8), "listener": st.integers(0, 10**8)}),
    snapshot_period=st.integers(10**7, 10**9),
)


def system() -> list[Service]:
    return [OdometrySource(Pace(0.05)), CommandSource(Pace(0.02)), Relay(Nothing()), Listener(Pace(0.1))]


@settings(max_examples=20, deadline=None)
@given(TIMINGS)
def test_two_runs_give_the_same_bytes(timing: Timing) -> None:
    assert run(system(), SECOND, timing).samples == run(system(), SECOND, timing).samples


@settings(max_examples=20, deadline=None)
@given(TIMINGS, st.lists(st.integers(0, 10**9), max_size=4))
def test_cutting_a_run_into_pieces_changes_nothing(timing: Timing, cuts: list[int]) -> None:
    whole, tape_whole = schedule(system(), timing)
    whole.run(SECOND)
    pieces, tape_pieces = schedule(system(), timing)
    for cut in [*sorted(cuts), SECOND]:
        pieces.run(cut)
    assert tape_pieces.samples == tape_whole.samples


@settings(max_examples=20, deadline=None)
@given(TIMINGS)
def test_messages_of_a_link_arrive_in_order_and_in_time(timing: Timing) -> None:
    services = system()
    scheduler, tape = schedule(services, timing)
    scheduler.run(SECOND)
    listener = services[-1]
    assert isinstance(listener, Listener)
    sent = {sample.sequence: sample.time for sample in tape.of("command")}
    heard = listener.heard("command")
    assert [number for _, number in heard] == sorted({number for _, number in heard})
    for time, number in heard:
        assert time >= sent[number] + timing.link("command", "listener")
    duration = timing.duration.get("listener", 0)
    events = [time for time, _, _ in listener.state.events]
    assert all(b >= a + duration for a, b in zip(events, events[1:], strict=False))


def test_a_recorder_does_not_change_what_is_said(tmp_path: Path) -> None:
    plain = run(system(), 2 * SECOND)
    with Recorder(tmp_path / "a.mcap", of_this_machine("local", 1, []), b"{}") as recorder:
        tape = Tape()

        def both(sample: Sample) -> None:
            recorder(sample)
            tape(sample)

        nodes = [Node(service, None) for service in system()]
        scheduler = Scheduler(nodes, both)
        scheduler.run(2 * SECOND)
        scheduler.finish()
    assert tape.samples == plain.samples


def test_a_service_that_hears_nothing_new_says_the_same() -> None:
    """A listener more in the system changes no payload of the others."""
    alone = run(system()[:3], SECOND)
    watched = run([*system()[:3], Listener(Pace(0.01))], SECOND)
    for topic in ("odometry", "command", "robot/pose", "journal/relay", "snapshot/relay"):
        assert alone.of(topic) == watched.of(topic)


@pytest.mark.parametrize("broken", [lambda: PushTarget(distance_to_go=float("nan"))])
def test_a_mistake_of_a_service_stops_the_run(broken: Callable[[], PushTarget]) -> None:
    from runtime.node import BadHandler

    class Broken(OdometrySource):
        name = "broken"
        target = Output(topics.PUSH_TARGET)

        @on(OdometrySource.tick)
        def speak(self, now: Time) -> Effects:
            yield self.target(broken())

    scheduler, tape = schedule([Broken(Pace(0.1))])
    with pytest.raises(BadHandler, match="'broken' published 'push/target' with distance_to_go not finite"):
        scheduler.run(SECOND)
    assert tape.of("push/target") == []
