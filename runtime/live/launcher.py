"""Starts the services of this machine, watches over them, and restarts one that dies or freezes.

The launcher is also the meeting point of the system (a Zenoh router in this process) unless told that there is one.
A frozen process keeps its liveliness token, so life is told by heartbeats.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import zenoh

from runtime import topics
from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import client, hub
from runtime.errors import PushlaneError
from runtime.live.config import LiveConfig
from runtime.live.plan import Plan

RECORDER = "recorder"

_START_LIMIT = 60.0
_LOOK_EVERY = 0.05
_STOP_ORDER_PAUSE = 0.3
_STOP_LIMIT = 1.5


class ServiceLost(PushlaneError):
    """A service died more often than the launcher is to restart it."""

    exit_code = 1


@dataclass
class Child:
    """One process of the system.

    Attributes:
        beat: when its last heartbeat came, by the monotonic clock; None before the first.
        started: when the process was started, by that clock.
        due: when it is to be started again; None while it runs.
    """

    name: str
    process: subprocess.Popen[bytes] | None = None
    incarnation: int = -1
    beat: float | None = None
    started: float = 0.0
    due: float | None = 0.0


class Launcher:
    """Runs `names` of `plan` until stopped.

    Args:
        names: the services to run here; the recorder is added when `record` is given.
        record: file to record to.
        join: the meeting point is elsewhere; connect to it.
        say: is given lines for people.
    """

    def __init__(
        self,
        plan: Plan,
        bus: BusConfig,
        names: Sequence[str],
        record: Path | None = None,
        join: bool = False,
        say: Callable[[str], None] = print,
    ) -> None:
        self._plan = plan
        self._bus = bus
        self._keys = Keys(bus.robot)
        self._live = msgspec.convert(plan.sections.get("live", {}), LiveConfig)
        self._record = record
        self._join = join
        self._say = say
        self._children = {name: Child(name) for name in ([RECORDER] if record else []) + list(names)}
        self._snapshots: dict[str, bytes] = {}
        self._stop = threading.Event()
        self._wake = threading.Event()

    def stop(self) -> None:
        """End `run` soon. May be called from a signal handler or another thread."""
        self._stop.set()

    @property
    def pids(self) -> dict[str, int]:
        """Return the process of each service that runs."""
        return {name: child.process.pid for name, child in self._children.items() if child.process is not None}

    @property
    def restarts(self) -> dict[str, int]:
        """Return how often each service was restarted."""
        return {name: max(child.incarnation, 0) for name, child in self._children.items()}

    def ready(self) -> bool:
        """Return whether every service has given a sign of life."""
        return all(child.beat is not None for child in self._children.values())

    def run(self) -> None:
        """Start everything and watch over it until `stop`.

        Raises:
            NoBus: there is no meeting point.
            ServiceLost: a service cannot be kept alive.
        """
        opened = client(self._bus) if self._join else hub(self._bus)
        with TemporaryDirectory(prefix="pushlane-") as folder, opened as session:
            plan_file = Path(folder) / "plan.json"
            plan_file.write_bytes(self._plan.encoded())
            declared = [
                session.declare_subscriber(self._keys.beat("*"), self._hear),
                session.declare_subscriber(self._keys.topic("snapshot/*"), self._keep),
            ]
            teller = None if self._join else session.declare_queryable(self._keys.session(), self._tell)
            try:
                while not self._stop.is_set():
                    for child in self._children.values():
                        self._look_after(child, Path(folder), plan_file)
                    self._stop.wait(_LOOK_EVERY)
            finally:
                self._end_all()
                for one in declared:
                    one.undeclare()
                if teller is not None:
                    teller.undeclare()

    def _look_after(self, child: Child, folder: Path, plan_file: Path) -> None:
        now = time.monotonic()
        if child.process is None:
            if child.due is not None and now >= child.due:
                self._start(child, folder, plan_file)
            return
        code = child.process.poll()
        if code is not None:
            self._say(f"{child.name} ended with {code}")
        else:
            if child.beat is not None and now - child.beat > self._live.frozen_after:
                fault = f"gave no sign of life for {now - child.beat:.1f} s"
            elif child.beat is None and now - child.started > _START_LIMIT:
                fault = f"did not come up within {_START_LIMIT:g} s"
            else:
                return
            self._say(f"{child.name} {fault} and was killed")
            child.process.kill()
            child.process.wait()
        child.process, child.beat = None, None
        if child.incarnation >= self._live.restarts:
            raise ServiceLost(f"service '{child.name}' was restarted {child.incarnation} times and died again")
        # The first restart at once, then more and more slowly.
        wait = 0.0 if child.incarnation == 0 else self._live.back_off * 2 ** min(child.incarnation - 1, 6)
        child.due = now + wait

    def _start(self, child: Child, folder: Path, plan_file: Path) -> None:
        child.incarnation += 1
        child.due, child.started, child.beat = None, time.monotonic(), None
        if child.name == RECORDER:
            assert self._record is not None
            command = ["runtime.live.record", str(self._part(child.incarnation)), "--plan", str(plan_file)]
        else:
            command = ["runtime.live.service", child.name, "--plan", str(plan_file)]
            command += ["--incarnation", str(child.incarnation)]
            snapshot = self._snapshots.get(child.name)
            if child.incarnation and snapshot is not None:
                resume = folder / f"{child.name}.snapshot"
                resume.write_bytes(snapshot)
                command += ["--resume", str(resume)]
        # A group of its own: Ctrl-C is for the launcher, which ends the others in order.
        child.process = subprocess.Popen(
            [sys.executable, "-m", *command], stdin=subprocess.DEVNULL, start_new_session=True
        )

    def _part(self, incarnation: int) -> Path:
        assert self._record is not None
        if incarnation == 0:
            return self._record
        return self._record.with_stem(f"{self._record.stem}-{incarnation}")

    def _end_all(self) -> None:
        """End the controller first, so that the base stands still, then the others, and the recorder last."""
        running = {name: child.process for name, child in self._children.items() if child.process is not None}
        for name in ("controller",):
            if name in running:
                running[name].send_signal(signal.SIGTERM)
                time.sleep(_STOP_ORDER_PAUSE)
        for group in ([n for n in running if n != RECORDER], [n for n in running if n == RECORDER]):
            for name in group:
                running[name].send_signal(signal.SIGTERM)
            deadline = time.monotonic() + _STOP_LIMIT
            for name in group:
                try:
                    running[name].wait(max(0.01, deadline - time.monotonic()))
                except subprocess.TimeoutExpired:
                    running[name].kill()
                    running[name].wait()

    def _hear(self, sample: zenoh.Sample) -> None:
        child = self._children.get(str(sample.key_expr).rpartition("/")[2])
        if child is not None and child.process is not None:
            child.beat = time.monotonic()

    def _keep(self, sample: zenoh.Sample) -> None:
        name = self._keys.name(str(sample.key_expr)).removeprefix(topics.snapshot("").name)
        self._snapshots[name] = bytes(sample.payload)

    def _tell(self, query: zenoh.Query) -> None:
        query.reply(self._keys.session(), self._plan.encoded())
        query.drop()
