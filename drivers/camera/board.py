"""Boards of known corners: a chessboard, or one with markers in its white squares (ChArUco), drawn and found."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.camera.picture import Pixels
from runtime.errors import PushlaneError

Array = NDArray[np.float64]

_FEWEST = 6
_FLAT = 0.1
_PREFIX = "DICT_"


class Kind(StrEnum):
    """Kinds of boards. Of a ChArUco board a part is enough; a chessboard has to be seen whole."""

    CHARUCO = "charuco"
    CHESSBOARD = "chessboard"


class BadBoard(PushlaneError):
    """No such board can be made."""


class NotSeen(Exception):
    """A picture does not show the board well enough; the message says why."""


@dataclass(frozen=True)
class Sighting:
    """Corners of the board in one picture.

    Attributes:
        points: (N, 3) float64, m, board frame: from the outer corner x along columns, y along rows, z = 0.
        pixels: (N, 2) float64, where they are in the picture.
    """

    points: Array
    pixels: Array


@dataclass(frozen=True)
class Board:
    """A board to calibrate with.

    Attributes:
        columns, rows: squares, not corners.
        square: m, side of a square.
        marker: m, side of a marker; ChArUco only.
        dictionary: of the markers, as OpenCV calls it without DICT_; ChArUco only.

    Raises:
        BadBoard: it has too few squares, or markers that do not fit.
    """

    kind: Kind = Kind.CHARUCO
    columns: int = 9
    rows: int = 6
    square: float = 0.03
    marker: float = 0.022
    dictionary: str = "5X5_100"

    def __post_init__(self) -> None:
        if min(self.columns, self.rows) < 4 or max(self.columns, self.rows) > 50:
            raise BadBoard(f"a board of {self.columns} x {self.rows} squares, expected 4 to 50 each way")
        if not 0 < self.square <= 2:
            raise BadBoard(f"squares of {self.square:g} m, expected more than 0 and at most 2")
        if self.kind is Kind.CHESSBOARD:
            return
        if not 0 < self.marker < self.square:
            raise BadBoard(f"markers of {self.marker:g} m do not fit into squares of {self.square:g} m")
        if self.dictionary not in dictionaries():
            raise BadBoard(f"no dictionary is called '{self.dictionary}'; known are {', '.join(dictionaries())}")
        markers, known = self.columns * self.rows // 2, len(self._markers().bytesList)
        if markers > known:
            raise BadBoard(
                f"{self.columns} x {self.rows} squares need {markers} markers, {self.dictionary} has {known}"
            )

    def drawn(self, pixels: int) -> Pixels:
        """Return the board, grey levels, squares of `pixels`, without a margin."""
        shape = (self.columns * pixels, self.rows * pixels)
        if self.kind is Kind.CHARUCO:
            return np.asarray(self._charuco().generateImage(shape, marginSize=0, borderBits=1), np.uint8)
        odd = np.add.outer(np.arange(self.rows), np.arange(self.columns)) % 2
        return np.kron(255 * odd, np.ones((pixels, pixels))).astype(np.uint8)

    def find(self, grey: Pixels) -> Sighting:
        """Return the corners in a picture, grey levels.

        Raises:
            NotSeen: there is no board, or too little of it.
        """
        points, pixels = self._corners(grey) if self.kind is Kind.CHESSBOARD else self._marked_corners(grey)
        if len(points) < _FEWEST:
            raise NotSeen(f"{len(points)} corners of the board, expected at least {_FEWEST}")
        # Corners in a line, or nearly, leave the board's pose open.
        spread = np.linalg.svd(points[:, :2] - points[:, :2].mean(axis=0), compute_uv=False)
        if spread[1] < _FLAT * spread[0]:
            raise NotSeen(f"{len(points)} corners of the board, all in a line")
        return Sighting(points, pixels)

    def _corners(self, grey: Pixels) -> tuple[Array, Array]:
        columns, rows = self.columns - 1, self.rows - 1
        flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY
        there, found = cv2.findChessboardCornersSB(grey, (columns, rows), flags=flags)
        if not there:
            raise NotSeen(f"no chessboard with {columns} x {rows} inner corners")
        places = (np.mgrid[0:columns, 0:rows].reshape(2, -1, order="F").T + 1) * self.square
        return np.column_stack([places, np.zeros(len(places))]), np.asarray(found, np.float64).reshape(-1, 2)

    def _marked_corners(self, grey: Pixels) -> tuple[Array, Array]:
        board = self._charuco()
        found, numbers, _, markers = cv2.aruco.CharucoDetector(board).detectBoard(grey)
        if numbers is None or not len(numbers):
            seen = 0 if markers is None else len(markers)
            raise NotSeen(f"no corner of the board, and {seen} markers of {self.dictionary}")
        points = np.asarray(board.getChessboardCorners(), np.float64)[np.asarray(numbers).ravel()]
        return points, np.asarray(found, np.float64).reshape(-1, 2)

    def _charuco(self) -> cv2.aruco.CharucoBoard:
        return cv2.aruco.CharucoBoard((self.columns, self.rows), self.square, self.marker, self._markers())

    def _markers(self) -> cv2.aruco.Dictionary:
        return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, _PREFIX + self.dictionary))


def dictionaries() -> list[str]:
    """Return the names of the dictionaries of markers."""
    return [name.removeprefix(_PREFIX) for name in dir(cv2.aruco) if name.startswith(_PREFIX) and name.isupper()]
