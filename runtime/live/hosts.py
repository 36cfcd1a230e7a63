"""What the machines of a running system say of themselves when they are asked, and how far their clocks are apart."""

from __future__ import annotations

import os
import platform
import re
import shutil
import time
from dataclasses import dataclass
from pathlib import Path

import msgspec
import zenoh

from runtime.bus.keys import Keys
from runtime.live.clock import Clock
from runtime.recorder import header

_PACKAGES = ("eclipse-zenoh", "mcap", "rerun-sdk", "typer", "zstandard")
_QUESTIONS = 5
_ANSWER_LIMIT = 1.0


class HostReport(msgspec.Struct, frozen=True, kw_only=True):
    """One launcher and its machine.

    Attributes:
        host, pid: of the launcher.
        wall: its wall clock, ns.
        steady: its clock as messages are stamped, which goes on steadily whatever happens to the wall clock, ns.
        versions: of Python and packages.
        services: what it runs.
        folder: where its recordings go, empty if it records none.
        free: bytes free there.
    """

    host: str
    pid: int
    wall: int
    steady: int
    versions: dict[str, str]
    services: list[str]
    folder: str
    free: int


@dataclass(frozen=True)
class HostAnswer:
    """A report with what asking for it told of the clocks.

    Attributes:
        offset: s, how far the host's wall clock is ahead of ours.
        uncertainty: s, half the time between question and answer: the offset is known to this.
    """

    report: HostReport
    offset: float
    uncertainty: float


class HostTeller:
    """Answers for the launcher of this process.

    Args:
        folder: where recordings go, or empty.
    """

    def __init__(self, services: list[str], folder: str = "") -> None:
        self._services = services
        self._folder = str(Path(folder).resolve()) if folder else ""
        self._versions = all_versions()
        self._clock = Clock()
        self.name = f"{re.sub('[^A-Za-z0-9.-]', '-', platform.node()) or 'host'}-{os.getpid()}"

    def tell(self, query: zenoh.Query) -> None:
        """Answer one question."""
        free = shutil.disk_usage(self._folder).free if self._folder else 0
        report = HostReport(
            host=platform.node(),
            pid=os.getpid(),
            wall=time.time_ns(),
            steady=self._clock.now(),
            versions=self._versions,
            services=self._services,
            folder=self._folder,
            free=free,
        )
        query.reply(str(query.key_expr), msgspec.json.encode(report))
        query.drop()


def all_versions() -> dict[str, str]:
    """Return the versions here of everything that hosts of one system should agree in."""
    return header.versions(_PACKAGES)


def ask_hosts(session: zenoh.Session, keys: Keys) -> list[HostAnswer]:
    """Ask the launchers of the system; of each, the answer that came fastest tells the clock best."""
    best: dict[tuple[str, int], HostAnswer] = {}
    for _ in range(_QUESTIONS):
        asked = time.time_ns()
        # All answer under the key that was asked, of which consolidation would keep one.
        every = zenoh.ConsolidationMode.NONE
        for reply in session.get(keys.host("*"), timeout=_ANSWER_LIMIT, consolidation=every):
            answered = time.time_ns()
            if reply.ok is None:
                continue
            report = msgspec.json.decode(bytes(reply.ok.payload), type=HostReport)
            answer = HostAnswer(report, *offset(asked, report.wall, answered))
            name = (report.host, report.pid)
            if name not in best or answer.uncertainty < best[name].uncertainty:
                best[name] = answer
    return [best[name] for name in sorted(best)]


def offset(asked: int, there: int, answered: int) -> tuple[float, float]:
    """Return (s by which a clock that showed `there` is ahead, +- s), if it was read between `asked` and `answered`.

    Nothing is known of when in between: the middle is the best guess, and half the time the error at most.
    """
    return (there - (asked + answered) / 2) / 1e9, (answered - asked) / 2e9
