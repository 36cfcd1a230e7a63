"""Takes pictures from a source and keeps those that show the board, each pose of it once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.camera.board import Board, NotSeen
from drivers.camera.calibration import View, moved
from drivers.camera.jpeg import BadJpeg
from drivers.camera.picture import Ended, NoPicture, Picture, Source

_PAUSE = 0.2
_PATIENCE = 25


@dataclass
class Gathering:
    """What was found.

    Attributes:
        size: (width, height) of the pictures, pixels; None before the first.
        looked: pictures so far.
        views: of the board.
        left_out: (name of the picture, why it is no view).
    """

    size: tuple[int, int] | None = None
    looked: int = 0
    views: list[View] = field(default_factory=list)
    left_out: list[tuple[str, str]] = field(default_factory=list)

    def look(self, picture: Picture, board: Board) -> str:
        """Take a picture. Returns why it is left out, or nothing."""
        self.looked += 1
        reason = self._add(picture, board)
        if reason:
            self.left_out.append((picture.name, reason))
        return reason

    def _add(self, picture: Picture, board: Board) -> str:
        try:
            grey = picture.grey()
            size = grey.shape[1], grey.shape[0]
            if self.size is None:
                self.size = size
            if size != self.size:
                return f"{size[0]} x {size[1]} pixels, expected {self.size[0]} x {self.size[1]} as the first one"
            seen = board.find(grey)
        except (BadJpeg, NotSeen) as error:
            return str(error)
        if not all(moved(view.seen, seen, size[0]) for view in self.views):
            return "the board as in an earlier picture"
        self.views.append(View(picture.name, seen))
        return ""


def gather(
    source: Source, board: Board, most: int, wait: Callable[[float], bool], say: Callable[[str], None]
) -> Gathering:
    """Look at pictures until there are `most` views, the source has ended, or `wait` says to stop.

    Args:
        wait: waits for so many s; returns True when it is time to stop.
        say: is given a line for every view.

    Raises:
        NoPicture: a camera gave none for long.
    """
    found, failures = Gathering(), 0
    try:
        while len(found.views) < most and not wait(0.0):
            try:
                picture = source.take()
            except NoPicture as error:
                failures += 1
                found.left_out.append((str(error), "not read"))
                if failures > _PATIENCE:
                    raise
                wait(_PAUSE)
                continue
            failures = 0
            if not found.look(picture, board):
                say(f"{picture.name}: view {len(found.views)}, {len(found.views[-1].seen.points)} corners")
    except Ended:
        pass
    finally:
        source.close()
    return found
