"""Where results can be written is found out without leaving anything behind."""

from __future__ import annotations

from pathlib import Path

import pytest

from runtime.outputs import CannotWrite, check_file, check_folder, writing


def test_asking_leaves_nothing_behind_and_changes_nothing(tmp_path: Path) -> None:
    (tmp_path / "there").write_text("precious")
    check_file(tmp_path / "new")
    check_file(tmp_path / "there", replace=True)
    check_folder(tmp_path / "a" / "folder")
    assert (tmp_path / "there").read_text() == "precious"
    assert {path.name for path in tmp_path.iterdir()} == {"there", "a"}
    assert list((tmp_path / "a" / "folder").iterdir()) == []
    with pytest.raises(CannotWrite, match="there is there already: choose another name"):
        check_file(tmp_path / "there")


def test_recordings_are_never_replaced(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"precious")
    with pytest.raises(CannotWrite, match="is a recording"):
        check_file(tmp_path / "a.mcap", replace=True)


def test_what_cannot_be_written_is_named_by_the_file_that_the_system_names_or_else_by_ours(tmp_path: Path) -> None:
    full = Path("/dev/full")
    with pytest.raises(CannotWrite, match="^cannot write /dev/full: No space left on device$"), writing(full):
        full.write_text("x")
    inner = tmp_path / "no" / "a.txt"
    with pytest.raises(CannotWrite, match=f"^cannot write {inner}: No such file or directory$"), writing(tmp_path):
        inner.write_text("x")
