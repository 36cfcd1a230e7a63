"""Runs the filter over a log, and draws what came of it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from experiments.slam.logs import BadLog, Log
from runtime.errors import PushlaneError
from runtime.outputs import CannotWrite
from services.geometry.pose import compose
from services.mapping.config import FilterConfig
from services.mapping.filter import Noise, Particles
from services.mapping.globally import explained, locate
from services.mapping.grid import RESOLUTION, Maps, off_cells

matplotlib.use("Agg")

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mapped:
    """What came of a log.

    Attributes:
        poses: (K, 3), the mean of the particles that are near the best one at the end, all along their past.
        raw: (K, 3), by odometry alone.
        cells: (H, W), 0 free, 100 occupied, 255 unknown; corner: (2,), m, of the first.
        ticks: (K,), s, that each scan took.
        selections: how often particles were drawn anew.
        tiles: that the maps of all particles take together; alone: that they would take without sharing.
        fit: share of the first scan's beams that end where the known map has something; None without one.
    """

    poses: Array
    raw: Array
    cells: NDArray[np.uint8]
    corner: Array
    ticks: Array
    selections: int
    tiles: int
    alone: int
    fit: float | None = None


class NotFound(PushlaneError):
    """The first scan fits nowhere on a map."""

    exit_code = 1


def run(
    log: Log, config: FilterConfig, advance: Callable[[], None], known: tuple[NDArray[np.uint8], Array] | None = None
) -> Mapped:
    """Map `log`; `advance` is called after each scan.

    Args:
        known: a map (see `maps.read`), in which the start is searched for: nothing is drawn then.

    Raises:
        NotFound: the map has no free place, or the first scan no beam that meets something.
        BadLog: nor has any other scan.
    """
    if not any(log.scan(k, config.furthest).returned.any() for k in range(len(log.ranges))):
        raise BadLog(f"no beam of {len(log.ranges)} scans meets anything within {config.furthest:g} m")
    particles = Particles.at(log.start, config.particles, config.seed)
    start, shift, fit = log.start, np.zeros(2), None
    if known is not None:
        # Everything is moved by what the map's cells are off ours, and back.
        shift = off_cells(known[1])
        particles.maps = Maps.known(known[0], known[1] - shift, config.particles)
        first = log.scan(0, config.furthest)
        poses, _ = locate(particles.maps, first)
        if not len(poses):
            raise NotFound("the first scan fits nowhere on the map")
        start, fit = poses[0], explained(particles.maps, first, poses[0])
        particles.poses[:] = start
    noise = Noise()
    past = np.zeros((config.particles, len(log.ranges), 3))
    raw, ticks, selections = [start], [], 0
    for k in range(len(log.ranges)):
        began = time.perf_counter()
        scan = log.scan(k, config.furthest)
        if k:
            raw.append(compose(raw[-1], log.steps[k]))
            particles.move(log.steps[k], noise, scan)
        if known is None:
            particles.draw(scan, config.memory)
        past[:, k] = particles.poses
        chosen = particles.select() if k else None
        if chosen is not None:
            past = past[chosen]
            selections += 1
        ticks.append(time.perf_counter() - began)
        advance()
    cells, corner = particles.maps.picture(particles.best)
    back = np.array([*shift, 0.0])
    owners = particles.maps.owners
    poses = np.array([particles.mean(then) for then in past.swapaxes(0, 1)])
    return Mapped(
        poses + back, np.array(raw) + back, cells, corner + shift, np.array(ticks), selections,
        int((owners > 0).sum()), int(owners.sum()), fit,
    )  # fmt: skip


def picture(found: Mapped, reference: Array | None) -> Figure:
    """Return the map with the trajectories on it."""
    known = found.cells != 255
    if not known.any():
        return Figure()
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    x0, y0 = found.corner
    low, high = (x0 + columns[0] * RESOLUTION, y0 + rows[0] * RESOLUTION), (
        x0 + (columns[-1] + 1) * RESOLUTION, y0 + (rows[-1] + 1) * RESOLUTION,
    )  # fmt: skip
    shown = found.cells[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    grey = np.choose(np.select([shown == 0, shown == 100], [0, 1], 2), [255, 0, 200]).astype(np.uint8)
    width, height = high[0] - low[0], high[1] - low[1]
    figure = Figure(figsize=(11.0, min(16.0, 1.0 + 11.0 * height / width)), dpi=100, layout="constrained")
    axes = figure.subplots()
    axes.imshow(grey, origin="lower", cmap="gray", vmin=0, vmax=255, extent=(low[0], high[0], low[1], high[1]))
    axes.plot(found.raw[:, 0], found.raw[:, 1], color="#d55e00", linewidth=0.8, label="odometry alone")
    if reference is not None:
        axes.plot(reference[:, 0], reference[:, 1], color="#009e73", linewidth=2.4, alpha=0.6, label="the log's own")
    axes.plot(found.poses[:, 0], found.poses[:, 1], color="#0072b2", linewidth=1.0, label="found")
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="x (m)", ylabel="y (m)", aspect="equal")
    axes.legend(loc="upper right")
    return figure


def to_rerun(found: Mapped, reference: Array | None, file: Path) -> None:
    """Write map and trajectories for Rerun."""
    import rerun as rr  # heavy

    with rr.RecordingStream("pushlane slam") as recording:
        try:
            recording.save(str(file))
        except RuntimeError as error:  # Rerun's for a full disk and the like
            raise CannotWrite(f"cannot write {file}: {error}") from error
        shade = np.select([found.cells == 0, found.cells == 100], [255, 0], 200).astype(np.uint8)
        h, w = shade.shape
        x0, y0 = found.corner
        corners = np.array([[0, 0], [w, 0], [w, h], [0, h]]) * RESOLUTION + (x0, y0)
        recording.log(
            "map",
            rr.Mesh3D(
                vertex_positions=np.column_stack([corners, np.full(4, -0.01)]),
                triangle_indices=[[0, 1, 2], [0, 2, 3]],
                vertex_texcoords=[[0, 1], [1, 1], [1, 0], [0, 0]],
                albedo_texture=np.repeat(shade[::-1, :, None], 3, axis=2),
            ),
            static=True,
        )
        lines = [("odometry", found.raw, (213, 94, 0)), ("found", found.poses, (0, 114, 178))]
        lines += [] if reference is None else [("reference", reference, (0, 158, 115))]
        for name, poses, colour in lines:
            points = np.column_stack([poses[:, :2], np.zeros(len(poses))])
            recording.log(f"trajectory/{name}", rr.LineStrips3D([points], colors=[colour]), static=True)
        for k, pose in enumerate(found.poses):
            recording.set_time("scan", sequence=k)
            recording.log("robot", rr.Points3D([[pose[0], pose[1], 0.0]], colors=[(0, 114, 178)], radii=[0.2]))
