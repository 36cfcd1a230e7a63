"""What must hold of every service: its snapshot is its whole state, and truth is for scoring only."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from experiments.session import Session, prepare, run
from experiments.systems import NODES
from runtime import registry, topics
from runtime.config.layers import Layer
from runtime.guard import Guard
from runtime.messages import Alive, CancelRequest, PushGoal, Request, Snapshot, Vector2
from runtime.node import Node
from runtime.sample import Sample
from runtime.time import MILLISECOND, Time
from runtime.topics import TOPICS

Event = tuple[str, str, int, int]  # kind, name, which, ms since the event before

_LAYER = Layer("test", {"sim": {"scene": "living-room", "object": "cart", "seed": 3, "time_limit": 6.0}})


@cache
def _session() -> Session:
    return prepare([_LAYER])


@cache
def _recorded() -> dict[str, list[Sample]]:
    """Real messages by topic, to make events from."""
    samples: dict[str, list[Sample]] = {}
    run(_session(), sinks=[lambda sample: samples.setdefault(sample.topic, []).append(sample)])
    return samples


@cache
def _learned() -> list[Sample]:
    """The predictive method's own topic, from a push with it."""
    samples: list[Sample] = []
    method = Layer("test", {"sim": {"strategy": "predictive", "controller": "predictive"}})
    run(prepare([_LAYER, method]), sinks=[lambda one: samples.append(one) if one.topic == "push/response" else None])
    return samples


def _samples(topic: str) -> list[Sample]:
    if topic == topics.PUSH_RESPONSE.name:
        return _learned()
    if topic != topics.ALIVE.name:
        return _recorded()[topic]
    # Only live systems call the roll.
    rolls = [Alive(stamp=1, nodes=nodes).SerializeToString() for nodes in (["controller", "driver"], ["driver"])]
    return [Sample(topic, number, 1, roll) for number, roll in enumerate(rolls, 1)]


def _node(name: str, guard: Guard) -> Node:
    return Node(registry.service_class(name)(_session().effective.sections[name]), guard)


def _apply(node: Node, events: Iterable[Event], start: Time) -> tuple[list[Sample], Time]:
    given_out: list[Sample] = []
    now = start
    for kind, name, which, wait in events:
        now += wait * MILLISECOND
        if kind == "message":
            choice = _samples(name)
            given_out += node.consume(choice[which % len(choice)], now, now)
        elif kind == "timer":
            given_out += node.fire(name, which, now, now)
        else:
            goal = PushGoal(position=Vector2(x=2.0 + which % 3, y=2.0), strategy=["", "strict", "no"][which % 3])
            message = goal if name == "push/goal" else CancelRequest(reason="enough")
            given_out += node.ask(Request(id=which, name=name, payload=message.SerializeToString()), now, now)
    return given_out, now


def _events(name: str) -> st.SearchStrategy[list[Event]]:
    contract = registry.service_class(name).contract
    kinds = [("message", topic) for topic in contract.inputs]
    kinds += [("timer", timer) for timer in contract.timers]
    kinds += [("request", request) for request in contract.requests]
    one = st.tuples(st.sampled_from(kinds), st.integers(1, 400), st.integers(0, 60))
    return st.lists(one.map(lambda drawn: (*drawn[0], drawn[1], drawn[2])), max_size=40)


@pytest.mark.parametrize("name", NODES)
@settings(max_examples=12, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_a_restored_service_goes_on_as_if_it_had_never_stopped(name: str, data: st.DataObject) -> None:
    _recorded(), _learned()
    before, after = data.draw(_events(name)), data.draw(_events(name))
    with Guard() as guard:
        one = _node(name, guard)
        one.begin(0)
        _, now = _apply(one, before, 0)
        snapshot = Snapshot.FromString(one.take_snapshot(now).payload)
        other = _node(name, guard)
        other.resume(snapshot)
        samples, end = _apply(one, after, now)
        again, _ = _apply(other, after, now)
        assert again == samples
        assert other.journal.digest == one.journal.digest
        assert other.take_snapshot(end) == one.take_snapshot(end)


def test_no_service_subscribes_to_what_is_for_scoring_only() -> None:
    secret = {topic.name for topic in TOPICS.values() if topic.scoring_only}
    assert secret == {"truth"}
    for name, place in registry.SERVICES.items():
        if place.startswith("services."):
            assert not secret & set(registry.service_class(name).contract.inputs), name


@pytest.mark.parametrize("kind", ["same process", "recorded"])
def test_the_same_seed_gives_the_same_bytes(kind: str, tmp_path: Path) -> None:
    again: dict[str, list[Sample]] = {}
    record = tmp_path / "a.mcap" if kind == "recorded" else None
    run(prepare([_LAYER]), record, sinks=[lambda sample: again.setdefault(sample.topic, []).append(sample)])
    assert again == _recorded()


def test_another_seed_gives_other_bytes() -> None:
    other: dict[str, list[Sample]] = {}
    layer = Layer("test", {"sim": {"seed": 4}})
    run(prepare([_LAYER, layer]), sinks=[lambda sample: other.setdefault(sample.topic, []).append(sample)])
    assert other["truth"] != _recorded()["truth"]
