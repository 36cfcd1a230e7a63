"""What tests measure, printed at the end of a run: under pytest-xdist what a worker prints is not seen."""

from __future__ import annotations

from collections.abc import Callable

Figures = Callable[[str], None]
"""Takes a line for people. Ask for it as the fixture `figures`."""
FIGURE = "figure"
"""The key of such lines among a report's properties."""
