"""A whole push as a user drives an emulated base: real sockets, a real pseudo-terminal, all from its own sensors."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from tests.figures import Figures
from tests.live_system import free_endpoint

PUSHLANE = Path(sys.executable).parent / "pushlane"
GOAL = re.compile(r"push --to (\S+) (\S+)")
PLACE = re.compile(r"object at \((\S+), (\S+)\)")
LONG = 90.0


@contextmanager
def started(folder: Path, log: str, *arguments: str) -> Iterator[Path]:
    """Run a command in the background; its lines are in the file that is given."""
    file = folder / log
    with file.open("w") as out:
        process = subprocess.Popen(
            [PUSHLANE, *arguments], cwd=folder, stdout=out, stderr=subprocess.STDOUT, start_new_session=True
        )
        try:
            yield file
        finally:
            process.send_signal(signal.SIGINT)
            with suppress(subprocess.TimeoutExpired):
                process.wait(30)
            process.kill()
            process.wait()


def says(file: Path, what: str) -> str:
    """Return what a command has said, once `what` is in it."""
    end = time.monotonic() + LONG
    while what not in (text := file.read_text()):
        assert time.monotonic() < end, f"'{what}' was not said: {text}"
        time.sleep(0.2)
    return text


@pytest.mark.slow
@pytest.mark.render
@pytest.mark.alone
@pytest.mark.parametrize("link", ["rest", "serial"])
def test_a_push_through_the_real_protocol_is_delivered_and_replayed(
    link: str, tmp_path: Path, figures: Figures
) -> None:
    endpoint = free_endpoint()
    world = ["--set", "sim.scene=living-room", "--set", "sim.object=box"]
    place = ["--set", f'bus.listen=["{endpoint}"]', "--set", f'bus.connect=["{endpoint}"]']
    with started(
        tmp_path, "base.log", "robotino", "emulate", link, "--port", "0", "--system", "all.toml", *world
    ) as base:
        said = says(base, "push --to")
        goal = GOAL.search(said)
        url = re.search(r"http://\S+", said)
        assert goal is not None and url is not None
        with started(tmp_path, "run.log", "run", "all.toml", "-o", "push.mcap", *place) as run:
            says(run, "all services are up")
            with started(
                tmp_path, "feed.log", "camera", "feed", f"{url[0]}/cam0", "--config", "all.toml", *place
            ) as feed:
                says(feed, "feeding")
                time.sleep(5.0)
                found = subprocess.run(
                    [PUSHLANE, "push", "--to", goal[1], goal[2], "--config", "all.toml", *place],
                    cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False,
                )  # fmt: skip
                time.sleep(6.0)  # the base says every 5 s where things are
    last = PLACE.findall(base.read_text())[-1]
    off = [float(last[k]) - float(goal[k + 1]) for k in range(2)]
    figures(f"{link}: {found.stdout.strip().splitlines()[-1]}; truly {off[0]:+.2f}, {off[1]:+.2f} m from the goal")
    assert found.returncode == 0, found.stdout + found.stderr
    assert max(map(abs, off)) <= 0.1
    replayed = subprocess.run(
        [PUSHLANE, "replay", "push.mcap"], cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
    )
    figures(f"{link}: {replayed.stdout.strip().splitlines()[-1]}")
    assert replayed.returncode == 0, replayed.stdout
