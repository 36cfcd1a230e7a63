"""Opens what the command line names: a camera of this machine, stills over HTTP, a film, a picture or a folder."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from drivers.camera.picture import Ended, NoPicture, Picture, Source
from drivers.camera.stills import Stills
from runtime.errors import PushlaneError

_JPEG = (".jpg", ".jpeg")
_PICTURES = (*_JPEG, ".png", ".bmp", ".tif", ".tiff", ".webp", ".pgm", ".ppm")
_DEVICE = re.compile(r"(?:/dev/video)?(\d+)")


class BadSource(PushlaneError):
    """There is no such source of pictures."""


def opened(text: str, clock: Callable[[], float], size: tuple[int, int] | None = None, loop: bool = False) -> Source:
    """Return the source that `text` names.

    Args:
        text: number of a device, http:// or https:// address, film, picture, or folder of pictures.
        clock: gives s, steadily.
        size: (width, height), pixels, asked of a device.
        loop: begin files again after their end.

    Raises:
        BadSource, BadAddress: there is no such file, or it is none of these.
    """
    if "://" in text:
        return Stills(text, clock)
    device = _DEVICE.fullmatch(text)
    if device:
        return Device(int(device[1]), size)
    path = Path(text)
    if path.is_dir():
        found = sorted(one for one in path.iterdir() if one.suffix.lower() in _PICTURES)
        if not found:
            raise BadSource(f"no pictures in {path}: expected files that end in {', '.join(_PICTURES)}")
        return Folder(found, loop)
    if not path.is_file():
        raise BadSource(f"there is no {text}: expected a device number, an http:// address, a file or a folder")
    return Folder([path], loop) if path.suffix.lower() in _PICTURES else Film(path, loop)


class Folder:
    """Picture files, in order of their names."""

    def __init__(self, paths: list[Path], loop: bool = False) -> None:
        self._paths = paths
        self._loop = loop
        self._next = 0

    def take(self) -> Picture:
        """Return the next file's picture.

        Raises:
            NoPicture: the file cannot be read; the next call takes the one after. Ended: that was the last.
        """
        if self._next == len(self._paths):
            if not self._loop:
                raise Ended
            self._next = 0
        path = self._paths[self._next]
        self._next += 1
        if path.suffix.lower() in _JPEG:
            try:
                return Picture(path.name, path.read_bytes())
            except OSError as error:
                raise NoPicture(f"{path.name}: {error.strerror or error}") from error
        pixels = cv2.imread(str(path), cv2.IMREAD_COLOR)
        if pixels is None:
            raise NoPicture(f"{path.name}: is no picture that can be read")
        return Picture(path.name, pixels=np.asarray(pixels, np.uint8))

    def advance(self) -> bool:
        """Return False: every file counts."""
        return False

    def close(self) -> None:
        """Nothing is open."""


class Film:
    """The pictures of a film, in order.

    Raises:
        BadSource: OpenCV cannot read it.
    """

    def __init__(self, path: Path, loop: bool = False) -> None:
        self._path = path
        self._loop = loop
        self._number = 0
        self._capture = self._open()

    def take(self) -> Picture:
        """Return the next picture.

        Raises:
            Ended: that was the last.
        """
        there, pixels = self._capture.read()
        if not there and self._loop and self._number:
            self._capture.release()
            self._capture, self._number = self._open(), 0
            there, pixels = self._capture.read()
        if not there:
            raise Ended
        self._number += 1
        return Picture(f"{self._path.name} #{self._number}", pixels=np.asarray(pixels, np.uint8))

    def advance(self) -> bool:
        """Return False: every picture counts."""
        return False

    def close(self) -> None:
        """Close the file."""
        self._capture.release()

    def _open(self) -> cv2.VideoCapture:
        capture = cv2.VideoCapture(str(self._path))
        if not capture.isOpened():
            raise BadSource(f"{self._path} is neither a picture nor a film that OpenCV can read")
        return capture


class Device:
    """A camera of this machine. It is opened when a picture is wanted, and again when it was gone.

    Args:
        number: OpenCV's, on Linux that of /dev/video.
        size: (width, height) to ask for; the camera may give another.
    """

    def __init__(self, number: int, size: tuple[int, int] | None = None) -> None:
        self._number = number
        self._size = size
        self._capture: cv2.VideoCapture | None = None
        self._there = False
        self._taken = 0

    def take(self) -> Picture:
        """Return the picture that `advance` went on to, or wait for the next one.

        Raises:
            NoPicture: the camera cannot be opened, or gives none.
        """
        capture = self._capture or self._open()
        there, pixels = capture.retrieve() if self._there or capture.grab() else (False, None)
        self._there = False
        if not there:
            self.close()
            raise NoPicture(f"camera {self._number} gives no picture: is it still connected?")
        self._taken += 1
        return Picture(f"camera {self._number} #{self._taken}", pixels=np.asarray(pixels, np.uint8))

    def advance(self) -> bool:
        """Wait for the next picture, and decode none. Returns False if the camera is not open, or was unplugged."""
        self._there = self._capture is not None and bool(self._capture.grab())
        return self._there

    def close(self) -> None:
        """Let others use the camera."""
        if self._capture is not None:
            self._capture.release()
            self._capture = None

    def _open(self) -> cv2.VideoCapture:
        # Our error says it in one line.
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_ERROR)
        capture = cv2.VideoCapture(self._number)
        if not capture.isOpened():
            raise NoPicture(f"camera {self._number} cannot be opened: is it connected, and does nobody else use it?")
        if self._size is not None:
            capture.set(cv2.CAP_PROP_FRAME_WIDTH, self._size[0])
            capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self._size[1])
        # A picture that waited is an old one.
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        self._capture = capture
        return capture
