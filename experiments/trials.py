"""Many pushes of one kind, over seeds and processes, with a success rate and its interval."""

from __future__ import annotations

import multiprocessing
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import msgspec

from experiments.scoring import Judge, Score, wilson
from experiments.session import prepare, run
from runtime.config.layers import Layer


@dataclass(frozen=True)
class Trial:
    """One push and what it was worth."""

    seed: int
    score: Score


@dataclass(frozen=True)
class Batch:
    """The pushes of one kind."""

    trials: list[Trial]

    @property
    def successes(self) -> int:
        """Return how many succeeded."""
        return sum(trial.score.success for trial in self.trials)

    def text(self) -> Iterator[str]:
        """Return the figures line by line."""
        count = len(self.trials)
        low, high = wilson(self.successes, count)
        rate = 100 * self.successes / count
        yield f"{self.successes} of {count} = {rate:.1f} % [{100 * low:.1f}, {100 * high:.1f}] (Wilson 95 %)"
        good = [trial.score for trial in self.trials if trial.score.success]
        if good:
            yield (
                f"successes, median: robot path {median(s.robot_length for s in good):.2f} m, object path "
                f"{median(s.object_length for s in good):.2f} m, {median(s.time for s in good):.1f} s, "
                f"{1000 * median(s.distance for s in good):.0f} mm from the goal"
            )
        causes = Counter(trial.score.cause for trial in self.trials if not trial.score.success)
        for cause, number in causes.most_common():
            seeds = [str(trial.seed) for trial in self.trials if trial.score.cause == cause]
            yield f"failures, {cause}: {number} (seeds {', '.join(seeds)})"
        hits = sum(trial.score.hits > 0 for trial in self.trials)
        yield f"pushes in which robot or object touched furniture or walls: {hits}"


def deliver(layers: Sequence[Layer], seeds: Sequence[int], jobs: int, failures: Path | None = None) -> Iterator[Trial]:
    """Run one push for each seed; yields trials in the order of the seeds.

    Args:
        layers: the configuration; its seed is replaced.
        jobs: processes.
        failures: a folder that keeps the recording of every failed push.
    """
    packed = msgspec.json.encode([(layer.origin, layer.values) for layer in layers])
    tasks = [(packed, seed, str(failures) if failures else "") for seed in seeds]
    if jobs == 1:
        yield from map(_one, tasks)
        return
    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(_one, tasks)


def _one(task: tuple[bytes, int, str]) -> Trial:
    packed, seed, failures = task
    layers = [Layer(origin, values) for origin, values in msgspec.json.decode(packed)]
    session = prepare([*layers, Layer("trial", {"sim": {"seed": seed}})])
    judge = Judge()
    score = judge.score(session, run(session, sinks=[judge]))
    if failures and not score.success:
        # The same seed gives the same push: record it in a second run, only where it is wanted.
        run(session, Path(failures) / f"seed-{seed}.mcap")
    return Trial(seed, score)
