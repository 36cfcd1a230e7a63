"""The figures of a set of trials: success with its interval, effort, causes of failure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from statistics import fmean

from experiments.paper.trial import Outcome
from experiments.scoring import wilson

CAUSES = ("robot out", "object out", "stall", "orbit", "object lost", "time limit")
"""As the task service and the judge name them; anything else is counted as other."""

GRAZE = 0.02
"""m; the task service ends a push only beyond this, its allowance for noise (task.violation_tolerance)."""

HEADINGS = ("robot out", "object out", "stall", "orbit", "lost", "time", "other")


@dataclass(frozen=True)
class Figures:
    """Of a set of trials. Lengths, m, and time, s, are means over the successes as in the paper; None without any."""

    successes: int
    trials: int
    robot_length: float | None
    object_length: float | None
    time: float | None
    causes: tuple[int, ...]
    """in the order of HEADINGS"""
    grazed: int
    """failures that left the corridor by GRAZE at most, and delivered all the same"""
    hits: int
    """trials in which robot or object touched walls or furniture"""

    @property
    def success(self) -> str:
        """Return successes of trials."""
        return f"{self.successes}/{self.trials}"

    @property
    def rate(self) -> str:
        """Return the rate in per cent with its Wilson 95 % interval."""
        return rate(self.successes, self.trials)


def rate(successes: int, trials: int) -> str:
    """Return the rate in per cent with its Wilson 95 % interval; a dash without trials."""
    if trials == 0:
        return "-"
    low, high = wilson(successes, trials)
    return f"{100 * successes / trials:.1f} % [{100 * low:.1f}, {100 * high:.1f}]"


def figures(outcomes: Iterable[Outcome]) -> Figures:
    """Return the figures of `outcomes`."""
    found = list(outcomes)
    good = [one for one in found if one.success]
    counts = Counter(one.cause for one in found if not one.success)
    named = tuple(counts[cause] for cause in CAUSES)
    return Figures(
        successes=len(good),
        trials=len(found),
        robot_length=fmean(one.robot_length for one in good) if good else None,
        object_length=fmean(one.object_length for one in good) if good else None,
        time=fmean(one.time for one in good) if good else None,
        causes=(*named, sum(counts.values()) - sum(named)),
        grazed=sum(_grazed(one) for one in found),
        hits=sum(one.hits > 0 for one in found),
    )


def select(
    outcomes: Iterable[Outcome],
    *,
    experiment: str | Sequence[str] = (),
    method: str | Sequence[str] = (),
    start: str = "scene",
    scene: str | Sequence[str] = (),
    object: str | Sequence[str] = (),
) -> list[Outcome]:
    """Return the outcomes that match; an empty filter lets everything pass."""
    wanted = {"experiment": experiment, "method": method, "start": start, "scene": scene, "object": object}
    tests = {name: {value} if isinstance(value, str) else set(value) for name, value in wanted.items() if value}
    return [one for one in outcomes if all(getattr(one, name) in known for name, known in tests.items())]


def paired(
    first: Iterable[Outcome], second: Iterable[Outcome], value: Callable[[Outcome], float]
) -> list[tuple[float, float]]:
    """Return `value` of both for every case, scene, object, start and seed that both delivered.

    Means over each one's own successes compare different pushes: who fails at the hard ones looks short.
    """
    theirs = {_place(one): one for one in second if one.success}
    return [(value(one), value(theirs[_place(one)])) for one in first if one.success and _place(one) in theirs]


def _grazed(one: Outcome) -> bool:
    if one.success or one.distance is None or one.robot_depth is None or one.object_depth is None:
        return False
    return one.distance <= one.precision and -GRAZE <= min(one.robot_depth, one.object_depth) < 0.0


def _place(one: Outcome) -> tuple[str, str, str, str, str, int]:
    return one.experiment, one.case, one.scene, one.object, one.start, one.seed
