"""Draws what the sensors saw: laser scans, infra-red ranges, camera pictures."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from replays.inspect import palette
from replays.inspect.canvas import Canvas, raised
from replays.inspect.places import Places
from replays.inspect.session import Session
from replays.inspect.shapes import pose_at
from runtime.messages import CompressedImage, ImageAnnotations, LaserScan, RangeArray, SeenFloor
from services.geometry.pose import placed
from services.mapping.floor import BadFloor, Seen

POINTS = 0.034


def draw_sensing(canvas: Canvas, session: Session, where: Places) -> None:
    """Puts scans and ranges on the map by the robot's pose at their time; without poses there is no place for them."""
    if len(where.robot):
        _draw_scans(canvas, session, where)
        _draw_ranges(canvas, session, where)
        _draw_floor(canvas, session, where)
    _draw_images(canvas, session)
    _draw_outlines(canvas, session)


def _draw_scans(canvas: Canvas, session: Session, where: Places) -> None:
    track = session.track("scan", LaserScan)
    if not len(track):
        return
    clouds: list[NDArray[np.float64]] = []
    stamps = np.array([scan.timestamp.ToNanoseconds() for scan in track.messages], np.int64)
    for scan, pose in zip(track.messages, pose_at(stamps, where.robot_stamps, where.robot), strict=True):
        distance = np.array(scan.ranges, np.float64)
        bearing = np.linspace(scan.start_angle, scan.end_angle, len(distance))
        hit = np.isfinite(distance) & (distance > 0.0)
        q = scan.pose.orientation
        mount = (
            scan.pose.position.x,
            scan.pose.position.y,
            2.0 * np.arctan2(q.z, q.w) if scan.HasField("pose") else 0.0,
        )
        local = distance[hit, None] * np.column_stack([np.cos(bearing[hit]), np.sin(bearing[hit])])
        clouds.append(placed(placed(local, np.array(mount)), pose))
    _points(canvas, "/map/scan", palette.SCAN, track.times, clouds)


def _points(
    canvas: Canvas, entity: str, colour: palette.Colour, times: NDArray[np.int64], clouds: list[NDArray[np.float64]]
) -> None:
    """Put (N, 2) points, map frame, at each of the times."""
    canvas.fixed(entity, rr.Points3D.from_fields(colors=[colour], radii=[rr.Radius.ui_points(1.6)]))
    positions = raised(np.vstack(clouds), POINTS)
    canvas.columns(entity, times, rr.Points3D.columns(positions=positions).partition([len(c) for c in clouds]))


def met_by(floor: SeenFloor) -> NDArray[np.float64]:
    """Return where something stands on the floor, (N, 2), m, base frame; nothing where the message makes no sense."""
    try:
        seen = Seen.of(floor)
    except BadFloor:
        return np.empty((0, 2))  # mapping leaves such a one out, and says so
    return seen.lasts[seen.met]


def _draw_floor(canvas: Canvas, session: Session, where: Places) -> None:
    """A point where the camera sees something stand on the floor."""
    track = session.track("floor", SeenFloor)
    if not len(track):
        return
    clouds: list[NDArray[np.float64]] = []
    stamps = np.array([floor.stamp for floor in track.messages], np.int64)
    for floor, pose in zip(track.messages, pose_at(stamps, where.robot_stamps, where.robot), strict=True):
        clouds.append(placed(met_by(floor), pose))
    _points(canvas, "/map/floor", palette.FLOOR_MET, track.times, clouds)


def _draw_ranges(canvas: Canvas, session: Session, where: Places) -> None:
    """A ray for each infra-red sensor that sees something, from the sensor to what it sees."""
    track = session.track("ranges", RangeArray)
    if not len(track):
        return
    rays: list[NDArray[np.float64]] = []
    stamps = np.array([reading.stamp for reading in track.messages], np.int64)
    for reading, pose in zip(track.messages, pose_at(stamps, where.robot_stamps, where.robot), strict=True):
        distance, bearing = np.array(reading.distance, np.float64), np.array(reading.bearing, np.float64)
        hit = np.isfinite(distance) & (distance < reading.maximum)
        way = np.column_stack([np.cos(bearing[hit]), np.sin(bearing[hit])])
        near, far = reading.ring_radius * way, (reading.ring_radius + distance[hit, None]) * way
        rays.append(np.stack([placed(near, pose), placed(far, pose)], axis=1))
    flat = np.vstack(rays)
    if not len(flat):
        return
    counts = [len(each) for each in rays]
    canvas.fixed(
        "/map/ranges/rays",
        rr.LineStrips3D.from_fields(colors=[palette.RANGE], radii=[rr.Radius.ui_points(0.9)]),
    )
    canvas.columns(
        "/map/ranges/rays",
        track.times,
        rr.LineStrips3D.columns(strips=raised(flat, POINTS)).partition(counts),
    )
    canvas.fixed("/map/ranges/hits", rr.Points3D.from_fields(colors=[palette.RANGE], radii=[rr.Radius.ui_points(2.6)]))
    canvas.columns(
        "/map/ranges/hits",
        track.times,
        rr.Points3D.columns(positions=raised(flat[:, 1], POINTS)).partition(counts),
    )


def _draw_images(canvas: Canvas, session: Session) -> None:
    track = session.track("image", CompressedImage)
    canvas.columns(
        "/camera/image",
        track.times,
        rr.EncodedImage.columns(
            blob=[m.data for m in track.messages], media_type=[f"image/{m.format}" for m in track.messages]
        )
        if len(track)
        else [],
    )


def _draw_outlines(canvas: Canvas, session: Session) -> None:
    """What the tracker saw in a picture, around it."""
    track = session.track("image/annotations", ImageAnnotations)
    if not len(track):
        return
    drawn = [
        [np.array([(p.x, p.y) for p in (*line.points, line.points[0])]) for line in m.points] for m in track.messages
    ]
    strips = [strip for strips in drawn for strip in strips]
    if not strips:
        return
    canvas.fixed(
        "/camera/outline", rr.LineStrips2D.from_fields(colors=[palette.OBJECT], radii=[rr.Radius.ui_points(1.5)])
    )
    canvas.columns(
        "/camera/outline",
        track.times,
        rr.LineStrips2D.columns(strips=strips).partition([len(strips) for strips in drawn]),
    )
