"""`pushlane calibrate` and `pushlane camera feed` as they are called."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest
import typer
from typer.testing import CliRunner, Result

from drivers.camera.board import Board
from drivers.camera.config import CameraConfig
from drivers.camera.picture import NoPicture
from experiments.camera import cli
from runtime.config.layers import effective, read_toml
from runtime.errors import PushlaneError
from tests.drivers.camera.synthetic import VIEWS, Lens, photograph


def pushlane(*arguments: str) -> Result:
    app = typer.Typer()
    cli.register(app)
    return CliRunner().invoke(app, list(arguments))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight good views, one twice, and four pictures that are none."""
    path = tmp_path_factory.mktemp("pictures")
    for number, pose in enumerate(VIEWS[:8]):
        cv2.imwrite(str(path / f"{number}.png"), photograph(Lens(), Board(), pose, seed=number))
    cv2.imwrite(str(path / "7-again.png"), photograph(Lens(), Board(), VIEWS[7], seed=99))
    cv2.imwrite(str(path / "empty.png"), np.full((480, 640), 120, np.uint8))
    cv2.imwrite(str(path / "small.png"), np.full((240, 320), 120, np.uint8))
    (path / "torn.png").write_bytes(b"\x89PNG")
    (path / "torn.jpg").write_bytes(b"\xff\xd8\xff")
    return path


def test_a_folder_becomes_a_section_that_the_camera_reads(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "calibration.toml"
    done = pushlane("calibrate", "camera", str(folder), "-o", str(path))
    assert done.exit_code == 0, done.output
    said = done.output.splitlines()
    assert "8 of 12 pictures used, 640 x 480 pixels" in said
    assert "not used, the board as in an earlier picture: 7.png" in said
    assert "not used, no corner of the board, and 0 markers of 5X5_100: empty.png" in said
    assert "not used, 320 x 240 pixels, expected 640 x 480 as the first one: small.png" in said
    assert any(line.startswith("not used, not read: torn.png") for line in said)
    assert any(line.startswith("not used, a JPEG of 3 bytes cannot be decoded: torn.jpg") for line in said)
    assert re.search(r"^  fx +5(19|20|21)\.\d{3} \+- 0\.\d{3} pixels$", done.output, re.MULTILINE)
    assert re.search(r"^  cx +32[567]\.\d{3} \+- 0\.\d{3} pixels$", done.output, re.MULTILINE)
    assert re.search(r"^  k3 +0\.000000 not estimated$", done.output, re.MULTILINE)
    mount = tmp_path / "mount.toml"
    mount.write_text("[opencv-camera.mount]\nx = 0.1\nz = 0.9\npitch = 0.7\n")
    section = effective({"opencv-camera": CameraConfig}, [read_toml(path), read_toml(mount)]).sections["opencv-camera"]
    assert isinstance(section, CameraConfig)
    assert (section.calibration.width, section.calibration.height) == (640, 480)
    assert section.calibration.focal == pytest.approx((520.0, 516.0), abs=2.0)
    assert section.calibration.centre == pytest.approx((326.5, 232.0), abs=2.0)
    assert section.calibration.distortion[0] == pytest.approx(-0.21, abs=0.02)


def test_without_a_file_the_section_is_printed(folder: Path) -> None:
    done = pushlane("calibrate", "camera", str(folder), "--views", "6")
    text = done.output[done.output.index("# pushlane calibrate: 6 views") :]
    assert tomllib.loads(text)["opencv-camera"]["calibration"]["width"] == 640


def test_too_few_views_exit_with_1_and_say_what_was_wrong_with_the_others(folder: Path) -> None:
    done = pushlane("calibrate", "camera", str(folder), "--dictionary", "6X6_100")
    assert isinstance(done.exception, PushlaneError)
    assert done.exception.exit_code == 1
    assert "0 usable views of the board, expected at least 5" in str(done.exception)
    assert "0 markers of 6X6_100" in done.output


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("camera", "nowhere"), "there is no nowhere"),
        (("camera", ".", "-o", "no/such/a.toml"), "there is no folder no/such"),
        (("camera", ".", "--board", "circles"), "--board circles: expected one of charuco, chessboard"),
        (("board", "-o", "a.pdf"), "a.pdf: expected a name that ends in .png"),
        (("board", "-o", "a.png", "--square", "0.01", "--marker", "0.02"), "markers of 0.02 m do not fit"),
        (("board", "-o", "a.png", "--columns", "40", "--rows", "40"), "need 800 markers, 5X5_100 has 100"),
    ],
)
def test_mistakes_are_named(arguments: tuple[str, ...], words: str) -> None:
    done = pushlane("calibrate", *arguments)
    assert isinstance(done.exception, PushlaneError)
    assert words in str(done.exception)


def test_a_board_is_drawn_once_and_found_again(tmp_path: Path) -> None:
    path = tmp_path / "board.png"
    done = pushlane("calibrate", "board", "-o", str(path), "--dpi", "100")
    assert done.exit_code == 0, done.output
    assert "charuco, 9 x 6 squares of 30 mm, 270 x 180 mm in all, markers 5X5_100 of 22.5 mm" in done.output
    found = Board(marker=0.0225).find(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))
    assert len(found.points) == 8 * 5
    again = pushlane("calibrate", "board", "-o", str(path))
    assert "is there already" in str(again.exception)


def test_a_camera_that_never_answers_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.camera.gather._PAUSE", 0.0)
    done = pushlane("calibrate", "camera", "http://127.0.0.1:9/cam0")
    assert isinstance(done.exception, NoPicture)
    assert "127.0.0.1:9" in str(done.exception)


def test_feeding_without_a_system_says_so() -> None:
    done = pushlane("camera", "feed", "http://127.0.0.1:9/cam0", "--set", "bus.connect=['tcp/127.0.0.1:9']")
    assert isinstance(done.exception, PushlaneError)
    assert "no hub at tcp/127.0.0.1:9" in str(done.exception)
