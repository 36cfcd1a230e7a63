"""Writes what came of a run: report.md with the tables, failures.md with every failed trial, and the plots."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

import msgspec

from experiments.paper import plots
from experiments.paper.cells import HOUSEHOLD, TITLES, WHAT_A_CELL_IS, Cell, Task, cell_of, cells, task
from experiments.paper.claims import LEVEL, findings
from experiments.paper.figures import select
from experiments.paper.running import shown
from experiments.paper.samples import Push, follow
from experiments.paper.store import Facts
from experiments.paper.tables import Table, methods, tables
from experiments.paper.trial import Outcome
from runtime.config.layers import Layer

WANTED = 200
"""Trials a cell that the report is meant to have."""

PLOTS = "plots"
_SHOWN_VERSIONS = ("python", "numpy", "scipy", "numba", "sapien")


def write(
    folder: Path,
    run: Facts,
    outcomes: Sequence[Outcome],
    layers: Sequence[Layer],
    command: str,
    jobs: int,
    kept: Sequence[tuple[Outcome, Path]] = (),
    drawn: bool = True,
) -> list[Table]:
    """Write report.md, failures.md and the plots into `folder`; returns the tables.

    Args:
        command: the command line that made it, as the user would type it.
        jobs: processes it ran in.
        kept: failed trials with their recordings.
        drawn: whether to draw; Fig. 9 and 10 run some pushes again.
    """
    found = tables(outcomes)
    pictures = draw(folder / PLOTS, outcomes, layers, run.first_seed) if drawn else []
    text = [
        *_head(run, outcomes, command, jobs),
        *_claims(outcomes),
        "## Tables",
        "",
        *_notes(),
        *(line for table in found for line in (table.markdown(), "")),
        *_pictures(pictures),
        *failures(outcomes, kept, folder),
    ]
    (folder / "report.md").write_text("\n".join(text), encoding="utf-8")
    (folder / "failures.md").write_text(every_failure(outcomes, run), encoding="utf-8")
    return found


def draw(folder: Path, outcomes: Sequence[Outcome], layers: Sequence[Layer], first_seed: int) -> list[tuple[str, str]]:
    """Draw what there are trials for; returns file names with captions."""
    made = []
    if select(outcomes, experiment="strategies"):
        caption = (
            "Fig. 7c: effort of successful deliveries. Box: quartiles, bar: median, dot: mean, line: range; "
            "a cross on the axis: no success."
        )
        made.append((plots.save(plots.efforts(outcomes), folder, "fig-7c"), caption))
    panels = _samples(outcomes, first_seed)
    with shown("drawing", sum(len(one[1]) for one in panels)) as advance:
        for name, wanted, caption in panels:
            pushes: list[Push] = []
            for one in wanted:
                pushes.append(follow(one, layers))
                advance()
            figure = plots.activation_changes(pushes) if name == "fig-10" else plots.trajectories(pushes, caption)
            made.append((plots.save(figure, folder, name), f"Fig. {name.removeprefix('fig-')}: {caption}"))
    return made


def _samples(outcomes: Sequence[Outcome], first_seed: int) -> list[tuple[str, list[Task], str]]:
    """Return name, tasks and caption of the figures that show single pushes: always the first of their kind."""
    second, third = (methods(select(outcomes, experiment=name), name) for name in ("free-area", "controllers"))
    found = []
    for name, scene, thing in (("fig-9a", "corridor-1", "dino"), ("fig-9b", "corridor-2", "cloud")):
        first = [_first("free-area", method, scene, thing, first_seed) for method in second]
        if first:
            found.append((name, first, f"'{thing}' in {scene.replace('corridor-', 'Corridor ')}, seed {first[0].seed}"))
    first = [_first("controllers", method, "corridor-3", "plane", first_seed) for method in third]
    if first:
        found.append(("fig-9c", first, f"'plane' in Corridor 3, relaxed, seed {first[0].seed}"))
    if "relaxed" in second:
        first = [_first("free-area", "relaxed", "corridor-1", thing, first_seed) for thing in HOUSEHOLD]
        caption = "psi_push at five times of one push in Corridor 1, relaxed strategy; the first seed of each object"
        found.append(("fig-10", first, caption))
    return found


def _first(experiment: str, method: str, scene: str, thing: str, first_seed: int) -> Task:
    wanted = cells([experiment], [method], starts=())
    cell = next(one for one in wanted if (scene, thing) in one.pushes)
    return task(cell, cell.pushes.index((scene, thing)), first_seed)


def _head(run: Facts, outcomes: Sequence[Outcome], command: str, jobs: int) -> list[str]:
    counts = _counts(outcomes)
    told = "; ".join(_told(counts, experiment) for experiment in TITLES if _of(counts, experiment))
    short = (
        f"**Fewer than {WANTED} trials a cell. There are: {told}.** The full run: "
        f"`pushlane experiment all --trials {WANTED} --jobs 2`."
        if min(counts.values(), default=0) < WANTED
        else f"Trials a cell: {told}."
    )
    return [
        "# The paper's experiments in simulation",
        "",
        short,
        "",
        *provenance(run, command, jobs),
        f"- {len(outcomes)} trials. {WHAT_A_CELL_IS} Trial i has the same seed in every cell: methods meet the same "
        "objects, starts and noise.",
        "- Success is the paper's (Sec. 6.2), judged by the simulation's truth: the object's centre within the "
        "precision, neither centre ever outside the pushing corridor, within 400 s. Intervals are Wilson's at 95 %. "
        "Efforts and times are means over successes, as in the paper.",
        "",
    ]


def provenance(run: Facts, command: str, jobs: int) -> list[str]:
    """Return lines that say what a run was made by, with and on."""
    versions = ", ".join(f"{name} {run.versions.get(name, 'missing')}" for name in _SHOWN_VERSIONS)
    return [
        f"- Made by `{command}`, {jobs} process{'es' if jobs > 1 else ''}, begun {run.begun}; "
        f"first seed {run.first_seed}.",
        f"- Settings given: {run.settings if run.settings != '[]' else 'none'}.",
        f"- Code: commit {run.commit[:12] or 'unknown'}{' with uncommitted changes' if run.dirty else ''}, "
        f"digest of the source {run.code}.",
        f"- Machine: {run.processor or 'unknown processor'} ({', '.join(run.cpu)}); {versions}.",
    ]


def _claims(outcomes: Sequence[Outcome]) -> list[str]:
    lines = [
        "## What comes out",
        "",
        f"Each result of the paper, tried on these trials with the base where the scene puts it. *Comes out* and "
        f"*reversed* mean p < {LEVEL:g} in a two-sided test, without correction for the number of tests; "
        "*not decided* means that these trials cannot tell.",
        "",
        "| the paper says | here | evidence |",
        "| --- | --- | --- |",
    ]
    lines += [f"| {one.claim} | **{one.verdict}** | {one.evidence} |" for one in findings(outcomes)]
    return [*lines, ""]


def _notes() -> list[str]:
    return [
        "The paper's Experiments 2 and 3 are of a real robot at V = 0.1 m/s, ours are simulated at 0.3 m/s: divide its "
        "times by about 3. Its Table 4 does not quite agree with its Tables 2 and 3: relaxed sums to 56 of 63 in the "
        "one and to 55 in the others, non-adaptive to 11 and 12 of 21. Its first column is headed relaxed, but has the "
        "sum of strict in Table 2. Corridor widths, room layouts and the physics of objects are ours: the paper does "
        "not publish them. Compare orders rather than rates.",
        "",
    ]


def _pictures(pictures: Sequence[tuple[str, str]]) -> list[str]:
    if not pictures:
        return []
    lines = ["## Plots", ""]
    for file, caption in pictures:
        lines += [f"![{caption}]({PLOTS}/{file})", "", caption, ""]
    if any(file.startswith("fig-9") for file, _ in pictures):
        lines += [
            "In Fig. 9 the coloured line is the object's centre, the black one the robot's, the dashed one Q, the "
            "yellow one the edge of the pushing corridor, the star the goal. Pushes are the first of their kind, "
            "not chosen.",
            "",
        ]
    return lines


def failures(outcomes: Sequence[Outcome], kept: Sequence[tuple[Outcome, Path]], folder: Path) -> list[str]:
    """Return the section of a report that says how many failed, and where recordings are."""
    failed = sum(not one.success for one in outcomes)
    lines = [
        "## Failures",
        "",
        f"{failed} trials failed. failures.md names each with its seed and the command that records it.",
    ]
    if kept:
        lines += ["", "Recorded, for `pushlane inspect`:", ""]
        lines += [f"- {path.relative_to(folder)}: {one.object} in {one.scene}, {one.cause}" for one, path in kept]
    return [*lines, ""]


def every_failure(outcomes: Sequence[Outcome], run: Facts) -> str:
    """Return failures.md: each failed trial with its seed, and how to record it."""
    lines = [
        "# Every failed trial",
        "",
        "Record one with `pushlane sim` and the options in its row, plus `-o FILE.mcap`"
        + (f", and the settings of the run: {run.settings}" if run.settings != "[]" else "")
        + "; then `pushlane inspect FILE.mcap`.",
        "",
        "| cause | m left | options |",
        "| --- | --- | --- |",
    ]
    for one in outcomes:
        if not one.success:
            left = "-" if one.distance is None else f"{one.distance:.2f}"
            lines.append(f"| {one.cause} | {left} | `{options(one)}` |")
    return "\n".join([*lines, ""])


def options(one: Outcome) -> str:
    """Return the options of `pushlane sim` that give the push of `one`."""
    start = f" --set sim.start={one.start}" if one.start != "scene" else ""
    start += "".join(f" --set {shlex.quote(each)}" for each in assignments(one.settings))
    return (
        f"--scene {one.scene} --object {one.object} --strategy {one.strategy} --controller {one.controller} "
        f"--precision {one.precision:g} --seed {one.seed}{start}"
    )


def assignments(settings: str) -> list[str]:
    """Return the settings of a case as --set takes them."""

    def told(key: str, value: object) -> Iterator[str]:
        if isinstance(value, dict):
            for name, inner in value.items():
                yield from told(f"{key}.{name}" if key else name, inner)
        else:
            yield f"{key}={msgspec.json.encode(value).decode()}"

    return list(told("", msgspec.json.decode(settings))) if settings else []


def _counts(outcomes: Sequence[Outcome]) -> Counter[Cell]:
    return Counter(cell_of(one) for one in outcomes)


def _of(counts: Counter[Cell], experiment: str) -> dict[bool, list[int]]:
    """Return the trials of each cell of `experiment`; under True those of the starts told apart."""
    found: dict[bool, list[int]] = {}
    for cell, count in counts.items():
        if cell.experiment == experiment:
            found.setdefault(cell.start != "scene", []).append(count)
    return found


def _told(counts: Counter[Cell], experiment: str) -> str:
    found = _of(counts, experiment)
    parts = [f"{_spread(found[False])} a cell of its tables"] if False in found else []
    parts += [f"{_spread(found[True])} a start and method"] if True in found else []
    return f"{TITLES[experiment].split(':')[0]}, {' and '.join(parts)}"


def _spread(counts: list[int]) -> str:
    low, high = min(counts, default=0), max(counts, default=0)
    return str(low) if low == high else f"{low} to {high}"
