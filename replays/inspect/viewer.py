"""Drives the Rerun viewer: a headless one for pictures, a window or a web page for people."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path

import rerun_cli  # type: ignore[import-untyped]
from rerun.experimental import ViewerClient

from replays.inspect.canvas import TIMELINE
from replays.inspect.errors import NoDisplay, NoVulkan, Unreadable, ViewError

START = 30.0  # s for the viewer to answer; a software Vulkan compiles its shaders first
LOAD = 60.0  # s for a recording to be loaded
GREETING = 2.2  # s after its start: the viewer shows a note about itself at first
SETTLE = 0.4  # s between two pictures that must be the same
TRIES = 20
LIVE_MEMORY = "1GB"  # of a live session; beyond it the viewer forgets the oldest
_SIGNS_OF_NO_VULKAN = ("No graphics adapter", "Failed to get render context")
_DRAWING = ("re_view_", "re_viewer_context")


def save_picture(rrd: Path, out: Path, at: float | None, size: tuple[int, int]) -> None:
    """See `replays.inspect.screenshot`."""
    if not rrd.is_file():
        raise Unreadable(f"{rrd}: no such file; expected a Rerun recording")
    with _headless(size) as viewer:
        greeted = time.monotonic() + GREETING
        viewer.open(str(rrd.resolve()))
        _wait_loaded(viewer, rrd)
        when = timedelta(seconds=_end(viewer) if at is None else at)
        viewer.set_time(TIMELINE, duration=when, play_state="paused")
        time.sleep(max(greeted - time.monotonic(), SETTLE))
        _paint(viewer, out)
        _raise_reports(viewer)


def open_window(rrd: Path, web: bool) -> None:
    """See `replays.inspect.open_viewer`."""
    if not web:
        _need_screen("use --save FILE.rrd or --screenshot FILE.png")
    command = [str(_binary()), str(rrd)]
    if web:
        # The default address is every network this machine is on.
        command += ["--web-viewer", "--bind", "127.0.0.1"]
    subprocess.run(command, check=True, env=_environment())


@contextmanager
def serving(web: bool, bind: str) -> Iterator[tuple[subprocess.Popen[bytes], str, str]]:
    """Run a viewer for live data, in a window or as a web page at the address `bind`.

    Yields its process, where to send data, and, for a web page, where a browser finds it. Ends the process.

    Raises:
        NoDisplay: there is no screen for a window.
        ViewError: it did not start.
    """
    if not web:
        _need_screen("use --web, or --connect-to a viewer on another machine")
    port, page = _free_port(), _free_port()
    command = [str(_binary()), "--bind", bind if web else "127.0.0.1", "--port", str(port)]
    if web:
        command += ["--serve-web", "--web-viewer-port", str(page), "--server-memory-limit", LIVE_MEMORY]
    else:
        command += ["--hide-welcome-screen", "--expect-data-soon", "--memory-limit", LIVE_MEMORY]
    quiet = {**_environment(), "RUST_LOG": "warn"}
    process = subprocess.Popen(command, env=quiet, stdout=subprocess.DEVNULL, start_new_session=True)
    try:
        until = time.monotonic() + START
        while not _answers(port):
            if process.poll() is not None or time.monotonic() > until:
                raise ViewError("the viewer did not start; it said why above")
            time.sleep(0.1)
        host = "127.0.0.1" if bind in {"0.0.0.0", "::"} else bind
        proxy = f"rerun%2Bhttp%3A%2F%2F{host}%3A{port}%2Fproxy"
        yield process, f"rerun+http://127.0.0.1:{port}/proxy", f"http://{host}:{page}/?url={proxy}" if web else ""
    finally:
        process.terminate()
        try:
            process.wait(3.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _answers(port: int) -> bool:
    try:
        socket.create_connection(("127.0.0.1", port), timeout=0.5).close()
    except OSError:
        return False
    return True


def _need_screen(instead: str) -> None:
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise NoDisplay(f"this machine has no screen: {instead}")


def _binary() -> Path:
    """Return the viewer itself: the console script is a wrapper that leaves it alive when killed."""
    folder = Path(rerun_cli.__file__).parent
    return folder / ("rerun.exe" if sys.platform == "win32" else "rerun")


@contextmanager
def _headless(size: tuple[int, int]) -> Iterator[ViewerClient]:
    """Run a viewer without a window, drawing `size` pixels, for as long as the block runs."""
    port = _free_port()
    command = [str(_binary()), "--headless", "--hide-welcome-screen", "--bind", "127.0.0.1"]
    command += ["--port", str(port), "--window-size", f"{size[0]}x{size[1]}"]
    with tempfile.TemporaryFile() as output:
        process = subprocess.Popen(command, stdout=output, stderr=output, env=_environment())
        try:
            yield _connect(process, port)
        except (ConnectionError, RuntimeError, TimeoutError) as error:
            output.seek(0)
            raise _cause(error, output.read().decode(errors="replace")) from error
        finally:
            process.kill()
            process.wait()


def _cause(error: Exception, said: str) -> NoVulkan | ViewError:
    """Return what a viewer that failed died of, by what it said."""
    if any(sign in said for sign in _SIGNS_OF_NO_VULKAN):
        return NoVulkan(
            "no Vulkan to draw with; install the Debian packages mesa-vulkan-drivers (25 or newer, from backports) "
            "and libvulkan1: deploy/system-packages does"
        )
    return ViewError(f"the viewer failed: {error}; it said: {said[-800:]}")


def _environment() -> dict[str, str]:
    # Both keep the viewer from reporting its use.
    return {**os.environ, "RERUN_APP_ONLY": "true", "CI": "1"}


def _connect(process: subprocess.Popen[bytes], port: int) -> ViewerClient:
    """Return a client of a viewer that has painted once: without Vulkan it dies of that."""
    until = time.monotonic() + START
    while process.poll() is None:
        try:
            viewer = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            viewer.get_state()
            return viewer
        except (ConnectionError, RuntimeError, TimeoutError):
            if time.monotonic() > until:
                raise
            time.sleep(0.1)
    raise RuntimeError(f"it ended with code {process.returncode}")


def _wait_loaded(viewer: ViewerClient, rrd: Path) -> None:
    until = time.monotonic() + LOAD
    while time.monotonic() < until:
        state = viewer.get_state()
        if not state.loading and state.recordings and state.views:
            return
        time.sleep(0.1)
    raise ViewError(f"{rrd} was not loaded within {LOAD:.0f} s")


def _paint(viewer: ViewerClient, out: Path) -> None:
    """Write `out` until nothing in it changes any more."""
    before = b""
    for _ in range(TRIES):
        viewer.save_screenshot(str(out.resolve()))
        now = out.read_bytes()
        if now == before:
            return
        before = now
        time.sleep(SETTLE)
    raise ViewError(f"the picture still changes after {TRIES} times")


def _end(viewer: ViewerClient) -> float:
    """Return the last time of the recording, s."""
    lines = [line for recording in viewer.get_state().recordings for line in recording.timelines]
    return max((line.end or 0) / 1e9 for line in lines if line.name == TIMELINE)


def _raise_reports(viewer: ViewerClient) -> None:
    """Raise ViewError with everything that the views could not show."""
    wrong = [
        f"{view.name}: {report.summary} {report.details or ''}".rstrip()
        for view in viewer.get_state().views
        for report in view.reports
    ]
    # What stops before it gets to a view, such as a mesh, is only in the viewer's log.
    wrong += [
        line.message
        for line in viewer.get_logs()
        if line.level in ("WARN", "ERROR") and line.target.startswith(_DRAWING)
    ]
    if wrong:
        raise ViewError("; ".join(wrong))


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
