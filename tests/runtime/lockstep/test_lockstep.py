"""Distribution changes nothing: in lockstep every message, journal and snapshot is as in one process."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from experiments.session import prepare, run
from experiments.systems import NODES
from replays.recording import load
from replays.replay import replay
from runtime.bus.config import BusConfig
from runtime.config.layers import Layer
from runtime.lockstep.run import Place, Spread, StepFailed, on_this_machine, workers
from tests.netns import hosts, needs_netns

LAYER = Layer("test", {"sim": {"scene": "open", "goal": [1.6, 0.3], "object": "dino", "seed": 11}})


def test_services_in_their_own_processes_give_the_same_session(tmp_path: Path) -> None:
    session = prepare([LAYER])
    run(session, tmp_path / "local.mcap")
    run(session, tmp_path / "lockstep.mcap", lockstep=on_this_machine())
    assert_same(tmp_path / "local.mcap", tmp_path / "lockstep.mcap")


@needs_netns
def test_services_on_two_hosts_give_the_same_session(tmp_path: Path) -> None:
    session = prepare([LAYER])
    run(session, tmp_path / "local.mcap")
    with hosts(2) as (robot, laptop):
        listen = tuple(f"tcp/{host.here}:7448" for host in (robot, laptop))
        on_robot, on_laptop = (
            Place(host.prefix, [endpoint]) for host, endpoint in zip((robot, laptop), listen, strict=True)
        )
        places = {name: on_robot if name in ("driver", "controller") else on_laptop for name in NODES}
        run(session, tmp_path / "lockstep.mcap", lockstep=Spread(BusConfig(listen=listen, connect=listen), places))
    assert_same(tmp_path / "local.mcap", tmp_path / "lockstep.mcap")
    assert replay(load(tmp_path / "lockstep.mcap")).identical


def test_a_worker_that_cannot_start_is_named() -> None:
    spread = on_this_machine()
    broken = Spread(spread.bus, {"task": Place(prefix=("false",))})
    session = prepare([LAYER])
    with (
        pytest.raises(StepFailed, match="worker 'task' ended with 1"),
        workers(session.effective.sections, ["strategy", "task"], broken),
    ):
        pass


def test_a_worker_without_a_hub_says_so() -> None:
    command = [sys.executable, "-m", "runtime.lockstep.worker", "task", "--connect", "tcp/127.0.0.1:9"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert ended.returncode == 2
    assert "no hub at tcp/127.0.0.1:9" in ended.stderr
    assert "Traceback" not in ended.stderr


def assert_same(local: Path, lockstep: Path) -> None:
    a, b = load(local), load(lockstep)
    assert a.samples == b.samples
    assert a.journals == b.journals
    assert a.snapshots == b.snapshots
    assert (a.header.mode, b.header.mode) == ("local", "lockstep")
    assert len(a.samples) > 1000
