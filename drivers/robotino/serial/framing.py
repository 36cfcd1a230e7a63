"""Frames of the serial link of Robotino 3 and 4 (reference 2.2).

    AA | length, 2 bytes | payload | checksum, 2 bytes        all little endian

The checksum makes the sum of length and payload bytes zero modulo 65536. After the head, in the checksum too, AA and 55
are sent as 55 and the byte with bit 5 turned over. A bare AA always begins a frame.
"""

from __future__ import annotations

from dataclasses import dataclass, field

HEAD, ESCAPE, FLIP = 0xAA, 0x55, 0x20
LONGEST_SENT = 128
"""bytes of payload that a board is known to take"""
LONGEST = 512
"""bytes of payload that a board holds"""


class TooLong(ValueError):
    """A payload does not fit in a frame."""


def encode(payload: bytes, longest: int = LONGEST_SENT) -> bytes:
    """Return the frame of a payload.

    Raises:
        TooLong: it is longer than `longest`.
    """
    if len(payload) > longest:
        raise TooLong(f"payload of {len(payload)} bytes, expected at most {longest}")
    body = len(payload).to_bytes(2, "little") + payload
    body += (-sum(body) & 0xFFFF).to_bytes(2, "little")
    out = bytearray([HEAD])
    for byte in body:
        if byte in (HEAD, ESCAPE):
            out += bytes((ESCAPE, byte ^ FLIP))
        else:
            out.append(byte)
    return bytes(out)


@dataclass(frozen=True)
class Frame:
    """What came: a payload, or with `fault`, what was wrong with a frame (broken off, checksum, too long)."""

    payload: bytes
    fault: str = ""
    detail: str = ""


@dataclass
class Decoder:
    """Finds frames in bytes that come in pieces.

    Attributes:
        body: length, payload and checksum so far, without escapes. inside: a head has come. escaped: an escape has.
        skipped: bytes before heads, so far.
    """

    body: bytearray = field(default_factory=bytearray)
    inside: bool = False
    escaped: bool = False
    skipped: int = 0

    def feed(self, data: bytes) -> list[Frame]:
        """Take bytes; return the frames that end in them, and what broke off."""
        found: list[Frame] = []
        for byte in data:
            if byte == HEAD and not self.escaped:
                if self.inside:
                    found.append(Frame(b"", "broken off", f"after {len(self.body)} bytes"))
                self._begin()
            elif not self.inside:
                self.skipped += 1
            elif byte == ESCAPE and not self.escaped:
                self.escaped = True
            else:
                self.body.append(byte ^ FLIP if self.escaped else byte)
                self.escaped = False
                frame = self._ended()
                if frame is not None:
                    self.inside = False
                    found.append(frame)
        return found

    def _begin(self) -> None:
        self.body.clear()
        self.inside, self.escaped = True, False

    def _ended(self) -> Frame | None:
        if len(self.body) < 2:
            return None
        length = int.from_bytes(self.body[:2], "little")
        if length > LONGEST:
            return Frame(b"", "too long", f"{length} bytes")
        if len(self.body) < length + 4:
            return None
        found = int.from_bytes(self.body[-2:], "little")
        expected = -sum(self.body[:-2]) & 0xFFFF
        if found != expected:
            return Frame(b"", "checksum", f"{found:x} {expected:x}")
        return Frame(bytes(self.body[2:-2]))
