"""Draws what the camera of an emulated base sees, in a process of its own: `python -m drivers.sapien.painter`.

The renderer holds Python's lock for as long as it draws, at first for seconds; a base in the same process would stand
still meanwhile. The first line in is the camera, JSON; each further line is what there is to see, and is answered by
four bytes of length and a JPEG.
"""

from __future__ import annotations

import subprocess
import sys
from types import TracebackType
from typing import IO

import cv2
import msgspec
import numpy as np

from drivers.sapien.camera import SapienCameraConfig
from drivers.sapien.look import Eye, Sight

_LENGTH = 4
_END = 2.0


class View(msgspec.Struct, frozen=True):
    """What there is to see: poses x, y, theta, m and rad, scene frame, and s since it began."""

    robot: tuple[float, float, float]
    object: tuple[float, float, float]
    seconds: float


class Painter:
    """The other end of such a process."""

    def __init__(self, config: SapienCameraConfig) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", __name__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
        )
        self._give(msgspec.json.encode(config))

    def picture(self, view: View) -> bytes:
        """Return a JPEG; empty if there is none any more. Waits for it."""
        try:
            self._give(msgspec.json.encode(view))
            out = _of(self._process.stdout)
            length = int.from_bytes(out.read(_LENGTH), "big")
            return out.read(length) if length else b""
        except (OSError, ValueError):
            return b""

    def __enter__(self) -> Painter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait(_END)
        _of(self._process.stdin).close()
        _of(self._process.stdout).close()

    def _give(self, line: bytes) -> None:
        pipe = _of(self._process.stdin)
        pipe.write(line + b"\n")
        pipe.flush()


def _of(pipe: IO[bytes] | None) -> IO[bytes]:
    assert pipe is not None
    return pipe


def main() -> None:
    """Draw until the other end closes."""
    lines, out = iter(sys.stdin.buffer.readline, b""), sys.stdout.buffer
    config = msgspec.json.decode(next(lines), type=SapienCameraConfig)
    camera = config.scene.camera
    eye = Eye(config.scene, config.body, config.base.diameter, config.fitted)
    generator = np.random.Generator(np.random.PCG64(config.seed))
    for line in lines:
        view = msgspec.json.decode(line, type=View)
        picture, _ = eye.look(Sight(view.robot, view.object, view.seconds))
        noise = camera.noise * generator.standard_normal(picture.shape, np.float32)
        grey = np.clip(np.rint(picture * (255.0 * camera.exposure) + noise), 0.0, 255.0).astype(np.uint8)
        _, data = cv2.imencode(".jpg", grey[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, camera.quality])
        out.write(len(data).to_bytes(_LENGTH, "big") + data.tobytes())
        out.flush()


if __name__ == "__main__":
    main()
