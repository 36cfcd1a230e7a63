"""Reads a source of pictures at a rate and gives each to the camera service, newest first, until told to stop.

Pictures that nobody has time for are never queued: the next one is taken when the answer to the last has come. The
caller brings clock and waiting, so that all of this is tested without either.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from drivers.camera.picture import Ended, NoPicture, Source
from runtime.messages import CompressedImage

Ask = Callable[[CompressedImage], str]
"""Gives a picture to the service. Returns nothing if it was taken, or why not."""

_SAY_EVERY = 5.0
_FIRST_PAUSE = 0.1
_LONGEST_PAUSE = 2.0
_TOLERATED = 2
"""Failures in a row of which nobody need know: the first request after a pause fails with Robotino."""


@dataclass
class Tally:
    """What came of the pictures.

    Attributes:
        taken: by the service.
        refused: by the service, or nobody answered.
        failed: tries in which the source gave none.
    """

    taken: int = 0
    refused: int = 0
    failed: int = 0


def feed(
    source: Source,
    ask: Ask,
    rate: float,
    clock: Callable[[], float],
    wait: Callable[[float], bool],
    say: Callable[[str], None],
    quality: int = 90,
) -> Tally:
    """Feed the service until `wait` says to stop, or the source has ended. The source is closed.

    Args:
        rate: Hz, at most.
        clock: gives s, steadily.
        wait: waits for so many s; returns True, at once, when it is time to stop.
        say: is given lines for people, few of them.
        quality: of JPEG, where the source gives none.
    """
    tally, voice = Tally(), _Voice(clock, say)
    due, failures, pause = clock(), 0, _FIRST_PAUSE
    try:
        while not wait(0.0):
            left = due - clock()
            if left > 0:
                if not source.advance():
                    wait(left)
                continue
            try:
                picture = source.take()
            except NoPicture as error:
                tally.failed += 1
                failures += 1
                if failures > _TOLERATED:
                    voice.complain(f"{error}; trying again")
                wait(pause)
                pause = min(2 * pause, _LONGEST_PAUSE)
                continue
            if failures > _TOLERATED:
                voice.report(f"pictures again, after {failures} tries")
            failures, pause = 0, _FIRST_PAUSE
            reason = ask(CompressedImage(data=picture.jpeg(quality), format="jpeg"))
            if reason:
                tally.refused += 1
                voice.complain(f"{picture.name}: {reason}")
            else:
                tally.taken += 1
            # What was missed is left out, not made up for.
            due = max(due + 1.0 / rate, clock())
    except Ended:
        pass
    finally:
        source.close()
    return tally


class _Voice:
    """Says the same kind of thing at most every few seconds."""

    def __init__(self, clock: Callable[[], float], say: Callable[[str], None]) -> None:
        self._clock = clock
        self._say = say
        self._next = clock()

    def complain(self, text: str) -> None:
        """Say what is wrong, unless something was said just now."""
        if self._clock() >= self._next:
            self.report(text)

    def report(self, text: str) -> None:
        """Say it now."""
        self._next = self._clock() + _SAY_EVERY
        self._say(text)
