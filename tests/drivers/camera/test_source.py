"""Folders, films and devices as sources of pictures."""

from __future__ import annotations

import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from drivers.camera import source as sources
from drivers.camera.picture import Ended, NoPicture
from drivers.camera.source import BadSource, Device, opened
from drivers.camera.stills import BadAddress
from tests.drivers.camera.test_jpeg import encoded


def level(shade: int) -> np.ndarray:
    return np.full((24, 32, 3), shade, np.uint8)


def shades(source: sources.Source, most: int = 20) -> list[int]:
    found = []
    try:
        while len(found) < most:
            found.append(round(float(source.take().grey().mean())))
    except Ended:
        pass
    finally:
        source.close()
    return found


def test_a_folder_gives_its_pictures_by_name_and_jpegs_untouched(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "b.png"), level(90))
    (tmp_path / "a.JPG").write_bytes(encoded(32, 24))
    (tmp_path / "notes.txt").write_text("no picture")
    cv2.imwrite(str(tmp_path / "c.bmp"), level(30))
    folder = opened(str(tmp_path), time.monotonic)
    first = folder.take()
    assert (first.name, first.jpeg()) == ("a.JPG", encoded(32, 24))
    assert shades(folder) == [90, 30]
    again = opened(str(tmp_path / "b.png"), time.monotonic, loop=True)
    assert shades(again, most=3) == [90, 90, 90]


def test_a_file_that_is_no_picture_is_named_and_passed_over(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"no")
    cv2.imwrite(str(tmp_path / "b.png"), level(90))
    folder = opened(str(tmp_path), time.monotonic)
    with pytest.raises(NoPicture, match="a.png"):
        folder.take()
    assert shades(folder) == [90]


def film(path: Path) -> str:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (32, 24))
    assert writer.isOpened()
    for shade in (40, 120, 200):
        writer.write(level(shade))
    writer.release()
    return str(path)


def test_a_film_gives_its_pictures_in_order(tmp_path: Path) -> None:
    name = film(tmp_path / "a.avi")
    assert shades(opened(name, time.monotonic)) == pytest.approx([40, 120, 200], abs=2)
    assert shades(opened(name, time.monotonic, loop=True), most=5) == pytest.approx([40, 120, 200, 40, 120], abs=2)


def test_what_is_no_source_is_refused_with_what_was_expected(tmp_path: Path) -> None:
    with pytest.raises(BadSource, match=r"there is no nothing\.avi: expected a device number"):
        opened("nothing.avi", time.monotonic)
    with pytest.raises(BadSource, match="no pictures in"):
        opened(str(tmp_path), time.monotonic)
    (tmp_path / "a.avi").write_text("no film")
    with pytest.raises(BadSource, match="neither a picture nor a film"):
        opened(str(tmp_path / "a.avi"), time.monotonic)
    with pytest.raises(BadAddress, match="rtsp"):
        opened("rtsp://camera/1", time.monotonic)


class Capture:
    """Stands in for cv2.VideoCapture of a camera that may be unplugged."""

    plugged = True
    opened = 0
    made: list[Capture] = []

    def __init__(self, number: int) -> None:
        self.number = number
        self.settings: dict[int, float] = {}
        self.grabbed = 0
        self.released = False
        Capture.made.append(self)

    def isOpened(self) -> bool:
        return Capture.plugged

    def set(self, key: int, value: float) -> bool:
        self.settings[key] = value
        return True

    def grab(self) -> bool:
        self.grabbed += 1
        return Capture.plugged

    def retrieve(self) -> tuple[bool, np.ndarray | None]:
        return True, level(69 + self.grabbed)

    def release(self) -> None:
        self.released = True


@pytest.mark.parametrize("text", ["2", "/dev/video2"])
def test_a_device_that_was_unplugged_is_opened_again(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    Capture.made, Capture.plugged = [], True
    monkeypatch.setattr(sources.cv2, "VideoCapture", Capture)
    device = opened(text, time.monotonic, (32, 24))
    assert isinstance(device, Device)
    assert not device.advance()  # nothing is open yet, so nothing waits
    assert device.take().grey().mean() == 70
    assert device.advance() and device.advance()
    assert device.take().grey().mean() == 72  # the newest of them, and no other is waited for
    first = Capture.made[0]
    assert (first.number, first.grabbed) == (2, 3)
    assert first.settings[cv2.CAP_PROP_FRAME_WIDTH] == 32
    assert first.settings[cv2.CAP_PROP_FRAME_HEIGHT] == 24
    assert first.settings[cv2.CAP_PROP_BUFFERSIZE] == 1
    Capture.plugged = False
    with pytest.raises(NoPicture, match="still connected"):
        device.take()
    assert first.released
    with pytest.raises(NoPicture, match="cannot be opened"):
        device.take()
    Capture.plugged = True
    assert device.take().name == "camera 2 #3"
    device.close()
    assert Capture.made[-1].released
