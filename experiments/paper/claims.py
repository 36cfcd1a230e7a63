"""The paper's qualitative results, each tried on the trials: comes out, is reversed, or is not decided."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import fmean

from scipy.stats import binomtest, fisher_exact, wilcoxon

from experiments.paper.figures import paired, rate, select
from experiments.paper.trial import STEEP, Outcome

COMES_OUT, REVERSED, UNDECIDED, CONTRADICTED = "comes out", "does not: reversed", "not decided", "does not"
NO_TRIALS = "no trials"
LEVEL = 0.05
"""Of every test, two-sided, without correction for their number."""

NEAR_GOAL = 0.5
"""m, true distance left at which a push counts as having come near the goal."""

WIDE = (("strategies", "1B"), ("free-area", "corridor-1"), ("free-area", "corridor-2"))


@dataclass(frozen=True)
class Finding:
    """A claim of the paper, what became of it, and the numbers that say so."""

    claim: str
    verdict: str
    evidence: str


def findings(outcomes: Sequence[Outcome]) -> list[Finding]:
    """Return a finding for every claim that the trials can say anything about."""
    wide = [one for one in outcomes if (one.experiment, one.scene) in WIDE and one.start == "scene"]
    both = select(outcomes, experiment=("strategies", "free-area"))
    third = select(outcomes, experiment="controllers")
    found = [
        success("strict is the best in wide corridors: it succeeds more often than relaxed (1B, Corridors 1, 2)", wide,
                "strict", "relaxed"),
        success("strict is the best in wide corridors: it succeeds more often than fixed-lookahead", wide,
                "strict", "fixed-lookahead"),
        effort("strict takes a longer robot path than relaxed (Experiments 1, 2)", both, "strict", "relaxed", "robot"),
        effort("strict takes longer than relaxed (Experiments 1, 2)", both, "strict", "relaxed", "time"),
        effort("fixed-lookahead takes a longer robot path than relaxed (Experiments 1, 2)", both, "fixed-lookahead",
               "relaxed", "robot"),
        effort("fixed-lookahead takes a longer robot path than strict (Experiment 2)",
               select(outcomes, experiment="free-area"), "fixed-lookahead", "strict", "robot"),
        success("adaptive succeeds more often than non-adaptive, over all objects", third, "adaptive", "non-adaptive"),
        success("non-adaptive succeeds more often than dipole, over all objects", third, "non-adaptive", "dipole"),
        success("non-adaptive succeeds more often than centroid, over all objects", third, "non-adaptive", "centroid"),
        success("adaptive succeeds more often than dipole, over all objects", third, "adaptive", "dipole"),
        success("adaptive succeeds more often than centroid, over all objects", third, "adaptive", "centroid"),
        effort("non-adaptive delivers with a shorter robot path than adaptive", third, "adaptive", "non-adaptive",
               "robot"),
        steep_turns(third),
        orbiting(third),
    ]  # fmt: skip
    return [one for one in found if one.verdict != NO_TRIALS]


def success(claim: str, outcomes: Sequence[Outcome], more: str, less: str) -> Finding:
    """Try by Fisher's exact test that method `more` succeeds more often than `less`."""
    a, b = ([one.success for one in select(outcomes, method=name, start="")] for name in (more, less))
    if not a or not b:
        return Finding(claim, NO_TRIALS, "")
    p = float(fisher_exact([[sum(a), len(a) - sum(a)], [sum(b), len(b) - sum(b)]])[1])
    difference = sum(a) / len(a) - sum(b) / len(b)
    evidence = f"{more} {sum(a)}/{len(a)} = {rate(sum(a), len(a))}, {less} {sum(b)}/{len(b)} = {rate(sum(b), len(b))}"
    return Finding(claim, _verdict(difference, p), f"{evidence}; Fisher p = {p:.2g}")


def effort(claim: str, outcomes: Sequence[Outcome], more: str, less: str, what: str) -> Finding:
    """Try by Wilcoxon's signed-rank test that `more` needs more of `what` where both delivered the same push."""
    values: dict[str, tuple[str, Callable[[Outcome], float]]] = {
        "robot": ("m", lambda one: one.robot_length),
        "time": ("s", lambda one: one.time),
    }
    unit, value = values[what]
    pairs = paired(select(outcomes, method=more, start=""), select(outcomes, method=less, start=""), value)
    if not pairs:
        return Finding(claim, NO_TRIALS, "")
    differences = [a - b for a, b in pairs]
    p = float(wilcoxon(differences).pvalue) if any(differences) else 1.0
    digits = 2 if unit == "m" else 1
    evidence = (
        f"{more} {fmean(a for a, _ in pairs):.{digits}f} {unit}, "
        f"{less} {fmean(b for _, b in pairs):.{digits}f} {unit}, "
        f"means of {len(pairs)} pushes that both delivered; Wilcoxon p = {p:.2g}"
    )
    return Finding(claim, _verdict(fmean(differences), p), evidence)


def steep_turns(outcomes: Sequence[Outcome]) -> Finding:
    """Try by a binomial test that centroid leaves the corridor at steep turns more often than chance would have it."""
    claim = "centroid fails at steep turns of the push direction, where it pushes the object out of the corridor"
    pushes = select(outcomes, method="centroid", start="")
    failed = [one for one in pushes if not one.success]
    out = [one for one in failed if one.cause in {"object out", "robot out"} and one.turn is not None]
    if not failed:
        return Finding(claim, NO_TRIALS, "")
    if not out:
        return Finding(claim, CONTRADICTED, f"none of {len(failed)} failures left the corridor")
    at_turn = sum(one.turn is not None and one.turn >= STEEP for one in out)
    # All pushes count for chance: those that failed ended early.
    chance = fmean(one.steep for one in pushes if one.steep is not None)
    p = float(binomtest(at_turn, len(out), min(max(chance, 1e-9), 1.0)).pvalue)
    evidence = (
        f"{len(out)} of {len(failed)} failures left the corridor, {at_turn} of these ({rate(at_turn, len(out))}) where "
        "the push direction had turned by 45 degrees or more within the object's last 0.5 m; that is so in "
        f"{100 * chance:.0f} % of all targets of its pushes; binomial p = {p:.2g}"
    )
    return Finding(claim, _verdict(at_turn / len(out) - chance, p), evidence)


def orbiting(outcomes: Sequence[Outcome]) -> Finding:
    """Tell whether dipole's failures are those of a robot that circles the object near the goal."""
    claim = "dipole orbits around the object near the goal (2 of its 11 failures in the paper)"
    failed = [one for one in select(outcomes, method="dipole", start="") if not one.success]
    if not failed:
        return Finding(claim, NO_TRIALS, "")
    orbits = [one for one in failed if one.cause == "orbit"]
    near = sum(one.distance is not None and one.distance < NEAR_GOAL for one in orbits)
    idle = [one for one in failed if one.cause in {"stall", "time limit"}]
    idle_near = sum(one.distance is not None and one.distance < NEAR_GOAL for one in idle)
    evidence = (
        f"of {len(failed)} failures {len(orbits)} ended orbiting, {near} of them within {NEAR_GOAL:g} m of the goal; "
        f"{len(idle)} stalled or ran out of time, {idle_near} of them within {NEAR_GOAL:g} m"
    )
    return Finding(claim, COMES_OUT if near else CONTRADICTED, evidence)


def _verdict(difference: float, p: float) -> str:
    if p >= LEVEL or difference == 0.0:
        return UNDECIDED
    return COMES_OUT if difference > 0.0 else REVERSED
