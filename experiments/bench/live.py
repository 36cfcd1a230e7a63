"""How well a live push keeps its time: a system of processes on this machine, read from what it recorded.

Printed are the error of the control period, and how old what the object's position became is at each hop: seen by
perception, published, in the controller's hands, published as a command, in the driver's hands.
"""

from __future__ import annotations

import socket
import threading
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from experiments.session import prepare
from experiments.systems import NODES
from replays.recording import Recording, load
from runtime.bus.config import BusConfig
from runtime.config.layers import Layer
from runtime.journal import entries
from runtime.live.launcher import Launcher
from runtime.live.operate import follow_push
from runtime.messages import EntryKind, ObjectState, VelocityCommand

_EDGES = (0.0, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, np.inf)
_BAR = 40


def main() -> None:
    """Print the figures."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / "session.mcap"
        delivered = record(file)
        recording = load(file)
    errors = period_errors(recording)
    print(f"a live push, {len(NODES)} services and the recorder each in a process; delivered: {delivered}")
    p50, p99 = np.percentile(1000 * errors, [50, 99])
    print(
        f"control period of 50 ms, {len(errors)} periods: error median {p50:.2f} ms, p99 {p99:.2f} ms, "
        f"longest {1000 * errors.max():.2f} ms (bar: p99 under 10 ms)"
    )
    for name, ages in hops(recording).items():
        print(f"{name}: median {1000 * np.median(ages):.1f} ms, p99 {1000 * np.percentile(ages, 99):.1f} ms")
        counts, _ = np.histogram(ages, _EDGES)
        for (low, high), count in zip(pairwise(_EDGES), counts, strict=True):
            if count:
                bar = "#" * max(1, round(_BAR * count / len(ages)))
                print(f"  {1000 * low:5.0f} to {1000 * high:3.0f} ms {count:6d} {bar}")


def record(file: Path) -> bool:
    """Run a push on a live system, recorded to `file`. Returns whether it was delivered."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    bus = {"robot": "bench", "listen": [endpoint], "connect": [endpoint]}
    session = prepare([Layer("bench", {"sim": {"seed": 1, "scene": "open", "goal": [2.0, 0.5]}, "bus": bus})])
    place = session.effective.sections["bus"]
    assert isinstance(place, BusConfig)
    launcher = Launcher(session.plan(), place, NODES, file, say=lambda _: None)
    thread = threading.Thread(target=launcher.run)
    thread.start()
    try:
        while not launcher.ready():
            threading.Event().wait(0.1)
        return follow_push(place, session.goal, lambda _: None)
    finally:
        launcher.stop()
        thread.join()


def period_errors(recording: Recording) -> NDArray[np.float64]:
    """Return how far each time between two commands was from 50 ms, s."""
    times = [s.time for (topic, _), s in sorted(recording.samples.items()) if topic == "command"]
    return np.abs(np.diff(np.array(times)) / 1e9 - 0.05)


def hops(recording: Recording) -> dict[str, NDArray[np.float64]]:
    """Return the ages, s, of the object's position at each hop and on the whole way, for each command obeyed.

    The journals say which position the controller had when it spoke, and when the driver took the command.
    """
    taken: dict[int, int] = {}  # command -> when the driver had it
    for entry in entries(recording.journals["driver"]):
        if entry.kind == EntryKind.MESSAGE and entry.name == "command":
            taken[entry.sequence] = entry.time
    rows = []
    position: tuple[int, int] | None = None  # sequence, when the controller had it
    for entry in entries(recording.journals["controller"]):
        if entry.kind == EntryKind.MESSAGE and entry.name == "object/state":
            position = entry.sequence, entry.time
        elif entry.kind == EntryKind.PRODUCED and entry.name == "command" and position and entry.sequence in taken:
            seen = recording.samples[("object/state", position[0])]
            command = recording.samples[("command", entry.sequence)]
            twist = VelocityCommand.FromString(command.payload).twist
            if twist.vx or twist.vy:
                stamp = ObjectState.FromString(seen.payload).stamp
                rows.append((stamp, seen.time, position[1], command.time, taken[entry.sequence]))
    names = (
        "seen -> published (the perception's own delay of 50 to 100 ms)",
        "published -> with the controller",
        "with the controller -> command (waits for its period)",
        "command -> with the driver",
    )
    table = np.array(rows, dtype=np.int64)
    steps = np.diff(table, axis=1) / 1e9
    found = {name: steps[:, index] for index, name in enumerate(names)}
    return found | {"the whole way, object seen -> command received": (table[:, -1] - table[:, 0]) / 1e9}
