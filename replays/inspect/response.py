"""Draws what the predictive learner knows of the object: its outline as pushed, and how it answers pushes."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from replays.inspect import palette
from replays.inspect.canvas import Canvas, raised
from replays.inspect.places import Places
from replays.inspect.session import Session
from replays.inspect.shapes import contour_curves, quaternions
from runtime.messages import ObjectState, PushResponse
from services.predictive.model import (
    ANISOTROPY,
    AXIS,
    BASE,
    CENTRE_X,
    CENTRE_Y,
    CONTOUR,
    RADIUS,
    RESPONSE,
    RVX,
    RVY,
    RX,
    RY,
    STATE,
    YAW,
    X,
    Y,
    answer,
    radius,
)

Floats = NDArray[np.float64]

BODY = "/map/body"  # a frame that goes and turns with the object
LINE, ARROW = 0.046, 0.048
BEARINGS = 12
SPEED, DURATION, STEP = 0.3, 0.4, 0.01  # m/s, s, s: of the pushes whose answers are drawn
ANSWERS_EVERY = 200_000_000  # ns: they are computed one by one
FULL_TURN = 0.5  # rad by which such a push turns the object where its arrow has its full colour


def draw_response(canvas: Canvas, session: Session, where: Places) -> None:
    """The learned contour, its outline, easy axis, and the answer to pushes; nothing without push/response."""
    track = session.track("push/response", PushResponse)
    learned = np.array([len(m.contour) == CONTOUR and len(m.response) == RESPONSE for m in track.messages], bool)
    if not learned.any() or not len(where.object):
        return
    _draw_frame(canvas, session, where)
    numbers = np.array([[*m.contour, *m.response] for m, known in zip(track.messages, learned, strict=True) if known])
    # Most messages repeat what is known.
    changed = np.r_[True, (np.diff(numbers, axis=0) != 0.0).any(axis=1)]
    times, numbers = track.times[learned][changed], numbers[changed]
    contours, responses = numbers[:, :CONTOUR], numbers[:, CONTOUR:]
    reach, outline = contour_curves(contours, where.robot_diameter / 2.0)
    for name, curve, colour, width in (
        ("contour", reach, palette.LEARNED_FAINT, 0.6),
        ("outline", outline, palette.LEARNED, 1.3),
    ):
        canvas.fixed(
            f"{BODY}/{name}",
            rr.LineStrips3D.from_fields(colors=[colour], radii=[rr.Radius.ui_points(width)]),
        )
        canvas.columns(f"{BODY}/{name}", times, rr.LineStrips3D.columns(strips=raised(curve, LINE)))
    _draw_axis(canvas, times, contours, responses, where.robot_diameter / 2.0)
    slot = (times - times[0]) // ANSWERS_EVERY
    kept = np.flatnonzero(np.diff(slot, prepend=-1))
    _draw_answers(canvas, times[kept], contours[kept], responses[kept], where.robot_diameter / 2.0)


def _draw_frame(canvas: Canvas, session: Session, where: Places) -> None:
    """The object's pose: without a yaw of the tracker's, the one that the learner reckons."""
    objects, known = session.track("object/state", ObjectState), session.track("push/response", PushResponse)
    at = known.latest(objects.times)
    yaw = np.zeros(len(objects))
    for row, (message, index) in enumerate(zip(objects.messages, at, strict=True)):
        if message.HasField("yaw"):
            yaw[row] = message.yaw
        elif index >= 0:
            yaw[row] = known.messages[index].yaw
    canvas.columns(
        BODY,
        objects.times,
        rr.Transform3D.columns(translation=raised(where.object, 0.0), quaternion=quaternions(yaw)),
    )


def _draw_axis(canvas: Canvas, times: NDArray[np.int64], contours: Floats, responses: Floats, robot: float) -> None:
    """A line through the centre of friction along the easy axis: none for an even object, long on wheels."""
    centre = responses[:, [CENTRE_X, CENTRE_Y]]
    anisotropy = responses[:, ANISOTROPY]
    # Below 0 the axis named is the hard one.
    angle = responses[:, AXIS] + np.where(anisotropy < 0.0, 0.5 * np.pi, 0.0)
    size = np.maximum(contours.mean(axis=1) - robot, 0.0) * (1.0 - np.exp(-np.abs(anisotropy)))
    along = size[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    canvas.fixed(
        f"{BODY}/easy_axis",
        rr.LineStrips3D.from_fields(colors=[palette.EASY_AXIS], radii=[rr.Radius.ui_points(2.4)]),
    )
    strips = np.stack([centre - along, centre + along], axis=1)
    canvas.columns(f"{BODY}/easy_axis", times, rr.LineStrips3D.columns(strips=raised(strips, LINE)))
    canvas.fixed(
        f"{BODY}/friction_centre",
        rr.Points3D.from_fields(colors=[palette.EASY_AXIS], radii=[rr.Radius.ui_points(4.0)]),
    )
    canvas.columns(f"{BODY}/friction_centre", times, rr.Points3D.columns(positions=raised(centre, LINE)))


def _draw_answers(canvas: Canvas, times: NDArray[np.int64], contours: Floats, responses: Floats, robot: float) -> None:
    """For pushes from twelve bearings, at the place of touch: where the object goes, coloured by how it turns."""
    found = [answers(contour, response, robot) for contour, response in zip(contours, responses, strict=True)]
    entity = f"{BODY}/answers"
    canvas.fixed(entity, rr.Arrows3D.from_fields(radii=[rr.Radius.ui_points(1.3)]))
    rows = np.full(len(times), BEARINGS)
    turns = np.concatenate([turn for _, _, turn in found])
    share = np.clip(turns / FULL_TURN, -1.0, 1.0)[:, None]
    ends = np.where(share > 0.0, np.array(palette.TURNS_LEFT), np.array(palette.TURNS_RIGHT))
    colours = np.rint((1.0 - abs(share)) * np.array(palette.TURNS_NOT) + abs(share) * ends).astype(np.uint8)
    columns = rr.Arrows3D.columns(
        origins=raised(np.concatenate([touch for touch, _, _ in found]), ARROW),
        vectors=raised(np.concatenate([way for _, way, _ in found]), 0.0),
        colors=colours,
    )
    canvas.columns(entity, times, columns.partition(rows))


def answers(contour: Floats, response: Floats, robot: float) -> tuple[Floats, Floats, Floats]:
    """Return places of touch (BEARINGS, 2), ways (BEARINGS, 2), m, object's frame, and turns (BEARINGS), rad.

    The robot, of radius `robot`, pushes towards the object's centre with SPEED for DURATION, from bearings of
    0, 30, 60 ... degrees. What the object then does is the model's answer, as in every plan.
    """
    base = np.zeros(BASE)
    base[RADIUS] = robot
    bearings = 2.0 * np.pi * np.arange(BEARINGS) / BEARINGS
    ways, turns = np.zeros((BEARINGS, 2)), np.zeros(BEARINGS)
    for row, bearing in enumerate(bearings):
        rho, _ = radius(contour, bearing)
        away = np.array([np.cos(bearing), np.sin(bearing)])
        state = np.zeros(STATE)
        state[[RX, RY]], state[[RVX, RVY]] = rho * away, -SPEED * away
        for _ in range(round(DURATION / STEP)):
            state[[RX, RY]] += STEP * state[[RVX, RVY]]
            answer(state, STEP, base, contour, response)
        ways[row], turns[row] = state[[X, Y]], state[YAW]
    touch = contour_curves(contour[None], robot, bearings)[1][0]
    return touch, ways, turns
