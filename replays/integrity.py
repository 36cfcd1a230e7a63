"""Whether a file is still, byte for byte, what the recorder wrote.

Two checksums of the MCAP format together cover every byte of a complete file: that of the data section, from the
first magic up to the record that ends the data, and that of the summary, up to itself. What lies between them has
fixed values. A file that was cut off has neither; its chunks carry their own.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

MAGIC = b"\x89MCAP0\r\n"
_FOOTER = struct.Struct("<BQQQI")  # opcode, length, summary start, summary offset start, summary crc
_DATA_END = struct.Struct("<BQI")  # opcode, length, data section crc
_FOOTER_OPCODE = 0x02
_DATA_END_OPCODE = 0x0F


class NotMcap(ValueError):
    """The file does not begin as an MCAP file does."""


def damage(path: Path) -> str | None:
    """Return what is wrong with the file at `path`, or None if every byte is as it was written.

    The text begins with "cut" if the end is missing and with "corrupt" if bytes were changed.

    Raises:
        NotMcap: the first bytes are not MCAP's.
        OSError: it cannot be read.
    """
    data = path.read_bytes()
    if data[: len(MAGIC)] != MAGIC:
        raise NotMcap(f"{path} is no MCAP file: it begins with {data[: len(MAGIC)]!r}")
    footer_at = len(data) - len(MAGIC) - _FOOTER.size
    if footer_at < len(MAGIC) + _DATA_END.size:
        return "cut: the end of the file is missing"
    opcode, length, summary_at, _, summary_crc = _FOOTER.unpack_from(data, footer_at)
    whole = data.endswith(MAGIC) and opcode == _FOOTER_OPCODE and length == _FOOTER.size - 9
    if not whole:
        return _cut_or_corrupt(data, footer_at)
    if not len(MAGIC) + _DATA_END.size <= summary_at <= footer_at:
        return f"corrupt: the footer at byte {footer_at} points outside the file"
    end_at = summary_at - _DATA_END.size
    opcode, length, data_crc = _DATA_END.unpack_from(data, end_at)
    if opcode != _DATA_END_OPCODE or length != _DATA_END.size - 9:
        return f"corrupt: no end of data at byte {end_at}"
    if zlib.crc32(memoryview(data)[summary_at : footer_at + _FOOTER.size - 4]) != summary_crc:
        return f"corrupt: the checksum of the summary, bytes {summary_at} to {footer_at}, does not fit"
    if zlib.crc32(memoryview(data)[:end_at]) != data_crc:
        return f"corrupt: the checksum of the data, bytes 0 to {end_at}, does not fit"
    return None


def _cut_or_corrupt(data: bytes, footer_at: int) -> str:
    # A killed recorder leaves no footer and no closing magic. One of the two without the other is damage.
    opcode, length = struct.unpack_from("<BQ", data, footer_at)
    if data.endswith(MAGIC) or (opcode == _FOOTER_OPCODE and length == _FOOTER.size - 9):
        return f"corrupt: the end of the file, from byte {footer_at}, is damaged"
    return "cut: the end of the file is missing"
