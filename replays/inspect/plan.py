"""Draws what the skill plans with: the map, the corridor around Q, the target and the goal."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from replays.inspect import palette
from replays.inspect.canvas import Canvas, raised
from replays.inspect.session import Session
from replays.inspect.shapes import band, circle
from runtime.messages import Corridor, OccupancyGrid, PushGoal, PushTarget

# Layers of the picture, m above the floor; thin enough that nothing shifts when seen from above.
FILL, INNER_FILL, EDGE, PLAN, MARK = 0.004, 0.006, 0.010, 0.014, 0.050
ARROW_LENGTH = 0.25
"""m, of the arrow of a wanted orientation"""


def draw_plan(canvas: Canvas, session: Session) -> None:
    """The map's cells, corridors, push targets and goals."""
    _draw_map(canvas, session)
    _draw_corridors(canvas, session)
    _draw_targets(canvas, session)
    _draw_goals(canvas, session)


def _draw_map(canvas: Canvas, session: Session) -> None:
    colours = np.empty((256, 4), np.uint8)
    colours[:] = palette.UNKNOWN
    # Values between free and occupied are shades between the two.
    shade = np.linspace(0.0, 1.0, 101)[:, None]
    colours[:101] = np.rint((1.0 - shade) * np.array(palette.FREE) + shade * np.array(palette.OCCUPIED))
    track = session.track("map", OccupancyGrid)
    before = OccupancyGrid()
    for time, grid in zip(track.times, track.messages, strict=True):
        if len(grid.cells) != grid.width * grid.height or not grid.cells:
            continue
        # A latched map comes again with every part of a file.
        if (grid.version, grid.cells) == (before.version, before.cells):
            continue
        before = grid
        cells = np.frombuffer(grid.cells, np.uint8).reshape(grid.height, grid.width)
        # Rerun's row 0 is the top row; the wire's is the lowest.
        picture = colours[np.flipud(cells)]
        canvas.row(
            "/map/grid",
            int(time),
            rr.GridMap(
                data=picture.tobytes(),
                format=rr.components.ImageFormat(
                    width=grid.width, height=grid.height, color_model="RGBA", channel_datatype="U8"
                ),
                cell_size=grid.resolution,
                translation=[grid.origin.x, grid.origin.y, 0.0],
            ),
        )


def _draw_corridors(canvas: Canvas, session: Session) -> None:
    track = session.track("corridor", Corridor)
    if not len(track):
        return
    paths = [np.column_stack([m.path.x, m.path.y]).astype(np.float64).reshape(-1, 2) for m in track.messages]
    lines_over_time(canvas, "/map/corridor/path", track.times, [[path] for path in paths], EDGE, palette.PATH, 2.0)
    for name, edges, colour in (
        ("edge_push", [m.edge_push for m in track.messages], palette.CORRIDOR),
        ("edge_object", [m.edge_object for m in track.messages], palette.OBJECT_CORRIDOR),
    ):
        lines = [[np.column_stack([e.x, e.y]).reshape(-1, 2) for e in each] for each in edges]
        lines_over_time(canvas, f"/map/corridor/{name}", track.times, lines, EDGE, colour, 2.2)
    for name, widths, colour, height in (
        ("fill_push", [m.width_push for m in track.messages], palette.CORRIDOR_FILL, FILL),
        ("fill_object", [m.width_object for m in track.messages], palette.OBJECT_CORRIDOR_FILL, INNER_FILL),
    ):
        strips = [
            band(path, np.array(width, np.float64)) if len(path) == len(width) else band(path[:0], path[:0, 0])
            for path, width in zip(paths, widths, strict=True)
        ]
        corners = [len(points) for points, _ in strips]
        faces = [len(triangles) for _, triangles in strips]
        canvas.fixed(f"/map/corridor/{name}", rr.Mesh3D.from_fields(albedo_factor=colour))
        canvas.columns(
            f"/map/corridor/{name}",
            track.times,
            rr.Mesh3D.columns(vertex_positions=raised(np.vstack([p for p, _ in strips]), height)).partition(corners),
            rr.Mesh3D.columns(triangle_indices=np.vstack([f for _, f in strips])).partition(faces),
        )


def lines_over_time(
    canvas: Canvas,
    entity: str,
    times: NDArray[np.int64],
    lines: list[list[NDArray[np.float64]]],
    height: float,
    colour: palette.Colour,
    width: float,
) -> None:
    """Any number of lines per row; a row without any clears the ones before."""
    drawn = [[line for line in row if len(line) >= 2] for row in lines]
    flat = [raised(line, height) for row in drawn for line in row]
    if not flat:
        return
    canvas.fixed(entity, rr.LineStrips3D.from_fields(colors=[colour], radii=[rr.Radius.ui_points(width / 2.0)]))
    canvas.columns(entity, times, rr.LineStrips3D.columns(strips=flat).partition([len(row) for row in drawn]))


def _draw_targets(canvas: Canvas, session: Session) -> None:
    track = session.track("push/target", PushTarget)
    if not len(track):
        return
    t = np.array([(m.target.x, m.target.y) for m in track.messages])
    o = np.array([(m.object.x, m.object.y) for m in track.messages])
    p = np.array([(m.push_position.x, m.push_position.y) for m in track.messages])
    canvas.fixed(
        "/map/push_line",
        rr.LineStrips3D.from_fields(colors=[palette.PUSH_LINE], radii=[rr.Radius.ui_points(1.1)]),
    )
    canvas.columns(
        "/map/push_line", track.times, rr.LineStrips3D.columns(strips=raised(np.stack([o, t], axis=1), PLAN))
    )
    for name, points, colour in (("target", t, palette.TARGET), ("push_position", p, palette.PUSH_POSITION)):
        canvas.fixed(
            f"/map/{name}",
            rr.Points3D.from_fields(
                colors=[colour],
                radii=[rr.Radius.ui_points(4.0)],
                labels=[name[0]],
                show_labels=name == "target",
            ),
        )
        canvas.columns(f"/map/{name}", track.times, rr.Points3D.columns(positions=raised(points, MARK)))


def _draw_goals(canvas: Canvas, session: Session) -> None:
    track = session.track("push/goal", PushGoal)
    if not len(track):
        return
    g = np.array([(m.position.x, m.position.y) for m in track.messages])
    precision = np.array([m.precision for m in track.messages])
    colours = [palette.GOAL if m.active else palette.GONE for m in track.messages]
    canvas.fixed("/map/goal/precision", rr.LineStrips3D.from_fields(radii=[rr.Radius.ui_points(1.3)]))
    rings = g[:, None, :] + precision[:, None, None] * circle()[None, :, :]
    canvas.columns(
        "/map/goal/precision",
        track.times,
        rr.LineStrips3D.columns(strips=raised(rings, PLAN), colors=colours),
    )
    canvas.fixed(
        "/map/goal/centre",
        rr.Points3D.from_fields(radii=[rr.Radius.ui_points(4.0)], labels=["goal"], show_labels=True),
    )
    canvas.columns("/map/goal/centre", track.times, rr.Points3D.columns(positions=raised(g, PLAN), colors=colours))
    wanted = np.array([m.HasField("yaw") for m in track.messages])
    if wanted.any():
        yaws = np.array([m.yaw for m in track.messages])[wanted]
        ahead = ARROW_LENGTH * np.column_stack([np.cos(yaws), np.sin(yaws)])
        arrows = rr.Arrows3D.columns(
            origins=raised(g[wanted], PLAN),
            vectors=raised(ahead, 0.0),
            colors=[colour for colour, shown in zip(colours, wanted, strict=True) if shown],
        )
        canvas.fixed("/map/goal/orientation", rr.Arrows3D.from_fields(radii=[rr.Radius.ui_points(1.3)]))
        # A row for every goal, an empty one for those that want none: an arrow is not to outlive its goal.
        canvas.columns("/map/goal/orientation", track.times, arrows.partition(wanted.astype(np.int64)))
