"""Boards drawn and found again, and the sheet to print."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from drivers.camera import sheet
from drivers.camera.board import BadBoard, Board, Kind, NotSeen

CHESSBOARD = Board(kind=Kind.CHESSBOARD, columns=8, rows=6, square=0.025)
CHARUCO = Board(columns=7, rows=5, square=0.04, marker=0.03)


@pytest.mark.parametrize("board", [CHESSBOARD, CHARUCO], ids=lambda board: board.kind)
def test_corners_are_found_where_the_sheet_has_them(board: Board) -> None:
    drawn, side = sheet.page(board, 60 * 0.0254 / board.square)
    assert side == 60
    seen = board.find(drawn)
    assert len(seen.points) == (board.columns - 1) * (board.rows - 1)
    # The sheet is the board seen straight on: a square of margin, pixels counted from the middle of the first one.
    expected = seen.points[:, :2] / board.square * side + side - 0.5
    turned = np.array([board.columns, board.rows]) * side + 2 * side - 1 - expected
    errors = [np.abs(seen.pixels - places).max() for places in (expected, turned)]
    # A chessboard looks the same upside down.
    assert (min(errors) if board.kind is Kind.CHESSBOARD else errors[0]) < 0.25


@pytest.mark.parametrize("board", [CHESSBOARD, CHARUCO], ids=lambda board: board.kind)
def test_the_png_says_its_scale(board: Board) -> None:
    drawn, side = sheet.page(board, 300.0)
    with Image.open(io.BytesIO(sheet.png(drawn, side / board.square))) as image:
        image.load()
        assert image.size == drawn.shape[::-1]
        dots = image.info["dpi"][0]
    assert side / dots * 0.0254 == pytest.approx(board.square, rel=1e-3)
    below = drawn[(board.rows + 1) * side + side // 2 :]
    row = below[np.argmax((below == 0).sum(axis=1))]
    bar = np.flatnonzero(row == 0)
    assert (bar[-1] - bar[0] + 1) / dots * 25.4 == pytest.approx(100.0, abs=0.2)


def test_of_a_charuco_board_a_part_is_enough_and_of_a_chessboard_it_is_not() -> None:
    drawn, side = sheet.page(CHARUCO, 60 * 0.0254 / 0.04)
    half = CHARUCO.find(drawn[:, : 5 * side])
    assert 6 <= len(half.points) < 24
    np.testing.assert_allclose(half.points[:, :2] / 0.04 * side + side - 0.5, half.pixels, atol=0.25)
    drawn, side = sheet.page(CHESSBOARD, 60 * 0.0254 / 0.025)
    with pytest.raises(NotSeen, match="no chessboard with 7 x 5 inner corners"):
        CHESSBOARD.find(drawn[:, : 5 * side])


def test_too_little_of_a_board_is_not_seen() -> None:
    drawn, side = sheet.page(CHARUCO, 60 * 0.0254 / 0.04)
    with pytest.raises(NotSeen, match="4 corners of the board, expected at least 6"):
        CHARUCO.find(drawn[: round(4.4 * side), : round(4.4 * side)])
    with pytest.raises(NotSeen, match="6 corners of the board, all in a line"):
        CHARUCO.find(drawn[: round(3.4 * side)])
    with pytest.raises(NotSeen, match="no corner of the board, and 0 markers of 5X5_100"):
        CHARUCO.find(np.full((200, 200), 128, np.uint8))


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"columns": 3}, "3 x 6 squares, expected 4 to 50"),
        ({"square": 0.0}, "squares of 0 m"),
        ({"square": float("nan")}, "squares of nan m"),
        ({"marker": 0.03}, "markers of 0.03 m do not fit into squares of 0.03 m"),
        ({"dictionary": "9X9"}, "no dictionary is called '9X9'; known are 4X4_100"),
        ({"dictionary": "4X4_50", "columns": 12, "rows": 9}, "need 54 markers, 4X4_50 has 50"),
    ],
)
def test_a_board_that_cannot_be_is_refused(values: dict[str, object], words: str) -> None:
    with pytest.raises(BadBoard, match=words):
        Board(**values)  # type: ignore[arg-type]


def test_a_sheet_that_cannot_be_drawn_is_refused() -> None:
    with pytest.raises(BadBoard, match="squares of 4 pixels at 5 dots"):
        sheet.page(Board(square=0.02, marker=0.01), 5.0)
