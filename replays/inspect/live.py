"""The command `pushlane inspect --live`: a bridge from the bus of a running system to a Rerun viewer.

It is a process of its own. What it hears only goes into a bounded queue, so a slow viewer costs messages here and
nothing anywhere else. What has come is drawn every quarter of a second, by the same code that draws a recording.
"""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlparse

import numpy as np
import pyarrow as pa
import rerun as rr
from google.protobuf.message import DecodeError, Message
from numpy.typing import NDArray

from replays.inspect.bodies import draw_bodies
from replays.inspect.canvas import Canvas
from replays.inspect.errors import ViewError
from replays.inspect.expected import draw_expected
from replays.inspect.layout import Layout
from replays.inspect.learning import draw_learning
from replays.inspect.log import draw_log
from replays.inspect.places import ground, places
from replays.inspect.plan import draw_plan
from replays.inspect.plots import draw_plots
from replays.inspect.response import draw_response
from replays.inspect.sensing import draw_sensing
from replays.inspect.session import Session, Track
from replays.inspect.states import draw_states
from replays.inspect.viewer import serving
from runtime.bus.config import BusConfig
from runtime.live.watch import window
from runtime.outputs import CannotWrite
from runtime.recorder.schema import message_type
from runtime.sample import Sample

PERIOD = 0.25  # s between two drawings
LIMIT = 5_000  # messages that wait at most: some ten seconds
_LOOK_EVERY = 1.0
_FLUSH_LIMIT = 3.0
_NOT_DRAWN = ("journal/", "snapshot/")


@dataclass
class Fed:
    """What a bridge did: messages drawn and given up, rows drawn per entity, seconds."""

    messages: int
    dropped: int
    rows: dict[str, int]
    seconds: float


@dataclass(frozen=True)
class _Column:
    """Some rows of a component's column, as Rerun takes them."""

    descriptor: rr.ComponentDescriptor
    array: pa.Array

    def component_descriptor(self) -> rr.ComponentDescriptor:
        return self.descriptor

    def as_arrow_array(self) -> pa.Array:
        return self.array


class LiveCanvas(Canvas):
    """A canvas that is given overlapping pieces of a session, and draws each row once."""

    def __init__(self, name: str, recording_id: str) -> None:
        super().__init__(name, recording_id)
        self._last: dict[tuple[str, str], int] = {}
        self._fixed: dict[tuple[str, str], list[pa.Array]] = {}

    def columns(self, entity: str, times: NDArray[np.int64], *columns: Iterable[rr.ComponentColumn]) -> None:
        """Draws the rows that are newer than what the entity has."""
        flat = [column for group in columns for column in group]
        if len(times) == 0 or not flat:
            return
        key = (entity, " ".join(sorted(str(column.component_descriptor()) for column in flat)))
        fresh = times > self._last.get(key, -1)
        if not fresh.any():
            return
        self._last[key] = int(times.max())
        rows = pa.array(fresh)
        parts = [_Column(column.component_descriptor(), column.as_arrow_array().filter(rows)) for column in flat]
        super().columns(entity, times[fresh], parts)  # type: ignore[arg-type]

    def fixed(self, entity: str, *what: rr.AsComponents) -> None:
        """Draws what holds at all times, unless it is drawn already: a viewer never forgets it."""
        batches = [batch for one in what for batch in one.as_component_batches()]
        key = (entity, " ".join(sorted(str(batch.component_descriptor()) for batch in batches)))
        arrays = [batch.as_arrow_array() for batch in batches]
        if self._fixed.get(key) == arrays:
            return
        self._fixed[key] = arrays
        super().fixed(entity, *what)

    def row(self, entity: str, time: int, what: rr.AsComponents) -> None:
        """Draws one row, unless it is drawn already."""
        if time > self._last.get((entity, ""), -1):
            self._last[(entity, "")] = time
            super().row(entity, time, what)


class Feed:
    """Draws what comes, piece by piece.

    Args:
        zero: ns, shown as time 0. What is older, such as a map, is shown from there on.
    """

    def __init__(self, canvas: LiveCanvas, zero: int) -> None:
        self.canvas = canvas
        self.messages = 0
        self._zero = zero
        self._newest: dict[str, tuple[int, Message]] = {}
        self._views: set[str] = set()

    def draw(self, samples: Iterable[Sample]) -> None:
        """Draw these messages."""
        session = self._piece(samples)
        if session is None:
            return
        canvas, where = self.canvas, places(session)
        draw_plan(canvas, session)
        draw_bodies(canvas, session, where)
        draw_sensing(canvas, session, where)
        draw_learning(canvas, session, where, history=False)
        draw_response(canvas, session, where)
        draw_expected(canvas, session, where, taken=False)
        draw_plots(canvas, session, where)
        draw_states(canvas, session)
        draw_log(canvas, session)
        views = {"/".join(entity.split("/")[:3]) for entity in canvas.rows}
        if views != self._views:
            # Only where there is something new to see: a new layout undoes what the viewer was told by hand.
            self._views = views
            canvas.recording.send_blueprint(Layout(canvas, ground(session, where), session.span, live=True).blueprint())

    def _piece(self, samples: Iterable[Sample]) -> Session | None:
        """Return the messages as a session that begins, for every topic, with the last one before them.

        What is drawn of a message may depend on the newest of other topics: a scan is put where the robot is.
        """
        rows = {topic: [newest] for topic, newest in self._newest.items()}
        undecoded: dict[str, int] = {}
        fresh = 0
        for sample in samples:
            if sample.topic.startswith(_NOT_DRAWN):
                continue
            try:
                message = message_type(sample.topic).FromString(sample.payload)
            except (KeyError, DecodeError):
                undecoded[sample.topic] = undecoded.get(sample.topic, 0) + 1
                continue
            rows.setdefault(sample.topic, []).append((max(sample.time - self._zero, 0), message))
            fresh += 1
        if not fresh:
            return None
        self.messages += fresh
        tracks = {}
        for topic, found in sorted(rows.items()):
            times = np.array([time for time, _ in found], np.int64)
            order = np.argsort(times, kind="stable")
            tracks[topic] = Track(times[order], [found[index][1] for index in order])
            self._newest[topic] = found[order[-1]]
        return Session(tracks, {}, {}, undecoded, "")


def show_live(
    bus: BusConfig,
    stop: threading.Event,
    say: Callable[[str], None],
    save: Path | None = None,
    web: bool = False,
    bind: str = "127.0.0.1",
    connect_to: str = "",
    duration: float = 0.0,
) -> Fed:
    """Feed a viewer from the running system until `stop`, the end of the viewer, or for `duration` s if above 0.

    Args:
        save: write a Rerun file instead.
        web: the viewer is a web page, at the address `bind` of this machine.
        connect_to: a viewer that runs already, as HOST, HOST:PORT or a rerun+http address.

    Raises:
        NoBus: there is no system.
        NoDisplay, ViewError: there is no viewer.
    """
    canvas = LiveCanvas("pushlane-live", f"{bus.robot}-{time.strftime('%Y%m%d-%H%M%S')}")
    zero = time.time_ns()
    with ExitStack() as stack:
        watched = stack.enter_context(window(bus, LIMIT))
        gone = _open(canvas, stack, say, save, web, bind, connect_to)
        feed = Feed(canvas, zero)
        begin, looked = time.monotonic(), time.monotonic()
        while not stop.wait(PERIOD) and (not duration or time.monotonic() - begin < duration):
            feed.draw(watched.take())
            if time.monotonic() - looked > _LOOK_EVERY:
                looked = time.monotonic()
                if gone():
                    say("the viewer is gone")
                    break
        else:
            feed.draw(watched.take())
            _flush(canvas)
        return Fed(feed.messages, watched.dropped, dict(canvas.rows), time.monotonic() - begin)


def _open(
    canvas: Canvas, stack: ExitStack, say: Callable[[str], None], save: Path | None, web: bool, bind: str, address: str
) -> Callable[[], bool]:
    """Open where the drawings go. Returns what tells whether it is gone."""
    if save is not None:
        try:
            canvas.recording.save(save)
        except RuntimeError as error:  # Rerun's for a full disk and the like
            raise CannotWrite(f"cannot write {save}: {error}") from error
        return lambda: False
    if address:
        host, port, url = _viewer_at(address)
        if not _reachable(host, port):
            raise ViewError(
                f"no viewer answers at {host}:{port}: start one there with rerun --bind ADDRESS --port {port}"
            )
        canvas.recording.connect_grpc(url)
        say(f"feeding the viewer at {host}:{port}; Ctrl-C ends it")
        return lambda: not _reachable(host, port)
    process, url, page = stack.enter_context(serving(web, bind))
    canvas.recording.connect_grpc(url)
    say(f"open {page} in a browser; Ctrl-C ends it" if page else "feeding the viewer; Ctrl-C ends it")
    if page and bind != "127.0.0.1":
        say("everybody who reaches this address sees the robot: Rerun asks for no password")
    return lambda: process.poll() is not None


def _viewer_at(address: str) -> tuple[str, int, str]:
    """Return host, port and full address of a viewer."""
    full = address if "://" in address else f"rerun+http://{address}"
    parsed = urlparse(full)
    host, port = parsed.hostname or "127.0.0.1", parsed.port or 9876
    return host, port, full if parsed.path.strip("/") else f"{parsed.scheme}://{host}:{port}/proxy"


def _reachable(host: str, port: int) -> bool:
    try:
        socket.create_connection((host, port), timeout=1.0).close()
    except OSError:
        return False
    return True


def _flush(canvas: Canvas) -> None:
    """Give what is under way to the viewer, which may have gone: then this would never end."""

    def work() -> None:
        canvas.recording.flush()
        canvas.recording.disconnect()

    worker = threading.Thread(target=work, daemon=True)
    worker.start()
    worker.join(_FLUSH_LIMIT)
