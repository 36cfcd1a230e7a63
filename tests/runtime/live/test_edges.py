"""What comes over the bus and is no message of ours changes nothing, and is counted exactly."""

from __future__ import annotations

import random
import time
from pathlib import Path

import pytest
import zenoh
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message

from experiments.systems import NODES
from replays import report
from replays.recording import load
from replays.replay import replay
from runtime import registry
from runtime.bus import envelope
from runtime.bus.session import client
from runtime.live.inbox import Arrivals, Inbox
from runtime.messages import Health, PushOutcome, PushPhase
from runtime.sample import INCARNATION, Sample
from runtime.topics import TOPICS
from tests.figures import Figures
from tests.live_system import System, running, short_session

GARBAGE = 100_000
BURST = 5_000


def memory(pid: int) -> int:
    """Return the resident memory of a process, kB."""
    text = Path(f"/proc/{pid}/status").read_text()
    return int(next(line.split()[1] for line in text.splitlines() if line.startswith("VmRSS")))


def refused(system: System) -> dict[tuple[str, str], int]:
    """Return what each service has refused of each input, by its newest health message."""
    found = {}
    for name in NODES:
        health = Health.FromString(system.heard[f"health/{name}"][-1].payload)
        for row in health.inputs:
            found[(name, row.topic)] = row.refused
    return found


def spoiled(message: Message, generator: random.Random) -> bool:
    """Put a number that is not finite into the first float field of `message`. Returns whether it has one."""
    value = generator.choice([float("nan"), float("inf"), -float("inf")])
    for field in message.DESCRIPTOR.fields:
        if field.type in (FieldDescriptor.TYPE_DOUBLE, FieldDescriptor.TYPE_FLOAT):
            if field.is_repeated:
                getattr(message, field.name).append(value)
            else:
                setattr(message, field.name, value)
            return True
        if field.type == FieldDescriptor.TYPE_MESSAGE:
            inner = getattr(message, field.name)
            if spoiled(inner.add() if field.is_repeated else inner, generator):
                return True
    return False


def garbage(generator: random.Random, topic: str, known: list[bytes]) -> tuple[bytes, bytes | None]:
    """Return (payload, attachment) that no service may take."""
    kind = generator.randrange(5)
    honest = envelope.pack(generator.randrange(1, 1000), time.time_ns())
    if kind == 0:  # no envelope
        return generator.choice(known), None
    if kind == 1:  # an envelope of another length
        return generator.choice(known), generator.randbytes(generator.choice([0, 1, 15, 17, 400]))
    if kind == 2:  # a message from a sequence that cannot be
        return generator.choice(known), envelope.pack(generator.randrange(1 << 40, 1 << 63), time.time_ns())
    if kind == 3:  # numbers that are not finite
        message = TOPICS[topic].message.FromString(generator.choice(known))
        if spoiled(message, generator):
            return message.SerializeToString(), honest
    # a field with a wire type that does not exist
    return bytes([(generator.randrange(1, 16) << 3) | 7]) + generator.randbytes(20), honest


@pytest.mark.alone
def test_garbage_changes_nothing_and_is_counted(figures: Figures, tmp_path: Path) -> None:
    consumers: dict[str, list[str]] = {}
    for name in NODES:
        for topic in registry.service_class(name).contract.inputs:
            consumers.setdefault(topic, []).append(name)
    topics = list(consumers)
    generator = random.Random(3)
    path = tmp_path / "garbage.mcap"
    with running(short_session("garbage", goal=[0.3, 0.1], time_limit=120), path) as system:
        assert system.ask_for_push().accepted
        system.wait(lambda: system.status().phase == PushPhase.PUSHING, 10.0, "pushing")
        time.sleep(1.5)
        before, sizes = refused(system), {name: memory(pid) for name, pid in system.launcher.pids.items()}
        known = {topic: [one.payload for one in system.heard.get(topic, [])[-20:]] or [b""] for topic in topics}
        sent = dict.fromkeys(topics, 0)
        began = time.monotonic()

        def missing() -> dict[tuple[str, str], int]:
            counted = refused(system)
            rows = [(name, topic) for topic, names in consumers.items() for name in names]
            return {row: sent[row[1]] - counted[row] + before[row] for row in rows}

        with client(system.bus) as attacker:
            for number in range(1, GARBAGE + 1):
                topic = generator.choice(topics)
                payload, attachment = garbage(generator, topic, known[topic])
                # Blocking, so that Zenoh itself drops none and every one must be counted.
                block = zenoh.CongestionControl.BLOCK
                attacker.put(system.keys.topic(topic), payload, attachment=attachment, congestion_control=block)
                sent[topic] += 1
                if number % BURST == 0:
                    # Zenoh closes a link that has blocked its sender for 5 s, and a flooded host leaves out its
                    # oldest: no more is sent before all was counted, however slow this machine is.
                    system.wait(lambda: not any(missing().values()), 30.0, f"all of {number} counted")
        took = time.monotonic() - began
        # The task speaks five times a second: what is heard last is no garbage any more.
        time.sleep(1.0)
        status = system.wait_for_end(110.0)
        time.sleep(2.5)
        after = refused(system)
        grown = {name: memory(pid) - sizes[name] for name, pid in system.launcher.pids.items()}
    grew = max(grown.values())
    figures(f"{GARBAGE} payloads over {len(topics)} topics in {took:.1f} s; memory grew by at most {grew} kB")
    assert status.outcome == PushOutcome.DELIVERED
    assert max(system.launcher.restarts.values()) == 0
    for topic, names in consumers.items():
        for name in names:
            assert after[(name, topic)] - before[(name, topic)] == sent[topic], (name, topic)
    assert max(grown.values()) < 40_000
    # What the services consumed, commands among it, is what services sent, and nothing else.
    found = replay(load(path))
    consumed = {name: node.events for name, node in zip(NODES, found.nodes, strict=True)}
    assert found.identical, "\n".join(report.text(found))
    assert all(count > 100 for count in consumed.values())


def sample(sequence: int, topic: str = "odometry") -> Sample:
    return Sample(topic, sequence, 0, b"")


def taken(inbox: Inbox[Sample]) -> list[int]:
    found = []
    while (item := inbox.get()) is not None:
        found.append(item.sequence)
    return found


def test_gaps_repeats_and_restarts_are_told_apart() -> None:
    inbox: Inbox[Sample] = Inbox(frozenset())
    said = [
        inbox.put(sample(sequence), sample(sequence))
        for sequence in (5, 6, 9, 9, 7, INCARNATION + 1, INCARNATION + 2, 10, 1 << 45)
    ]
    assert taken(inbox) == [5, 6, 9, INCARNATION + 1, INCARNATION + 2]
    count = inbox.counts["odometry"]
    assert (count.lost, count.repeated) == (2, 3)
    assert said[:-1] == [""] * 8
    assert str(1 << 45) in said[-1]


def test_latest_only_keeps_the_place_and_takes_the_newest() -> None:
    inbox: Inbox[Sample] = Inbox(frozenset({"command"}))
    for one in (sample(1, "command"), sample(1), sample(2), sample(2, "command"), sample(3, "command")):
        inbox.put(one, one)
    first = inbox.get()
    assert first is not None
    assert (first.topic, first.sequence) == ("command", 3)
    assert taken(inbox) == [1, 2]
    assert inbox.counts["command"].dropped == 2


def test_a_full_inbox_drops_the_oldest_and_stays_bounded() -> None:
    inbox: Inbox[Sample] = Inbox(frozenset(), limit=100)
    for sequence in range(1, 1001):
        inbox.put(sample(sequence), sample(sequence))
    assert len(inbox) == 100
    assert taken(inbox) == list(range(901, 1001))
    assert inbox.counts["odometry"].dropped == 900


def test_requests_that_nobody_takes_are_refused_beyond_a_number() -> None:
    inbox: Inbox[int] = Inbox(frozenset())
    assert [inbox.ask(number) for number in range(102)] == [True] * 100 + [False] * 2
    assert inbox.get() == 0
    assert inbox.ask(102)


def test_arrivals_behind_a_slow_handler_stay_bounded_and_keep_the_newest() -> None:
    arrivals: Arrivals[int] = Arrivals(limit=100)
    for number in range(1000):
        arrivals.put("scan", number)
    assert [arrivals.get(0.0) for _ in range(101)] == [("scan", number) for number in range(900, 1000)] + [None]
    assert arrivals.dropped == {"scan": 900}
