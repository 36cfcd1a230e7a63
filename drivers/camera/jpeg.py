"""JPEG at the edge: the size a file claims, read before anything is decoded, and whether it is whole."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from runtime.errors import PushlaneError

Grey = NDArray[np.uint8]

_BEGIN, _END = b"\xff\xd8", b"\xff\xd9"
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""Markers of a frame's header, which holds the size; the other three of the range are tables and one reserved."""
_ALONE = frozenset((0x01, *range(0xD0, 0xD8)))
_SCAN = 0xDA


class BadJpeg(PushlaneError):
    """These bytes are no JPEG picture, or a part of one."""


def size(data: bytes) -> tuple[int, int]:
    """Return (width, height) in pixels as the header says, without decoding.

    Raises:
        BadJpeg: the bytes do not begin or end as a JPEG does, or hold no size.
    """
    if not data.startswith(_BEGIN):
        raise BadJpeg(f"{len(data)} bytes that begin with {data[:4].hex(' ') or 'nothing'}, expected a JPEG (ff d8)")
    # Cameras that send MJPEG fill up their buffer with zeros.
    if not data.rstrip(b"\0").endswith(_END):
        raise BadJpeg(f"a JPEG of {len(data)} bytes is cut off: it ends without ff d9")
    place = 2
    while place + 4 <= len(data) and data[place] == 0xFF:
        marker = data[place + 1]
        if marker == 0xFF:
            place += 1
        elif marker in _ALONE:
            place += 2
        elif marker in _FRAMES:
            height, width = (int.from_bytes(data[at : at + 2], "big") for at in (place + 5, place + 7))
            if not width or not height:
                raise BadJpeg(f"a JPEG of {width} x {height} pixels")
            return width, height
        elif marker == _SCAN:
            break
        else:
            place += 2 + max(2, int.from_bytes(data[place + 2 : place + 4], "big"))
    raise BadJpeg(f"a JPEG of {len(data)} bytes has no header with its size")


def grey(data: bytes) -> Grey:
    """Return the picture, (height, width) uint8, grey levels.

    Raises:
        BadJpeg: it cannot be decoded.
    """
    found = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE) if data else None
    if found is None:
        raise BadJpeg(f"a JPEG of {len(data)} bytes cannot be decoded")
    return np.asarray(found, np.uint8)


def encode(pixels: NDArray[np.uint8], quality: int) -> bytes:
    """Return a picture, (height, width) grey or (height, width, 3) blue-green-red, as JPEG."""
    _, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return data.tobytes()
