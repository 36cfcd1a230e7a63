"""A picture on its way from a source, and what a source of pictures is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.camera import jpeg
from runtime.errors import PushlaneError

Pixels = NDArray[np.uint8]


class NoPicture(PushlaneError):
    """The source gives no picture now; it may later."""


class Ended(Exception):
    """The source has given its last picture."""


@dataclass(frozen=True)
class Picture:
    """A picture as its source gave it: JPEG, or pixels.

    Attributes:
        name: for people.
        data: JPEG, or nothing.
        pixels: (height, width) or (height, width, 3) blue-green-red, or None where there is `data`.
    """

    name: str
    data: bytes = b""
    pixels: Pixels | None = None

    def jpeg(self, quality: int = 90) -> bytes:
        """Return it as JPEG; what came as JPEG stays as it is."""
        return self.data if self.pixels is None else jpeg.encode(self.pixels, quality)

    def grey(self) -> Pixels:
        """Return its grey levels, (height, width).

        Raises:
            BadJpeg: it cannot be decoded.
        """
        if self.pixels is None:
            return jpeg.grey(self.data)
        if self.pixels.ndim == 2:
            return self.pixels
        return np.asarray(cv2.cvtColor(self.pixels, cv2.COLOR_BGR2GRAY), np.uint8)


class Source(Protocol):
    """Gives pictures one by one."""

    def take(self) -> Picture:
        """Return the picture that `advance` went on to, or else the next one.

        Raises:
            NoPicture: there is none now; the next call tries again, from the connection on.
            Ended: there will be none.
        """

    def advance(self) -> bool:
        """Wait for the next picture, leaving out the one before. Returns False, at once, if none comes by itself."""

    def close(self) -> None:
        """Give the device back."""
