"""`python -m experiments.fuzz`: inputs made of what the manufacturer's programs were seen to say, by mutation."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable

import numpy as np

from drivers.robotino.serial.framing import Decoder
from experiments.fuzz.feeds import RestFeed, SerialFeed

# Frames of the manufacturer's controld3 and of a bench board, and bodies of its REST server.
FRAMES = tuple(
    bytes.fromhex(one)
    for one in (
        "aa02000100fdff",
        "aa0c0034000500200022002400450010ff",
        "aa1b0009030025fb090301558a010903023103340005002000220024004500dbfc",
        "aa23000205332e302e300405312e322e334110cdccc0410000c03f0001000060ea00002701008ff8",
        "aa68003528efff00001100000018fcffff00000000e8030000000000000000003f000000000000003f0000000006249a99993e"
        "9a99993e9a99993e9a99993e9a99993e9a99993e9a99993e9a99993e9a99993e2501004110cdccc0410000c03f0001000060ea"
        "0000270100bae0",
    )
)
BODIES = (
    b"[0,0,0,0,0,0,27501]\n",
    b"[0.41,0.41,0.41,0.41,0.41,0.41,0.41,0.41,0.41]",
    b'{"value": false}',
    b'{"voltage": 24.1, "ext_power": false, "num_chargers": 1, "batteryType": "Pb", "batteryLow": false}',
    b'{"angle_min": -1, "angle_max": 1, "angle_increment": 1, "range_min": 0, "range_max": 20, "seq": 1, '
    b'"ranges": [1, 0, 2]}',
    b'{"TYPE": "CONTROLLERINFO", "payload": {"hardware": "3.0.0", "software": "1.2.3"}}',
)
_WORDS = (b"NaN", b"1e999", b"-", b"[", b"]", b"{", b"}", b"null", b"true", b'"', b"\xaa", b"\x55", b"\xff" * 8, b"")


def mutated(seed: bytes, other: bytes, generator: np.random.Generator) -> bytes:
    """Return `seed` after a few changes: bytes turned, cut out, put in, doubled, and crossed with `other`."""
    out = bytearray(seed)
    for _ in range(int(generator.integers(1, 6))):
        at = int(generator.integers(len(out) + 1))
        kind = int(generator.integers(6))
        if kind == 0 and at < len(out):
            out[at] ^= 1 << int(generator.integers(8))
        elif kind == 1:
            del out[at : at + int(generator.integers(1, 9))]
        elif kind == 2:
            out[at:at] = _WORDS[int(generator.integers(len(_WORDS)))]
        elif kind == 3:
            out[at:at] = generator.bytes(int(generator.integers(1, 9)))
        elif kind == 4:
            out[at:at] = out[at : at + 40]
        else:
            out[at:] = other[int(generator.integers(len(other) + 1)) :]
    return bytes(out[:4096])


def fuzz(name: str, seeds: tuple[bytes, ...], feed: Callable[[bytes], None], count: int, first: int) -> None:
    """Feed `count` inputs; an exception of the parser ends it, with the input in hexadecimal before."""
    generator = np.random.Generator(np.random.PCG64(first))
    began = time.perf_counter()
    for done in range(count):
        pick = generator.integers(len(seeds), size=2)
        data = mutated(seeds[pick[0]], seeds[pick[1]], generator)
        try:
            feed(data)
        except Exception:
            print(f"{name}: input {done} of seed {first}: {data.hex()}", file=sys.stderr)
            raise
    took = time.perf_counter() - began
    print(f"{name}: {count} inputs survived in {took:.0f} s, seed {first}")


def main() -> None:
    """Fuzz both parsers."""
    parser = argparse.ArgumentParser(prog="python -m experiments.fuzz", description=__doc__)
    parser.add_argument("--inputs", type=int, default=1_000_000, help="for each parser")
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    payloads = tuple(Decoder().feed(one)[0].payload for one in FRAMES)
    fuzz("serial", (*FRAMES, *payloads), SerialFeed(), asked.inputs, asked.seed)
    fuzz("REST", BODIES, RestFeed(), asked.inputs, asked.seed)


if __name__ == "__main__":
    main()
