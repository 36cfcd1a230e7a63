"""The paper's Tables 2, 3 and 4 and its counts for Experiment 1, with our numbers beside them, as rows of text."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from experiments.paper import published
from experiments.paper.cells import DEFAULT_METHODS, HOUSEHOLD, ROOMS, STARTS, TITLES
from experiments.paper.figures import HEADINGS, Figures, figures, rate, select
from experiments.paper.published import Row
from experiments.paper.trial import Outcome

_NONE = "-"
_EFFORT = ("L_Qr (m)", "L_Qo (m)", "time (s)")


@dataclass(frozen=True)
class Table:
    """A table of text."""

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def markdown(self) -> str:
        """Return the table in Markdown."""
        lines = [self.headings, tuple("---" for _ in self.headings), *self.rows]
        return f"**{self.title}**\n\n" + "\n".join("| " + " | ".join(line) + " |" for line in lines)


def tables(outcomes: Sequence[Outcome]) -> list[Table]:
    """Return every table that there are trials for, in the paper's order."""
    found = [experiment_1(outcomes), efforts_1(outcomes), table_2(outcomes), table_3(outcomes), table_4(outcomes)]
    found += [causes(outcomes, experiment) for experiment in TITLES]
    found += [starts(outcomes)]
    return [one for one in found if one.rows]


def experiment_1(outcomes: Sequence[Outcome]) -> Table:
    """Return success in the four scenes for each strategy."""
    ours = select(outcomes, experiment="strategies")
    rows = []
    for method in methods(ours, "strategies"):
        mine = select(ours, method=method)
        whole, paper = figures(mine), published.SUCCESS_1.get(method)
        by_scene = (figures(select(mine, scene=scene)) for scene in ROOMS)
        rows.append(
            (
                method,
                f"{paper[0]}/{paper[1]} = {rate(*paper)}" if paper else _NONE,
                whole.success,
                whole.rate,
                *(f"{one.success} = {one.rate}" for one in by_scene),
            )
        )
    return Table(
        "Experiment 1: success, precision 0.05 m", ("strategy", "paper", "ours", "Wilson 95 %", *ROOMS), tuple(rows)
    )


def efforts_1(outcomes: Sequence[Outcome]) -> Table:
    """Return the numbers behind Fig. 7c."""
    ours = select(outcomes, experiment="strategies")
    rows = []
    for scene in ROOMS:
        for method in methods(select(ours, scene=scene), "strategies"):
            found = figures(select(ours, scene=scene, method=method))
            rows.append((scene, method, *_effort(found), found.success))
    return Table(
        "Fig. 7c: effort of successful deliveries (the paper prints no numbers)",
        ("scene", "strategy", *_EFFORT, "successes"),
        tuple(rows),
    )


def table_2(outcomes: Sequence[Outcome]) -> Table:
    """Return Table 2."""
    rows = []
    for scene in ("corridor-1", "corridor-2"):
        ours = select(outcomes, experiment="free-area", scene=scene)
        for method in methods(ours, "free-area"):
            paper = published.TABLE_2.get((scene, method))
            rows.append(
                (scene.replace("corridor-", "Corridor "), *_compared(method, select(ours, method=method), paper))
            )
    return Table("Table 2: strategies, precision 0.05 m", ("corridor", *_compared_headings("strategy")), tuple(rows))


def table_3(outcomes: Sequence[Outcome]) -> Table:
    """Return Table 3."""
    ours = select(outcomes, experiment="controllers")
    rows = tuple(
        _compared(method, select(ours, method=method), published.TABLE_3.get(method))
        for method in methods(ours, "controllers")
    )
    return Table(
        "Table 3: controllers in Corridor 3, relaxed strategy, precision 0.1 m", _compared_headings("controller"), rows
    )


def table_4(outcomes: Sequence[Outcome]) -> Table:
    """Return Table 4: strict and relaxed with the adaptive controller over Experiments 2 and 3, the rest of 3."""
    columns: dict[str, list[Outcome]] = {
        "strict": select(outcomes, experiment="free-area", method="strict"),
        "relaxed": select(outcomes, experiment="free-area", method="relaxed")
        + select(outcomes, experiment="controllers", method="adaptive"),
    }
    third = select(outcomes, experiment="controllers")
    columns |= {name: select(third, method=name) for name in ("non-adaptive", "centroid", "dipole")}
    more = [name for name in methods(third, "controllers") if name not in {*columns, "adaptive"}]
    columns |= {name: select(third, method=name) for name in more}
    if not any(columns.values()):
        return Table("", (), ())
    rows = []
    for thing in HOUSEHOLD:
        paper = dict(zip(published.TABLE_4_COLUMNS, published.TABLE_4[thing], strict=True))
        rows.append((thing, *(_count(select(found, object=thing), paper.get(name)) for name, found in columns.items())))
    totals = {
        name: tuple(sum(counts[k][n] for counts in published.TABLE_4.values()) for n in (0, 1))
        for k, name in enumerate(published.TABLE_4_COLUMNS)
    }
    rows.append(("all", *(_count(found, totals.get(name)) for name, found in columns.items())))
    return Table(
        "Table 4: success by object, ours with Wilson 95 % (paper)",
        ("object", *(f"{name}, adaptive" if name in {"strict", "relaxed"} else name for name in columns)),
        tuple(rows),
    )


def causes(outcomes: Sequence[Outcome], experiment: str) -> Table:
    """Return the failures of `experiment` by cause, and pushes that touched something."""
    ours = select(outcomes, experiment=experiment)
    rows = []
    for method in methods(ours, experiment):
        found = figures(select(ours, method=method))
        failures = found.trials - found.successes
        rows.append((method, f"{failures}/{found.trials}", *map(str, found.causes), str(found.grazed), str(found.hits)))
    headings = ("method", "failures", *HEADINGS, "out by 2 cm at most, yet delivered", "touched a wall or furniture")
    return Table(f"{TITLES[experiment]}: failures by cause", headings, tuple(rows))


def starts(outcomes: Sequence[Outcome]) -> Table:
    """Return success and effort for each start apart."""
    rows = []
    for experiment, title in TITLES.items():
        ours = [one for one in outcomes if one.experiment == experiment and one.start != "scene"]
        for method in methods(ours, experiment):
            cells = [select(ours, method=method, start=start) for start in STARTS]
            found = [figures(cell) for cell in cells]
            effort = ", ".join(_number(one.robot_length, 2) for one in found)
            why = [sum(one.causes[k] for one in found) for k in range(len(HEADINGS))]
            told = ", ".join(f"{name} {count}" for name, count in zip(HEADINGS, why, strict=True) if count)
            rows.append(
                (
                    title.split(":")[0],
                    method,
                    *(f"{one.success} = {one.rate}" if one.trials else _NONE for one in found),
                    effort,
                    told,
                )
            )
    return Table(
        "Start configurations: where the base starts, seen along the first push",
        ("experiment", "method", *STARTS, f"L_Qr (m): {', '.join(STARTS)}", "failures"),
        tuple(rows),
    )


def methods(outcomes: Iterable[Outcome], experiment: str) -> list[str]:
    """Return the methods in `outcomes`, those of the paper first and in its order."""
    there = {one.method for one in outcomes}
    known = [name for name in DEFAULT_METHODS[experiment] if name in there]
    return known + sorted(there - set(known))


def _compared_headings(method: str) -> tuple[str, ...]:
    effort = (part for name in _EFFORT for part in (name, "paper"))
    return (method, *effort, "success", "Wilson 95 %", "paper", "paper's Wilson")


def _compared(method: str, outcomes: Sequence[Outcome], paper: Row | None) -> tuple[str, ...]:
    found = figures(outcomes)
    theirs = (f"{paper.robot_length:.2f}", f"{paper.object_length:.2f}", f"{paper.time:.1f}") if paper else (_NONE,) * 3
    effort = tuple(part for pair in zip(_effort(found), theirs, strict=True) for part in pair)
    last = (f"{paper.successes}/{paper.trials}", rate(paper.successes, paper.trials)) if paper else (_NONE, _NONE)
    return (method, *effort, found.success, found.rate, *last)


def _effort(found: Figures) -> tuple[str, str, str]:
    return _number(found.robot_length, 2), _number(found.object_length, 2), _number(found.time, 1)


def _number(value: float | None, digits: int) -> str:
    return _NONE if value is None else f"{value:.{digits}f}"


def _count(outcomes: Sequence[Outcome], paper: Sequence[int] | None) -> str:
    found = figures(outcomes)
    theirs = f" ({paper[0]}/{paper[1]})" if paper else ""
    return f"{found.success} = {found.rate}{theirs}" if found.trials else f"{_NONE}{theirs}"
