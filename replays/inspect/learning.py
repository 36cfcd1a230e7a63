"""Draws the learned activation psi_push: around the object, for the moment, and over the session (Fig. 10)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from replays.inspect import palette
from replays.inspect.canvas import Canvas, raised
from replays.inspect.places import Places
from replays.inspect.session import Session, Track
from replays.inspect.shapes import activation_lobe, psi_push
from runtime.messages import PushBehaviour, PushGoal, PushTarget

LOBE_HEIGHT = 0.045
LOBE_REACH = 0.45  # m between the object's circle and the lobe where psi_push = 1
BARS = 72
CHART_STEP = 100_000_000  # ns between two bar charts: each is a log call of its own
HISTORY = (1000, 420)  # px of the picture over the session: time, alpha
_RAMP = np.array([(10, 10, 16), (58, 22, 96), (140, 48, 160), (236, 104, 120), (255, 214, 130)], np.float64)


@dataclass(frozen=True)
class Learned:
    """alpha, mu (rad) and kappa, (N), over the session; times in ns."""

    times: NDArray[np.int64]
    alpha: NDArray[np.float64]
    mu: NDArray[np.float64]
    kappa: NDArray[np.float64]
    alpha_p: NDArray[np.float64]


def draw_learning(canvas: Canvas, session: Session, where: Places, history: bool = True) -> None:
    """All three pictures; nothing without push/behaviour, or where it is not used.

    The one over the session needs the whole of it.
    """
    track = session.track("push/behaviour", PushBehaviour)
    # The predictive controller has no use for the activation.
    goals = session.track("push/goal", PushGoal)
    at = goals.latest(track.times)
    used = np.array([index < 0 or goals.messages[index].controller != "predictive" for index in at], bool)
    messages = [track.messages[index] for index in np.flatnonzero(used)]
    if not messages:
        return
    learned = Learned(
        track.times[used],
        np.array([m.alpha for m in messages]),
        np.array([m.mu for m in messages]),
        np.array([m.kappa for m in messages]),
        np.array([m.alpha_p for m in messages]),
    )
    _draw_lobe(canvas, session.track("push/target", PushTarget), learned, where)
    _draw_bars(canvas, learned)
    if history:
        _draw_history(canvas, learned, session.span)


def _draw_lobe(canvas: Canvas, targets: Track[PushTarget], learned: Learned, where: Places) -> None:
    at = targets.latest(learned.times)
    rows = np.flatnonzero(at >= 0)
    if not len(rows):
        return
    chosen = [targets.messages[index] for index in at[rows]]
    o = np.array([(m.object.x, m.object.y) for m in chosen])
    t = np.array([(m.target.x, m.target.y) for m in chosen])
    diameter = float(np.median(where.object_diameter)) if len(where.object) else 0.2
    lobe = activation_lobe(
        o, t, learned.mu[rows], learned.kappa[rows], np.full(len(rows), diameter / 2.0 + 0.02), LOBE_REACH
    )
    canvas.fixed("/map/activation", rr.LineStrips3D.from_fields(colors=[palette.PSI], radii=[rr.Radius.ui_points(1.3)]))
    canvas.columns("/map/activation", learned.times[rows], rr.LineStrips3D.columns(strips=raised(lobe, LOBE_HEIGHT)))


def _draw_bars(canvas: Canvas, learned: Learned) -> None:
    """psi_push over alpha for the moment, with alpha and alpha_p as bars of their own."""
    centres: NDArray[np.float64] = (np.arange(BARS, dtype=np.float64) + 0.5) * (2.0 * np.pi / BARS) - np.pi
    widths = np.full(BARS, 2.0 * np.pi / BARS)
    slot = (learned.times - learned.times[0]) // CHART_STEP
    for index in np.flatnonzero(np.diff(slot, prepend=-1)):
        time = int(learned.times[index])
        psi = psi_push(centres, learned.mu[index], learned.kappa[index])
        canvas.row("/activation/psi_push", time, rr.BarChart(psi, abscissa=centres, widths=widths, color=palette.PSI))
        for name, where, colour in (
            ("alpha", learned.alpha[index], palette.ALPHA),
            ("alpha_p", learned.alpha_p[index], palette.ALPHA_P),
        ):
            canvas.row(f"/activation/{name}", time, rr.BarChart([1.0], abscissa=[where], widths=[0.03], color=colour))


def _draw_history(canvas: Canvas, learned: Learned, span: tuple[int, int]) -> None:
    """psi_push(alpha) over the session as one picture: x is time, y is alpha, pi at the top."""
    width, height = HISTORY
    first, last = span
    step = max(last - first, 1) / width
    column_times = first + ((np.arange(width) + 0.5) * step).astype(np.int64)
    at = np.searchsorted(learned.times, column_times, side="right") - 1
    alpha = np.linspace(np.pi, -np.pi, height)
    psi = psi_push(alpha[:, None], learned.mu[at][None, :], learned.kappa[at][None, :])
    psi[:, at < 0] = 0.0
    place = psi * (len(_RAMP) - 1)
    picture = np.stack([np.interp(place, np.arange(len(_RAMP)), channel) for channel in _RAMP.T], axis=-1)
    canvas.fixed("/history/psi_push", rr.Image(np.rint(picture).astype(np.uint8), color_model="RGB"))

    def pixels(times: NDArray[np.int64], angle: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.column_stack([(times - first) / step, (np.pi - angle) / (2.0 * np.pi) * height])

    canvas.fixed(
        "/history/alpha",
        rr.Points2D(
            pixels(learned.times, learned.alpha),
            colors=[palette.MEAN_GAMMA],
            radii=[rr.Radius.ui_points(0.8)],
        ),
    )
    cursor = np.array([[[(time - first) / step, 0.0], [(time - first) / step, height]] for time in learned.times])
    canvas.fixed(
        "/history/cursor",
        rr.LineStrips2D.from_fields(colors=[(255, 255, 255, 255)], radii=[rr.Radius.ui_points(1.0)]),
    )
    canvas.columns("/history/cursor", learned.times, rr.LineStrips2D.columns(strips=cursor))
    # A spatial view has no axes: labels inside the picture's left edge say what is up.
    angles = np.array([np.pi, np.pi / 2.0, 0.0, -np.pi / 2.0, -np.pi])
    marks = pixels(np.full(len(angles), first + round(0.03 * (last - first))), angles)
    # A label hangs below its point.
    marks[:, 1] -= 0.09 * height
    canvas.fixed(
        "/history/axis",
        rr.Points2D(marks, labels=["pi", "pi/2", "0", "-pi/2", "-pi"], radii=[0.0], show_labels=True),
    )
