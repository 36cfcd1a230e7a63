"""The feeder's loop in made-up time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import pytest

from drivers.camera.feed import Tally, feed
from drivers.camera.picture import Ended, NoPicture, Picture
from runtime.messages import CompressedImage


@dataclass
class World:
    """Time, a camera that exposes a picture every `period`, and what becomes of its pictures.

    Attributes:
        gone: (from, to) in which the camera gives none, s.
        answering: s that the service takes.
        given: (when, number of the picture) that the service got.
    """

    period: float = 0.04
    phase: float = 0.0
    last: int = 10_000
    live: bool = True
    gone: tuple[float, float] = (0.0, 0.0)
    answering: float = 0.0
    end: float = 10.0
    reason: Callable[[float], str] = lambda _: ""
    now: float = 0.0
    next: int = 0
    there: bool = False
    closed: bool = False
    given: list[tuple[float, int]] = field(default_factory=list)
    lines: list[tuple[float, str]] = field(default_factory=list)

    def take(self) -> Picture:
        assert not self.closed
        if self.next == self.last:
            raise Ended
        if self.gone[0] <= self.now < self.gone[1]:
            raise NoPicture("it is gone")
        if not self.there:
            self._expose()
        self.there = False
        return Picture("p", data=str(self.next - 1).encode())

    def advance(self) -> bool:
        if self.live:
            self._expose()
            self.there = True
        return self.live

    def _expose(self) -> None:
        """Give the next picture, waiting for it if it is not there yet: one waits at most."""
        if self.live:
            self.next = max(self.next, int((self.now - self.phase) / self.period + 1e-9))
            self.now = max(self.now, self.next * self.period + self.phase)
        self.next += 1

    def close(self) -> None:
        self.closed = True

    def wait(self, seconds: float) -> bool:
        self.now += seconds
        return self.now >= self.end

    def ask(self, picture: CompressedImage) -> str:
        assert picture.format == "jpeg"
        self.given.append((self.now, int(picture.data)))
        self.now += self.answering
        return self.reason(self.now)

    def run(self, rate: float) -> Tally:
        return feed(self, self.ask, rate, lambda: self.now, self.wait, lambda line: self.lines.append((self.now, line)))

    def ages(self) -> Iterator[float]:
        return (when - self.phase - number * self.period for when, number in self.given)


@pytest.mark.parametrize("rate", [1.0, 4.0, 10.0, 25.0, 100.0])
@pytest.mark.parametrize("phase", [0.0, 0.001, 0.03])
def test_pictures_come_at_the_rate_and_are_new(rate: float, phase: float) -> None:
    world = World(phase=phase)
    tally = world.run(rate)
    assert world.closed
    assert tally.taken == len(world.given) == pytest.approx(min(rate, 25.0) * world.end, rel=0.03, abs=1)
    assert max(world.ages()) <= world.period + 1e-9


def test_a_slow_service_gets_the_newest_and_nothing_piles_up() -> None:
    world = World(answering=0.3)
    world.run(10.0)
    assert len(world.given) == pytest.approx(10.0 / 0.32, abs=3)
    assert max(world.ages()) <= world.period + 1e-9


def test_every_picture_of_a_file_is_given_in_order_and_at_the_rate() -> None:
    world = World(live=False, last=7)
    tally = world.run(5.0)
    assert [number for _, number in world.given] == list(range(7))
    assert [when for when, _ in world.given] == pytest.approx([0.2 * number for number in range(7)])
    assert (tally, world.closed) == (Tally(taken=7), True)


def test_a_camera_that_is_gone_is_waited_for_and_few_words_are_made() -> None:
    world = World(gone=(2.0, 14.0), end=20.0)
    tally = world.run(10.0)
    times = [when for when, _ in world.given]
    assert max(b - a for a, b in zip(times, times[1:], strict=False)) < 12.0 + 2.0 + 0.2  # one pause late at most
    assert times[-1] > 19.5
    assert len([when for when in times if when >= 14.0]) <= 10 * 6 + 1  # what was missed is not made up for
    assert 5 <= tally.failed < 20
    said = [text for _, text in world.lines]
    assert said[:-1] == ["it is gone; trying again"] * (len(said) - 1)
    assert said[-1] == f"pictures again, after {tally.failed} tries"
    assert all(b - a >= 5.0 for (a, _), (b, _) in zip(world.lines[:-1], world.lines[1:-1], strict=False))


def test_refusals_are_counted_and_said_now_and_then() -> None:
    world = World(reason=lambda now: "refused: too large" if now < 6.0 else "")
    tally = world.run(10.0)
    assert tally.refused == pytest.approx(60, abs=3)
    assert tally.taken == pytest.approx(40, abs=3)
    assert [text for _, text in world.lines] == ["p: refused: too large"] * 2


def test_it_ends_at_once_when_told_to_and_gives_the_device_back() -> None:
    world = World(end=0.0)
    assert world.run(10.0) == Tally()
    assert world.closed
