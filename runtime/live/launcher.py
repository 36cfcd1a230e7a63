"""Starts the services of this machine, watches over them, and restarts one that dies or freezes.

The launcher is also the meeting point of the system (a Zenoh router in this process) unless told that there is one.
A frozen process keeps its liveliness token, so life is told by heartbeats, which do not go over the bus.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import zenoh
from google.protobuf.message import DecodeError

from runtime import topics
from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import client, hub
from runtime.errors import PushlaneError
from runtime.live.beat import Pulse
from runtime.live.config import LiveConfig
from runtime.live.hosts import HostTeller
from runtime.live.notify import Notifier
from runtime.live.plan import Plan
from runtime.live.roll import Roll
from runtime.live.tape import RECORDER
from runtime.messages import Log

_START_LIMIT = 60.0
_ANSWER_LIMIT = 2.0
_JOIN_PATIENCE = 10.0
_LOOK_EVERY = 0.05
_STOP_ORDER_PAUSE = 0.3
_STOP_LIMIT = 2.5
_TAPE_LIMIT = 7.0
"""s for the recorder, which moves nothing, and has much to write where pictures are"""


class ServiceLost(PushlaneError):
    """A service died more often than the launcher is to restart it."""

    exit_code = 1


class PlanDiffers(PushlaneError):
    """Two launchers of one system were given different settings: a recording could hold only one of them."""


@dataclass
class Child:
    """One process of the system.

    Attributes:
        beat: when its last heartbeat came, by the monotonic clock; None before the first.
        started: when the process was started, by that clock.
        due: when it is to be started again; None while it runs.
        pulse: where its heartbeats come; None while it does not run.
    """

    name: str
    process: subprocess.Popen[bytes] | None = None
    pulse: Pulse | None = None
    incarnation: int = -1
    beat: float | None = None
    started: float = 0.0
    due: float | None = 0.0


class Launcher:
    """Runs `names` of `plan` until stopped.

    Args:
        names: the services to run here.
        record: file to record to from the start.
        join: the meeting point is elsewhere; connect to it.
        recorder: also run a recorder that records when asked. It runs in any case when `record` is given.
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
        recorder: bool = False,
    ) -> None:
        self._plan = plan
        self._bus = bus
        self._keys = Keys(bus.robot)
        self._live = msgspec.convert(plan.sections.get("live", {}), LiveConfig)
        self._record = record
        self._join = join
        self._say = say
        self._children = {name: Child(name) for name in ([RECORDER] if record or recorder else []) + list(names)}
        self._snapshots: dict[str, bytes] = {}
        self._stop = threading.Event()

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
            PlanDiffers: the launcher joins a system with other settings.
        """
        notifier = Notifier()
        opened = client(self._bus, _JOIN_PATIENCE) if self._join else hub(self._bus)
        with TemporaryDirectory(prefix="pushlane-") as folder, opened as session:
            plan_file = Path(folder) / "plan.json"
            plan_file.write_bytes(self._plan.encoded())
            declared = [
                session.declare_subscriber(self._keys.topic("snapshot/*"), self._keep),
                session.declare_subscriber(self._keys.topic("log/*"), self._pass_on),
            ]
            # Where the hub is a bare router, the launcher of the first service leads.
            tells = not self._led(session) and (not self._join or self._plan.nodes[0] in self._children)
            roll = Roll(session, self._keys) if tells else None
            teller = session.declare_queryable(self._keys.session(), self._tell) if tells else None
            host = HostTeller(list(self._children), self._live.recordings if RECORDER in self._children else "")
            host_teller = session.declare_queryable(self._keys.host(host.name), host.tell)
            try:
                while not self._stop.is_set():
                    for child in self._children.values():
                        self._look_after(child, Path(folder), plan_file)
                    notifier.alive()
                    if roll is not None:
                        roll.repeat()
                    if self.ready():
                        notifier.ready()
                    self._stop.wait(_LOOK_EVERY)
            finally:
                notifier.stopping()
                self._end_all()
                for one in declared:
                    one.undeclare()
                host_teller.undeclare()
                if roll is not None:
                    roll.close()
                if teller is not None:
                    teller.undeclare()

    def _led(self, session: zenoh.Session) -> bool:
        """Return whether another launcher leads this system.

        Raises:
            PlanDiffers: it runs another configuration, seed or list of services.
        """
        if not self._join:
            return False
        for reply in session.get(self._keys.session(), timeout=_ANSWER_LIMIT):
            if reply.ok is not None:
                theirs = msgspec.json.decode(bytes(reply.ok.payload), type=Plan)
                differences = self._plan.differences(theirs)
                if differences:
                    raise PlanDiffers(
                        f"the system at {', '.join(self._bus.connect)} has another {', '.join(differences[:5])}: "
                        "give all launchers the same system file and settings"
                    )
                return True
        return False

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
            if child.pulse is not None and child.pulse.felt():
                child.beat = now
            if child.beat is not None and now - child.beat > self._live.frozen_after:
                fault = f"gave no sign of life for {now - child.beat:.1f} s"
            elif child.beat is None and now - child.started > _START_LIMIT:
                fault = f"did not come up within {_START_LIMIT:g} s"
            else:
                return
            self._say(f"{child.name} {fault} and was killed")
            child.process.kill()
            child.process.wait()
        self._forget(child)
        if child.incarnation >= self._live.restarts:
            raise ServiceLost(f"service '{child.name}' was restarted {child.incarnation} times and died again")
        # The first restart at once, then more and more slowly.
        wait = 0.0 if child.incarnation == 0 else self._live.back_off * 2 ** min(child.incarnation - 1, 6)
        child.due = now + wait

    def _start(self, child: Child, folder: Path, plan_file: Path) -> None:
        child.incarnation += 1
        child.due, child.started, child.beat = None, time.monotonic(), None
        if child.name == RECORDER:
            # A file of its own in the same folder says what it records: one that takes over goes on from that.
            command = ["runtime.live.record", "--plan", str(plan_file), "--state", str(folder / "recording.json")]
            command += ["--incarnation", str(child.incarnation)]
            if self._record is not None and child.incarnation == 0:
                command += ["--file", str(self._record)]
        else:
            command = ["runtime.live.service", child.name, "--plan", str(plan_file)]
            command += ["--incarnation", str(child.incarnation)]
            snapshot = self._snapshots.get(child.name)
            if child.incarnation and snapshot is not None:
                resume = folder / f"{child.name}.snapshot"
                resume.write_bytes(snapshot)
                command += ["--resume", str(resume)]
        # A group of its own: Ctrl-C is for the launcher, which ends the others in order.
        child.pulse = Pulse()
        child.process = subprocess.Popen(
            [sys.executable, "-m", *command], stdin=child.pulse.given.fileno(), start_new_session=True
        )
        child.pulse.given.close()

    def _forget(self, child: Child) -> None:
        if child.pulse is not None:
            child.pulse.close()
        child.process, child.pulse, child.beat = None, None, None

    def _end_all(self) -> None:
        """End the controller first, so that the base stands still, then the others, and the recorder last."""
        running = {name: child.process for name, child in self._children.items() if child.process is not None}
        for name in ("controller",):
            if name in running:
                running[name].send_signal(signal.SIGTERM)
                with suppress(subprocess.TimeoutExpired):
                    running[name].wait(_STOP_ORDER_PAUSE)
        for group in ([n for n in running if n != RECORDER], [n for n in running if n == RECORDER]):
            for name in group:
                running[name].send_signal(signal.SIGTERM)
            deadline = time.monotonic() + (_TAPE_LIMIT if RECORDER in group else _STOP_LIMIT)
            for name in group:
                try:
                    running[name].wait(max(0.01, deadline - time.monotonic()))
                except subprocess.TimeoutExpired:
                    running[name].kill()
                    running[name].wait()
        for child in self._children.values():
            if child.pulse is not None:
                child.pulse.close()

    def _keep(self, sample: zenoh.Sample) -> None:
        name = self._keys.name(str(sample.key_expr)).removeprefix(topics.snapshot("").name)
        self._snapshots[name] = bytes(sample.payload)

    def _pass_on(self, sample: zenoh.Sample) -> None:
        """Say what a service here warns of: who starts a system looks here first."""
        try:
            line = Log.FromString(bytes(sample.payload))
        except DecodeError:
            return
        if line.name in self._children and line.level >= Log.Level.Value("WARNING"):
            self._say(f"{line.name}: {line.message}")

    def _tell(self, query: zenoh.Query) -> None:
        query.reply(self._keys.session(), self._plan.encoded())
        query.drop()
