from __future__ import annotations

import os
import subprocess
import sys
from importlib.metadata import distributions

from tests.support import ROOT


def test_exactly_one_distribution_owns_cv2() -> None:
    """sapien asks for opencv-python, which writes the same files as the headless build."""
    owners = {
        distribution.metadata["Name"]
        for distribution in distributions()
        if any(file.parts[0] == "cv2" for file in distribution.files or ())
    }
    assert owners == {"opencv-python-headless"}


def python(code: str, **environment: str) -> str:
    kept = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
    result = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env=kept | environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


def test_cv2_imports_without_a_display() -> None:
    code = "import cv2, numpy as np; print(cv2.countNonZero(cv2.dilate(np.eye(5, dtype=np.uint8), np.ones((3, 3)))))"
    assert python(code) == "19\n"  # the band of width three about the diagonal of a 5 x 5 square


HELP = """
import sys
from runtime.cli import main
sys.argv = ["pushlane", ARGUMENTS]
try:
    main.main()
except SystemExit as end:
    assert not end.code, end.code
heavy = ("sapien", "rerun", "numba", "scipy", "cv2", "matplotlib", "pyarrow", "rosbags")
print("HEAVY", [name for name in heavy if name in sys.modules])
"""


def test_help_imports_nothing_heavy() -> None:
    out = python(HELP.replace("ARGUMENTS", '"--help"'), COLUMNS="200")
    assert "replay" in out
    assert out.endswith("HEAVY []\n")


def test_help_of_a_verb_imports_nothing_heavy() -> None:
    out = python(HELP.replace("ARGUMENTS", '"sim", "--help"'), COLUMNS="200")
    assert "--seed" in out
    assert out.endswith("HEAVY []\n")
