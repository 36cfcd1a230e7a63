"""What a service really consumed, under load and from several publishers, is what a replay gives it."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import zenoh

from replays import report
from replays.recording import Recording, load
from replays.replay import replay
from runtime.bus import envelope
from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import hub
from runtime.journal import entries
from runtime.messages import EntryKind
from runtime.recorder import header
from runtime.recorder.writer import Recorder
from runtime.sample import Sample
from tests.fast_hosts import KINDS
from tests.figures import Figures
from tests.live_system import free_endpoint

ROUNDS = 20
ROUND = 1.2
BURNERS = 2


@contextmanager
def processes(endpoint: str) -> Iterator[list[subprocess.Popen[str]]]:
    """Start a process for each service, and end them."""
    command = [sys.executable, "-m", "tests.fast_hosts"]
    started = [
        subprocess.Popen([*command, name, endpoint], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        for name in KINDS
    ]
    burners = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(BURNERS)]
    try:
        for process in started:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
        yield started
    finally:
        for burner in burners:
            burner.kill()
            burner.wait()
        for process in started:
            process.communicate(timeout=30)


def one_round(session: zenoh.Session, hosts: list[subprocess.Popen[str]], robot: str, path: Path) -> Recording:
    """Let all of them live for a moment, and record what they said in the order in which it came here."""
    keys = Keys(robot)
    heard: list[Sample] = []

    def hear(sample: zenoh.Sample) -> None:
        heard.append(envelope.opened(keys.name(str(sample.key_expr)), sample))

    subscriber = session.declare_subscriber(keys.everything(), hear)
    for process in hosts:
        assert process.stdin is not None
        process.stdin.write(f"{robot} {ROUND}\n")
        process.stdin.flush()
    for process in hosts:
        assert process.stdout is not None
        assert process.stdout.readline() == "done\n"
    time.sleep(0.1)
    subscriber.undeclare()
    config = json.dumps({"sections": {name: {} for name in KINDS}}).encode()
    with Recorder(path, header.of_this_machine("live", 0, list(KINDS)), config) as recorder:
        for sample in dict.fromkeys(heard):  # latched values come again and again
            recorder(sample)
    return load(path)


def test_what_was_consumed_under_load_replays_every_time(tmp_path: Path, figures: Figures) -> None:
    endpoint = free_endpoint()
    consumed, swaps = 0, 0
    with (
        hub(BusConfig(listen=(endpoint,), connect=(endpoint,))) as session,
        processes(endpoint) as hosts,
    ):
        for number in range(ROUNDS):
            recording = one_round(session, hosts, f"round-{number}", tmp_path / f"{number}.mcap")
            result = replay(recording, services=KINDS.__getitem__)
            assert result.identical, "\n".join(report.text(result))
            assert all(node.complete for node in result.nodes)
            order = [
                (one.name, one.sequence)
                for one in entries(recording.journals["mixer"])
                if one.kind == EntryKind.MESSAGE
            ]
            consumed += len(order)
            # By time of publication, what came in another order than it was sent.
            times = [recording.samples[key].time for key in order]
            swaps += sum(after < before for before, after in pairwise(times))
    figures(f"{ROUNDS} of {ROUNDS} runs replayed identically: {consumed} messages, {swaps} not in the order sent")
    assert consumed > 1000 * ROUNDS * ROUND * 0.3
    assert swaps > 0  # otherwise any order would have done
