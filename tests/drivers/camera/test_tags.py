"""The printed tags of the cube: OpenCV finds the right one on each, and a ruler what was promised."""

from __future__ import annotations

import io
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from drivers.camera.tags import FACES, BadTags, face
from experiments.camera.cli import calibration


def found(picture: np.ndarray) -> tuple[list[int], np.ndarray]:
    """Return the ids that OpenCV finds on white paper, and the corners of the first, (4, 2), pixels."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    paper = np.pad(picture, 200, constant_values=255)
    corners, ids, _ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(paper)
    return [int(one) for one in np.ravel(ids)], corners[0][0] - 200.0


def test_each_face_bears_its_tag_upright_and_as_large_as_it_is_said_to_be(tmp_path: Path) -> None:
    result = CliRunner().invoke(calibration, ["tags", "-o", str(tmp_path / "tags"), "--cube", "0.12", "--first", "5"])
    assert result.exit_code == 0, result.output
    for k, name in enumerate(FACES):
        with Image.open(io.BytesIO((tmp_path / "tags" / f"{k}-{name}.png").read_bytes())) as image:
            inches = np.array(image.size) / np.array(image.info["dpi"])
            picture = np.array(image)
        assert inches * 0.0254 == pytest.approx([0.12, 0.12], abs=2e-4)
        ids, corners = found(picture)
        assert ids == [5 + k]
        side = np.linalg.norm(corners[1] - corners[0]) / picture.shape[1]
        assert side == pytest.approx(6 / 8, abs=0.01), "as the tracker has it: a quiet zone of a module"
        assert corners[0][0] < corners[1][0] and corners[0][1] < corners[3][1], "its top is up"


@pytest.mark.parametrize(
    ("number", "dictionary", "cube", "said"),
    [(50, "DICT_4X4_50", 0.14, "has no tag 50"), (0, "4X4", 0.14, "no dictionary"), (0, "DICT_5X5_50", 0.14, "modules"),
     (0, "DICT_4X4_50", 1e-4, "pixels")],
)  # fmt: skip
def test_what_cannot_be_drawn_is_refused(number: int, dictionary: str, cube: float, said: str) -> None:
    with pytest.raises(BadTags, match=said):
        face(number, dictionary, cube, 300.0)
