"""Runs trials in a pool of processes and shows how far it is."""

from __future__ import annotations

import multiprocessing
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from types import FrameType
from typing import TypeVar

import msgspec
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from experiments.paper.cells import Task
from experiments.paper.trial import Outcome, attempt, record
from runtime.config.layers import Layer
from runtime.errors import PushlaneError

T = TypeVar("T")
R = TypeVar("R")

_LINE_EVERY = 60.0
"""s between lines where there is no terminal."""


class WorkerDied(PushlaneError):
    """A process of the pool ended by itself; finished trials are kept."""

    exit_code = 2


def attempts(wanted: Sequence[Task], layers: Sequence[Layer], jobs: int, keep: Callable[[Outcome], None]) -> None:
    """Run `wanted` in `jobs` processes; each outcome goes to `keep` as soon as it is there, in no certain order.

    Raises:
        KeyboardInterrupt: Ctrl-C or SIGTERM came; trials under way are dropped.
        WorkerDied: see there.
    """
    packed = _pack(layers)
    with shown("pushing", len(wanted)) as advance:
        for outcome in _mapped(_attempt, ((packed, task) for task in wanted), jobs):
            keep(outcome)
            advance()


def recordings(wanted: Sequence[tuple[Task, Path]], layers: Sequence[Layer], jobs: int) -> None:
    """Run every task once more, recording it to its path.

    Raises:
        KeyboardInterrupt, WorkerDied, CannotRecord: see there.
    """
    if not wanted:
        return
    packed = _pack(layers)
    with shown("recording failures", len(wanted)) as advance:
        for _ in _mapped(_record, ((packed, task, str(path)) for task, path in wanted), jobs):
            advance()


@contextmanager
def shown(what: str, total: int) -> Iterator[Callable[[], None]]:
    """Give a function that says that one more of `total` is done: a bar on a terminal, a line a minute elsewhere."""
    console = Console(stderr=True)
    if console.is_terminal:
        columns = (
            TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
            TimeElapsedColumn(), TextColumn("gone,"), TimeRemainingColumn(), TextColumn("left"),
        )  # fmt: skip
        with Progress(*columns, console=console) as progress:
            bar = progress.add_task(what, total=total)
            yield lambda: progress.advance(bar)
        return
    began = last = time.monotonic()
    done = 0

    def advance() -> None:
        nonlocal done, last
        done += 1
        now = time.monotonic()
        if now - last >= _LINE_EVERY or done == total:
            last, each = now, (now - began) / done
            left = each * (total - done) / 60
            print(f"{what}: {done} of {total}, {each:.2f} s each, {left:.0f} min left", file=sys.stderr, flush=True)

    yield advance


def _mapped(work: Callable[[T], R], items: Iterable[T], jobs: int) -> Iterator[R]:
    """Yield work(item) as they come. Few are handed out at a time, so that an end does not wait for many."""
    waiting = iter(items)
    with _term_is_interrupt():
        if jobs == 1:
            yield from map(work, waiting)
            return
        pool = ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn"), initializer=_deaf)
        pending: set[Future[R]] = set()
        try:
            while True:
                pending |= {pool.submit(work, item) for item in islice(waiting, 2 * jobs - len(pending))}
                if not pending:
                    return
                done, pending = wait(pending, return_when=FIRST_COMPLETED)
                for one in done:
                    yield one.result()
        except BrokenProcessPool as error:
            raise WorkerDied("a process of the pool died; finished trials are kept, run again to go on") from error
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _deaf() -> None:
    """Leave Ctrl-C to the parent: a terminal sends it to every process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


@contextmanager
def _term_is_interrupt() -> Iterator[None]:
    """Let SIGTERM end the run as Ctrl-C does. Signals are the main thread's."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _pack(layers: Sequence[Layer]) -> bytes:
    return msgspec.json.encode([(layer.origin, layer.values) for layer in layers])


def _unpack(packed: bytes) -> list[Layer]:
    return [Layer(origin, values) for origin, values in msgspec.json.decode(packed)]


def _attempt(item: tuple[bytes, Task]) -> Outcome:
    return attempt(item[1], _unpack(item[0]))


def _record(item: tuple[bytes, Task, str]) -> None:
    record(item[1], _unpack(item[0]), Path(item[2]))
