"""A board as a PNG to print: it says how large it is, and holds a bar of 100 mm to measure that."""

from __future__ import annotations

import struct
import zlib

import cv2
import numpy as np

from drivers.camera.board import BadBoard, Board, Kind
from drivers.camera.picture import Pixels

INCH = 0.0254
BAR = 0.1
"""Length of the bar that tells whether the printer kept the scale, m."""

_LARGEST = 30_000
_AFTER_HEADER = 33
"""Where the first chunk after the header begins in every PNG: 8 bytes of signature, 25 of header."""


def page(board: Board, resolution: float) -> tuple[Pixels, int]:
    """Return the board with a white margin of a square and the bar below, and how many pixels a square has.

    Args:
        resolution: dots an inch. Squares are whole pixels, so it is kept to a part of one: `metres` says how well.

    Raises:
        BadBoard: its squares would be too small to be drawn, or the picture too large.
    """
    side = round(board.square / INCH * resolution)
    if side < 8 or side * (max(board.columns, board.rows) + 2) > _LARGEST:
        raise BadBoard(f"squares of {side} pixels at {resolution:g} dots an inch: expected 8 to {_LARGEST} in all")
    drawn = board.drawn(side)
    strip = max(side, 60)
    sheet = np.full((drawn.shape[0] + side + 2 * strip, drawn.shape[1] + 2 * side), 255, np.uint8)
    sheet[side : side + drawn.shape[0], side : side + drawn.shape[1]] = drawn
    length, top = round(BAR * side / board.square), drawn.shape[0] + side + strip
    if length + 2 * side <= sheet.shape[1]:
        sheet[top : top + 6, side : side + length] = 0
        cv2.putText(sheet, "100 mm", (side, top + 40), cv2.FONT_HERSHEY_SIMPLEX, 1.0, 0, 2)
    return sheet, side


def png(sheet: Pixels, density: float) -> bytes:
    """Return the sheet as PNG that says its scale, pixels a metre: printed at 100 %, it is as large as it is to be."""
    _, encoded = cv2.imencode(".png", sheet)
    data = encoded.tobytes()
    density = round(density)
    body = b"pHYs" + struct.pack(">IIB", density, density, 1)
    chunk = struct.pack(">I", 9) + body + struct.pack(">I", zlib.crc32(body))
    return data[:_AFTER_HEADER] + chunk + data[_AFTER_HEADER:]


def described(board: Board) -> str:
    """Return in words what is on the sheet."""
    size = f"{board.columns * board.square * 1000:g} x {board.rows * board.square * 1000:g} mm"
    text = f"{board.kind}, {board.columns} x {board.rows} squares of {board.square * 1000:g} mm, {size} in all"
    if board.kind is Kind.CHARUCO:
        text += f", markers {board.dictionary} of {board.marker * 1000:g} mm"
    return text
