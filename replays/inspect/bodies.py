"""Draws robot and object: bodies, trails, velocities, and the simulation's truth."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from replays.inspect import palette
from replays.inspect.canvas import Canvas, raised
from replays.inspect.places import Places
from replays.inspect.session import Session
from replays.inspect.shapes import circle, fan, pose_at, quaternions, rotated
from runtime.messages import ObjectState, Odometry, Truth, VelocityCommand, Visibility

TRAIL, BODY, OUTLINE, ARROW = 0.016, 0.022, 0.028, 0.040
NEAR = "/map/near"  # a frame that goes with the object, and does not turn
TRAIL_STEP = 100_000_000  # ns: a trail needs no more detail
ARROW_TIME = 2.0  # s: an arrow is as long as the way made in this time


def draw_bodies(canvas: Canvas, session: Session, where: Places) -> None:
    """Robot disc with heading, object disc, trails, arrows, truth."""
    if len(where.robot):
        _draw_robot(canvas, where)
        _trail(canvas, "/map/trail/robot", where.robot_times, where.robot[:, :2], palette.ROBOT)
        _draw_velocities(canvas, session, where)
    if len(where.object):
        _draw_object(canvas, session, where)
        _trail(canvas, "/map/trail/object", where.object_times, where.object, palette.OBJECT)
    _draw_truth(canvas, session, where)


def _disc(canvas: Canvas, entity: str, colour: palette.Colour) -> None:
    """A filled unit disc and its rim, to be scaled by a transform."""
    corners, triangles = fan()
    canvas.fixed(
        f"{entity}/disc",
        rr.Mesh3D(vertex_positions=raised(corners, BODY), triangle_indices=triangles, albedo_factor=colour),
    )


def _rim(canvas: Canvas, entity: str, colour: palette.Colour, width: float) -> None:
    canvas.fixed(
        entity,
        rr.LineStrips3D([raised(circle(), OUTLINE)], colors=[colour], radii=[rr.Radius.ui_points(width / 2.0)]),
    )


def _scaled(
    positions: NDArray[np.float64], theta: NDArray[np.float64], radius: NDArray[np.float64]
) -> rr.ComponentColumnList:
    """Transforms that put a unit disc of the given radius (N) at `positions` (N, 2), turned by theta (N)."""
    scale = np.column_stack([radius, radius, np.ones_like(radius)])
    return rr.Transform3D.columns(translation=raised(positions, 0.0), quaternion=quaternions(theta), scale=scale)


def _draw_robot(canvas: Canvas, where: Places) -> None:
    radius = np.full(len(where.robot), where.robot_diameter / 2.0)
    canvas.columns("/map/robot", where.robot_times, _scaled(where.robot[:, :2], where.robot[:, 2], radius))
    _disc(canvas, "/map/robot", (*palette.ROBOT[:3], 255))
    _rim(canvas, "/map/robot/rim", (190, 215, 255, 255), 2.0)
    nose = np.array([[0.92, 0.0], [0.4, 0.5], [0.4, -0.5]])
    canvas.fixed(
        "/map/robot/heading",
        rr.Mesh3D(
            vertex_positions=raised(nose, OUTLINE),
            triangle_indices=[[0, 1, 2]],
            albedo_factor=(225, 236, 255, 255),
        ),
    )


def _draw_object(canvas: Canvas, session: Session, where: Places) -> None:
    track = session.track("object/state", ObjectState)
    yaw = np.array([m.yaw if m.HasField("yaw") else 0.0 for m in track.messages])
    canvas.columns("/map/object", track.times, _scaled(where.object, yaw, where.object_diameter / 2.0))
    canvas.columns(NEAR, track.times, rr.Transform3D.columns(translation=raised(where.object, 0.0)))
    _disc(canvas, "/map/object", palette.OBJECT)
    _rim(canvas, "/map/object/rim", (255, 214, 170, 255), 2.0)
    seen = np.array([m.visibility == Visibility.VISIBLE for m in track.messages])
    changes = np.flatnonzero(np.diff(seen, prepend=~seen[:1]))
    shades = [palette.OBJECT if seen[index] else palette.PREDICTED for index in changes]
    canvas.columns("/map/object/disc", track.times[changes], rr.Mesh3D.columns(albedo_factor=shades))
    if any(m.HasField("yaw") for m in track.messages):
        canvas.fixed(
            "/map/object/yaw",
            rr.LineStrips3D(
                [raised(np.array([[0.0, 0.0], [1.0, 0.0]]), OUTLINE)],
                colors=[(60, 30, 0, 255)],
                radii=[rr.Radius.ui_points(1.2)],
            ),
        )


def _trail(
    canvas: Canvas, entity: str, times: NDArray[np.int64], points: NDArray[np.float64], colour: palette.Colour
) -> None:
    """One short segment per row; the view shows all of them up to the cursor."""
    slot = (times - times[0]) // TRAIL_STEP
    kept = np.flatnonzero(np.diff(slot, prepend=-1))
    if len(kept) < 2:
        return
    way = points[kept]
    segments = np.stack([way[:-1], way[1:]], axis=1)
    canvas.fixed(
        entity,
        rr.LineStrips3D.from_fields(colors=[(*colour[:3], 255)], radii=[rr.Radius.ui_points(1.3)]),
    )
    canvas.columns(entity, times[kept[1:]], rr.LineStrips3D.columns(strips=raised(segments, TRAIL)))


def _draw_velocities(canvas: Canvas, session: Session, where: Places) -> None:
    commands = session.track("command", VelocityCommand)
    readings = session.track("odometry", Odometry)
    for entity, track, colour in (
        ("/map/command", commands, palette.COMMAND),
        ("/map/velocity", readings, palette.BASE),
    ):
        if not len(track):
            continue
        poses = pose_at(track.times, where.robot_times, where.robot)
        velocity = np.array([(m.twist.vx, m.twist.vy) for m in track.messages], np.float64)
        ahead = rotated(velocity, poses[:, 2]) * ARROW_TIME
        canvas.fixed(entity, rr.Arrows3D.from_fields(colors=[colour], radii=[rr.Radius.ui_points(2.2)]))
        canvas.columns(
            entity,
            track.times,
            rr.Arrows3D.columns(origins=raised(poses[:, :2], ARROW), vectors=raised(ahead, 0.0)),
        )


def _draw_truth(canvas: Canvas, session: Session, where: Places) -> None:
    track = session.track("truth", Truth)
    if not len(track):
        return
    # The truth has no size of its own: the object's is the one the tracker gives at the time.
    diameter = np.full(len(track), float(np.median(where.object_diameter)) if len(where.object) else 0.2)
    for name, poses, size in (
        ("robot", [m.robot for m in track.messages], np.full(len(track), where.robot_diameter)),
        ("object", [m.object for m in track.messages], diameter),
    ):
        positions = np.array([(pose.x, pose.y) for pose in poses])
        theta = np.array([pose.theta for pose in poses])
        canvas.columns(f"/map/truth/{name}", track.times, _scaled(positions, theta, size / 2.0))
        _rim(canvas, f"/map/truth/{name}/rim", palette.TRUTH, 1.0)
        canvas.fixed(
            f"/map/truth/{name}/heading",
            rr.LineStrips3D(
                [raised(np.array([[0.8, 0.0], [1.0, 0.0]]), OUTLINE)],
                colors=[palette.TRUTH],
                radii=[rr.Radius.ui_points(0.6)],
            ),
        )
