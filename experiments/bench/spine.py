"""How fast a push runs in this process, part by part, and how fast it replays.

Machines differ and are shared, so each total stands beside a yardstick measured in the same process: the bare
physics of the same push, stepped with nothing around it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import drivers.sapien.service as driver_module
from drivers.sapien.world import SUBSTEP, World
from experiments.session import Session, prepare, run
from experiments.systems import NODES
from replays.recording import load
from replays.replay import replay
from runtime.config.layers import Layer
from runtime.journal import JournalWriter
from runtime.node import Node
from runtime.recorder.writer import Recorder
from runtime.time import seconds

_RUNS = 3


class Stopwatch:
    """Sums up the s spent in labelled calls, without those of labelled calls inside them."""

    def __init__(self) -> None:
        self.spent: dict[str, float] = {}
        self.calls: dict[str, int] = {}
        self._inner = [0.0]

    def wrapped(self, call: Callable[..., Any], label: Callable[..., str]) -> Callable[..., Any]:
        """Return `call`, timed under the label that `label` gives for its arguments."""

        def timed(*args: Any, **kwargs: Any) -> Any:
            self._inner.append(0.0)
            begin = perf_counter()
            try:
                return call(*args, **kwargs)
            finally:
                took = perf_counter() - begin
                name = label(*args)
                self.spent[name] = self.spent.get(name, 0.0) + took - self._inner.pop()
                self.calls[name] = self.calls.get(name, 0) + 1
                self._inner[-1] += took

        return timed


@contextmanager
def _timed(watch: Stopwatch, owner: Any, name: str, label: str | Callable[..., str]) -> Iterator[None]:
    original = getattr(owner, name)
    setattr(owner, name, watch.wrapped(original, label if callable(label) else lambda *_: label))
    try:
        yield
    finally:
        setattr(owner, name, original)


def main() -> None:
    """Print the figures."""
    session = prepare([Layer("bench", {"sim": {"seed": 1}})])
    run(session)  # warm up
    with TemporaryDirectory() as folder:
        file = Path(folder) / "session.mcap"
        simulated = seconds(run(session, file, overwrite=True).end)
        yardstick = _best(lambda: _bare_physics(session, simulated))
        print(f"one push of {simulated:.1f} simulated s ({session.sim.scene}), medians of {_RUNS} runs, one process")
        for label, work in (
            ("bare physics, the yardstick", lambda: _bare_physics(session, simulated)),
            ("all services, no recorder", lambda: run(session)),
            ("all services, recorder on", lambda: run(session, file, overwrite=True)),
            ("the same, handlers unguarded", lambda: run(session, file, guarded=False, overwrite=True)),
            ("replay of all services and the driver", lambda: replay(load(file))),
        ):
            took = _best(work)
            print(f"  {label:<40} {simulated / took:7.1f} times real time, {took / yardstick:5.2f} times bare physics")
        _parts(session, file, simulated)


def _parts(session: Session, file: Path, simulated: float) -> None:
    watch = Stopwatch()
    with ExitStack() as stack:
        for owner, name, label in (
            (World, "step", "physics"),
            (World, "state", "snapshot of the world"),
            (driver_module, "laser_scan", "sensors: laser"),
            (driver_module, "ring_ranges", "sensors: infra-red"),
            (Node, "_run", lambda node, *_: f"service {node.name}"),
            (Node, "_encode", "encoding and finite check"),
            (Node, "take_snapshot", "snapshots"),
            (JournalWriter, "add", "journal"),
            (JournalWriter, "batch", "journal"),
            (Recorder, "__call__", "recorder"),
        ):
            stack.enter_context(_timed(watch, owner, name, label))
        begin = perf_counter()
        run(session, file, overwrite=True)
        total = perf_counter() - begin
    watch.spent["scheduler, decoding, the rest"] = total - sum(watch.spent.values())
    print(f"  by part, instrumented (which itself slows it), {1000 * total / simulated:.2f} ms a simulated s:")
    for label, spent in sorted(watch.spent.items(), key=lambda item: -item[1]):
        calls = watch.calls.get(label, 0)
        each = f"{1e6 * spent / calls:8.1f} us a call" if calls else ""
        print(f"    {label:<34} {1000 * spent / simulated:6.2f} ms, {100 * spent / total:4.1f} %  {each}")
    print(f"    (services: {', '.join(NODES)})")


def _bare_physics(session: Session, simulated: float) -> None:
    config: Any = session.world
    world = World(config.scene, config.body, config.base)
    world.command(0.3, 0.0, 0.0)
    for _ in range(round(simulated / 0.05)):
        world.step(round(0.05 / SUBSTEP))


def _best(work: Callable[[], object]) -> float:
    """Return the median s that `work` takes."""
    took = []
    for _ in range(_RUNS):
        begin = perf_counter()
        work()
        took.append(perf_counter() - begin)
    return median(took)
