"""Where results go: asked before the work begins, and told in one line where they cannot be written."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile

from runtime.errors import PushlaneError


class CannotWrite(PushlaneError):
    """A result cannot be written; the message names the path and why."""


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Say which file could not be written, where the block writes `path` or files in it.

    Raises:
        CannotWrite: the block raised OSError.
    """
    try:
        yield
    except OSError as error:
        raise CannotWrite(f"cannot write {error.filename or path}: {error.strerror or error}") from error


def check_file(path: Path, replace: bool = False) -> None:
    """Raise before the work begins if its result could not be written to `path`. Nothing is left behind.

    Args:
        replace: a file that is there may be replaced, unless it is a recording.

    Raises:
        CannotWrite: its folder is missing or takes no files, it is a folder, or it is there already.
    """
    with writing(path):
        if not path.parent.is_dir():
            raise CannotWrite(f"cannot write {path}: there is no folder {path.parent}")
        if path.exists():
            if not path.is_file():
                raise CannotWrite(f"cannot write {path}: it is {'a folder' if path.is_dir() else 'no regular file'}")
            if not replace:
                raise CannotWrite(f"{path} is there already: choose another name")
            if path.suffix == ".mcap":
                raise CannotWrite(f"{path} is a recording: choose another name")
            path.open("ab").close()
        else:
            path.open("xb").close()
            path.unlink()


def check_folder(path: Path) -> None:
    """Make the folder `path`, and raise before the work begins if results could not be written into it.

    Raises:
        CannotWrite: it cannot be made, is a file, or takes no files.
    """
    with writing(path):
        path.mkdir(parents=True, exist_ok=True)
    try:
        TemporaryFile(dir=path).close()
    except OSError as error:
        raise CannotWrite(f"cannot write into {path}: {error.strerror or error}") from error
