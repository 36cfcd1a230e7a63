"""One run of the experiments from beginning to end: trials, recordings of failures, report."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from experiments.paper import report, running
from experiments.paper.cells import STARTS, Task, cell_of, cells, tasks
from experiments.paper.store import Store
from experiments.paper.trial import Outcome, session_of
from runtime.config.layers import ConfigError, Layer
from runtime.outputs import writing


@dataclass(frozen=True, kw_only=True)
class Run:
    """How a run is to be made; see the options of `pushlane experiment all`."""

    trials: int
    jobs: int
    first_seed: int
    folder: Path
    failures: int
    drawn: bool
    layers: list[Layer]
    command: str


@dataclass(frozen=True, kw_only=True)
class Order(Run):
    """What is to be run; see the options of `pushlane experiment all`."""

    experiments: tuple[str, ...]
    methods: tuple[str, ...]
    starts: tuple[str, ...]


def carry_out(order: Order) -> bool:
    """Carry out `order`, print the tables and write the report. Returns False if it was interrupted.

    Raises:
        ConfigError, UnknownMethod, BadRun, CannotScale, NoRoomToStart, WorkerDied: see there.
    """
    wrong = [name for name in order.starts if name not in STARTS]
    if wrong:
        raise ConfigError(f"--starts: no start is called '{wrong[0]}'; expected some of {', '.join(STARTS)}")
    wanted = list(tasks(cells(order.experiments, order.methods, order.starts), order.trials, order.first_seed))
    if not wanted:
        raise ConfigError(
            f"--methods {','.join(order.methods)}: no method of {', '.join(order.experiments)} among them"
        )
    store, whole, kept = pushed(order, wanted, lambda one: cell_of(one).name)
    with writing(order.folder):
        found = report.write(
            order.folder,
            store.facts,
            store.outcomes,
            order.layers,
            order.command,
            order.jobs,
            kept,
            order.drawn and whole,
        )
    for table in found:
        print(table.markdown(), end="\n\n")
    print(f"{order.folder / 'report.md'}: {len(store.outcomes)} trials", flush=True)
    return whole


def pushed(
    order: Run, wanted: list[Task], cell: Callable[[Task], str]
) -> tuple[Store, bool, list[tuple[Outcome, Path]]]:
    """Run those of `wanted` that are not in the folder yet, and record failures.

    Args:
        cell: the folder that a task's recording goes to; failures are counted for each.

    Returns:
        The store, closed; False if it was interrupted; the failures that are recorded, with their files.

    Raises:
        ConfigError, BadRun, CannotScale, CannotAlter, NoRoomToStart, WorkerDied: see there.
    """
    _check(wanted, order.layers)
    store = Store(order.folder, order.layers, order.first_seed)
    done = {one.key for one in store.outcomes}
    left = [one for one in wanted if one.key not in done]
    if len(left) < len(wanted):
        print(f"{len(wanted) - len(left)} of {len(wanted)} trials are there already", flush=True)
    whole = True
    try:
        running.attempts(left, order.layers, order.jobs, store.add)
    except KeyboardInterrupt:
        whole = False
        print("interrupted: the report is of the trials there are; the same command goes on", flush=True)
    finally:
        store.close()
    return store, whole, _recorded(store.outcomes, order, cell) if whole else []


def _check(wanted: list[Task], layers: list[Layer]) -> None:
    """Raise what would go wrong with every trial of a scene before the first is run."""
    first: dict[tuple[str, ...], Task] = {}
    for one in wanted:
        # What a case sets may be refused for one object and not for another.
        first.setdefault((one.scene, one.start, one.settings, one.object if one.settings else ""), one)
    for one in first.values():
        session_of(one, layers)


def _recorded(outcomes: Iterable[Outcome], order: Run, cell: Callable[[Task], str]) -> list[tuple[Outcome, Path]]:
    """Record the first failures of each cell that are not recorded yet; returns all that are."""
    by_cell: dict[str, list[Outcome]] = defaultdict(list)
    for one in outcomes:
        if not one.success:
            by_cell[cell(one)].append(one)
    kept = []
    for folder, failed in by_cell.items():
        failed.sort(key=lambda one: one.seed)
        first = failed[: order.failures if order.failures >= 0 else None]
        kept += [(one, order.folder / "failures" / folder / f"seed-{one.seed}.mcap") for one in first]
    missing = [(_task(one), path) for one, path in kept if not path.exists()]
    for _, path in missing:
        with writing(path.parent):
            path.parent.mkdir(parents=True, exist_ok=True)
    running.recordings(missing, order.layers, order.jobs)
    return kept


def _task(one: Outcome) -> Task:
    return Task(**{name: getattr(one, name) for name in Task.__struct_fields__})
