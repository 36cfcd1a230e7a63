"""The size of a JPEG without decoding it, against the decoder's; and what is none."""

from __future__ import annotations

from contextlib import suppress

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.camera import jpeg
from drivers.camera.jpeg import BadJpeg


def encoded(width: int, height: int, *flags: int, channels: int = 3) -> bytes:
    pixels = np.random.default_rng(width).integers(0, 255, (height, width, channels), np.uint8)
    return cv2.imencode(".jpg", pixels, list(flags))[1].tobytes()


WHOLE = encoded(40, 30)


@given(
    width=st.integers(1, 300),
    height=st.integers(1, 300),
    progressive=st.sampled_from([0, 1]),
    restarts=st.sampled_from([0, 3]),
    channels=st.sampled_from([1, 3]),
)
def test_the_size_is_the_decoders(width: int, height: int, progressive: int, restarts: int, channels: int) -> None:
    flags = (cv2.IMWRITE_JPEG_PROGRESSIVE, progressive, cv2.IMWRITE_JPEG_RST_INTERVAL, restarts)
    data = encoded(width, height, *flags, channels=channels)
    assert jpeg.size(data) == (width, height)
    assert jpeg.grey(data).shape == (height, width)


def test_zeros_after_the_end_and_comments_before_the_size_are_no_fault() -> None:
    comment = b"\xff\xfe\x00\x06\xff\xc0\xff\xc0"  # looks like a header inside
    table = b"\xff\xc4\x00\x0a" + bytes(8)  # Huffman's, which may come before the size
    assert jpeg.size(WHOLE[:2] + comment + table + b"\xff" + WHOLE[2:] + bytes(100)) == (40, 30)


@given(length=st.integers(0, len(WHOLE) - 1))
def test_a_part_of_a_picture_is_refused(length: int) -> None:
    with pytest.raises(BadJpeg):
        jpeg.size(WHOLE[:length])


@given(data=st.binary(max_size=60))
def test_garbage_is_refused_and_nothing_worse_happens(data: bytes) -> None:
    with pytest.raises(BadJpeg):
        jpeg.size(b"\xff\xd9" + data)
    with suppress(BadJpeg):
        jpeg.size(b"\xff\xd8" + data + b"\xff\xd9")


@given(place=st.integers(2, len(WHOLE) - 3), value=st.integers(0, 255))
def test_a_picture_with_a_wrong_byte_gives_a_size_or_an_error_of_ours(place: int, value: int) -> None:
    data = bytearray(WHOLE)
    data[place] = value
    with suppress(BadJpeg):
        width, height = jpeg.size(bytes(data))
        assert width > 0 and height > 0
