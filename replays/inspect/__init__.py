"""Shows a session in Rerun: as a recording with its views, as a picture, or in a window.

Rerun takes a second to import, so it is imported only when one of these is called.
"""

from __future__ import annotations

from pathlib import Path

from replays.inspect.errors import NoDisplay, NoVulkan, Unreadable, ViewError
from replays.inspect.summary import InspectSummary

__all__ = [
    "InspectSummary",
    "NoDisplay",
    "NoVulkan",
    "Unreadable",
    "ViewError",
    "open_viewer",
    "screenshot",
    "to_rrd",
]


def to_rrd(session: Path, out: Path) -> InspectSummary:
    """Write the session (an MCAP file, cut ones too) as a Rerun recording with its views embedded.

    Raises:
        Unreadable: the file is no MCAP session or nothing in it can be decoded.
    """
    from replays.inspect.convert import convert

    return convert(session, out)


def screenshot(rrd: Path, out: Path, at: float | None = None, size: tuple[int, int] = (1920, 1080)) -> None:
    """Write what the viewer shows at logical time `at` (s; None: the end) as a PNG of `size` pixels.

    Raises:
        NoVulkan: nothing can draw here; the message names the packages to install.
        ViewError: a view could not show its data; the message names view and reason.
    """
    from replays.inspect.viewer import save_picture

    save_picture(rrd, out, at, size)


def open_viewer(rrd: Path, web: bool = False) -> None:
    """Open the recording in Rerun's own window, or in the browser, and wait until that is closed.

    Raises:
        NoDisplay: there is no screen for a window; the message names what works without one.
    """
    from replays.inspect.viewer import open_window

    open_window(rrd, web)
