"""`pushlane slam`: mapping and localisation on a laser log."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from runtime.outputs import check_folder, writing

if TYPE_CHECKING:
    from experiments.slam.logs import Log
    from experiments.slam.metric import Agreement
    from experiments.slam.whole import Mapped

File = Annotated[
    Path,
    typer.Argument(
        metavar="FILE", help="A CARMEN log (.log, .log.gz), .npz with ranges, odom, aperture, or a session (.mcap)."
    ),
]
Output = Annotated[
    Path | None,
    typer.Option(
        "--output",
        "-o",
        metavar="FOLDER",
        help="Where map.png, map.rrd, map.yaml and map.pgm go.",
        show_default="nothing is written",
    ),
]
NumberOfParticles = Annotated[int, typer.Option("--particles", min=1, max=1000, help="Particles.")]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Of everything drawn.")]
KnownMap = Annotated[
    Path | None,
    typer.Option(
        "--map",
        metavar="FILE.yaml",
        help="Localise in this map, as map_server saves them, of cells of 0.05 m, from nothing.",
        show_default="a map is made",
    ),
]
Scans = Annotated[int, typer.Option("--scans", min=0, help="Only so many, from the first on; 0: all of them.")]


def register(app: typer.Typer) -> None:
    """Add the verb to `pushlane`."""
    app.command(
        name="slam",
        help="Map a laser log, made by others or recorded by pushlane, and print how its trajectory agrees with the "
        "log's own where it has one: errors of relative displacements (Kuemmerle et al. 2009); of a simulated session, "
        "errors against the truth.",
    )(slam)


def slam(
    file: File,
    output: Output = None,
    particles: NumberOfParticles = 30,
    seed: Seed = 1,
    scans: Scans = 0,
    known: KnownMap = None,
) -> None:
    """Map a log."""
    from experiments.paper.running import shown  # heavy
    from experiments.slam import maps, whole
    from experiments.slam.logs import read
    from services.mapping.config import FilterConfig

    log = read(file)
    if scans:
        log = log.cut(scans)
    given = None if known is None else maps.read(known)
    if output is not None:
        check_folder(output)
    config = FilterConfig(particles=particles, seed=seed)
    with shown("mapping" if given is None else "localising", len(log.ranges)) as advance:
        found = whole.run(log, config, advance, given)
    for line in _told(log, found, config.furthest):
        typer.echo(line)
    if output is not None:
        with writing(output):
            whole.picture(found, log.reference).savefig(output / "map.png")
            whole.to_rerun(found, log.reference, output / "map.rrd")
            saved = maps.write(output, found.cells, found.corner)
        typer.echo(f"{output / 'map.png'}, {output / 'map.rrd'}, {saved} and its map.pgm")


def _told(log: Log, found: Mapped, furthest: float) -> list[str]:
    import numpy as np

    from experiments.slam.metric import agreement, apart, revisits, successive

    way = float(np.hypot(*np.diff(found.poses[:, :2], axis=0).T).sum())
    median, late = np.percentile(1e3 * found.ticks, [50, 99])
    lines = [
        f"{len(log.ranges)} scans over {way:.0f} m; particles drawn anew {found.selections} times",
        f"a scan takes {median:.0f} ms, p99 {late:.0f} ms; {found.tiles} tiles, {found.alone} if nothing were shared",
    ]
    if found.fit is not None:
        x, y, theta = found.poses[0]
        lines.append(
            f"begun at ({x:.2f}, {y:.2f}) m, {round(math.degrees(theta))} degrees; {found.fit:.0%} of the first scan's "
            "beams end where the map has something"
        )
    if log.reference is None:
        off = found.poses[-1] - found.poses[0]
        raw = found.raw[-1] - found.raw[0]
        return [
            *lines,
            f"from the first pose to the last {np.hypot(*off[:2]):.2f} m, by odometry {np.hypot(*raw[:2]):.2f} m; "
            "the log has no trajectory to compare with",
        ]
    if log.true:
        for name, poses in (("found", found.poses), ("odometry", found.raw)):
            off = np.hypot(*(poses - log.reference)[:, :2].T)
            late = np.percentile(off, 95)
            lines.append(f"position against the truth, {name}: {off.mean():.3f} m mean, {late:.3f} m 95th percentile")
    lines.append("errors of relative displacements against the log's own trajectory, mean and standard deviation:")
    for name, pairs in (("revisits", revisits(log.reference)), ("successive scans", successive(len(log.ranges)))):
        if not pairs:
            lines.append(f"  {name}: none")
            continue
        for what, poses in (("found", found.poses), ("odometry", found.raw)):
            lines.append(f"  {name}, {what}: {_error(agreement(poses, log.reference, pairs))}")
    lines.append("ends of a scan's beams from the walls of the scan before, median, mean over the scans:")
    scans = log.scans(furthest)
    for name, poses in (("found", found.poses), ("the log's own", log.reference), ("odometry", found.raw)):
        lines.append(f"  {name}: {1e3 * np.nanmean(apart(scans, poses)):.1f} mm")
    return lines


def _error(one: Agreement) -> str:
    turn, deviation = math.degrees(one.mean_turn), math.degrees(one.deviation_turn)
    return f"{one.mean:.3f} +- {one.deviation:.3f} m, {turn:.2f} +- {deviation:.2f} degrees, {one.pairs} pairs"
