from __future__ import annotations

import ast
import datetime
import os
import random
import secrets
import socket
import subprocess
import sys
import threading
import time
import types
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from google.protobuf.timestamp_pb2 import Timestamp

from runtime import topics
from runtime.guard import Guard, Nondeterministic
from runtime.messages import PushTarget, Snapshot
from runtime.node import Node
from runtime.service import Effects, Service, Timer, on
from runtime.service import Output as Publishes
from runtime.time import Time
from tests.support import ROOT, Count, Nothing, imported, sources

__guarded__ = True  # what this module holds by name is treated as a service module's

CLOCKS: dict[str, Callable[[], object]] = {
    "time.time": lambda: time.time(),
    "time.time_ns": lambda: time.time_ns(),
    "time.monotonic": lambda: time.monotonic(),
    "time.monotonic_ns": lambda: time.monotonic_ns(),
    "time.perf_counter": lambda: time.perf_counter(),
    "time.process_time": lambda: time.process_time(),
    "time.thread_time": lambda: time.thread_time(),
    "time.sleep": lambda: time.sleep(0),
    "time.localtime": lambda: time.localtime(),
    "time.gmtime": lambda: time.gmtime(),
    "time.ctime": lambda: time.ctime(),
    "time.clock_gettime": lambda: time.clock_gettime(time.CLOCK_MONOTONIC),
    "time.clock_gettime_ns": lambda: time.clock_gettime_ns(time.CLOCK_MONOTONIC),
    "time.strftime": lambda: time.strftime("%c"),
    "time.asctime": lambda: time.asctime(),
    "datetime.now": lambda: datetime.datetime.now(),
    "datetime.now(tz)": lambda: datetime.datetime.now(datetime.UTC),
    "datetime.utcnow": lambda: datetime.datetime.utcnow(),
    "datetime.today": lambda: datetime.datetime.today(),
    "date.today": lambda: datetime.date.today(),
}
RANDOMNESS: dict[str, Callable[[], object]] = {
    "random.random": lambda: random.random(),
    "random.gauss": lambda: random.gauss(0, 1),
    "random.shuffle": lambda: random.shuffle([1, 2]),
    "random.lognormvariate": lambda: random.lognormvariate(0, 1),
    "random.gammavariate": lambda: random.gammavariate(1, 1),
    "random.randbytes": lambda: random.randbytes(2),
    "random.Random()": lambda: random.Random(),
    "random.Random(None)": lambda: random.Random(None),
    "random.SystemRandom": lambda: random.SystemRandom().random(),
    "np.random.rand": lambda: np.random.rand(),
    "np.random.normal": lambda: np.random.normal(),
    "np.random.gamma": lambda: np.random.gamma(1.0),
    "np.random.multivariate_normal": lambda: np.random.multivariate_normal([0.0], [[1.0]]),
    "np.random.default_rng()": lambda: np.random.default_rng(),
    "np.random.default_rng(None)": lambda: np.random.default_rng(None),
    "np.random.RandomState()": lambda: np.random.RandomState(),
    "np.random.SeedSequence()": lambda: np.random.SeedSequence(),
    "np.random.Generator(PCG64())": lambda: np.random.Generator(np.random.PCG64()),
    "np.random.mtrand._rand": lambda: np.random.mtrand._rand.normal(),  # what scipy.stats draws from by default
    "os.urandom": lambda: os.urandom(1),
    "os.getrandom": lambda: os.getrandom(1),
    "uuid.uuid1": lambda: uuid.uuid1(),
    "uuid.uuid4": lambda: uuid.uuid4(),
    "secrets.token_bytes": lambda: secrets.token_bytes(1),
    "secrets.token_hex": lambda: secrets.token_hex(),
    "secrets.randbits": lambda: secrets.randbits(8),
    "secrets.choice": lambda: secrets.choice([1, 2]),
}
WORLD: dict[str, Callable[[], object]] = {
    "os.environ[...]": lambda: os.environ["PATH"],
    "os.environ.get": lambda: os.environ.get("PATH"),
    "in os.environ": lambda: "PATH" in os.environ,
    "list(os.environ)": lambda: list(os.environ),
    "dict(os.environ)": lambda: dict(os.environ),
    "os.environ[...] =": lambda: os.environ.__setitem__("PUSHLANE_TEST", "1"),
    "os.getenv": lambda: os.getenv("PATH"),
    "open": lambda: open(__file__).close(),
    "os.listdir": lambda: os.listdir("/"),
    "os.stat": lambda: os.stat(__file__).st_mtime,
    "os.path.exists": lambda: os.path.exists(__file__),
    "os.getpid": lambda: os.getpid(),
    "socket": lambda: socket.socket().close(),
    "socket.gethostname": lambda: socket.gethostname(),
    "subprocess": lambda: subprocess.run(["true"], check=True),
    "os.system": lambda: os.system("true"),
    # A thread is out of the guard's sight, so a handler may not start one.
    "threading": lambda: threading.Thread(target=int).start(),
}
BLOCKED = CLOCKS | RANDOMNESS | WORLD


@pytest.fixture
def guard() -> Iterator[Guard]:
    with Guard() as opened:
        yield opened


@pytest.mark.parametrize("call", BLOCKED.values(), ids=BLOCKED.keys())
def test_a_handler_is_refused_what_a_replay_cannot_repeat(guard: Guard, call: Callable[[], object]) -> None:
    with (
        guard.during("strategy", "choose"),
        pytest.raises(Nondeterministic, match="'strategy'.* in handler 'choose'"),
    ):
        call()


@pytest.mark.filterwarnings("ignore:.*utcnow:DeprecationWarning")
@pytest.mark.parametrize("call", BLOCKED.values(), ids=BLOCKED.keys())
def test_the_same_is_allowed_outside_handlers_and_after_one(guard: Guard, call: Callable[[], object]) -> None:
    call()
    with guard.during("strategy", "choose"):
        pass
    call()


def test_other_threads_are_not_blocked_while_a_handler_runs(guard: Guard) -> None:
    """The recorder's thread flushes while handlers run."""
    found: list[object] = []
    begin, done = threading.Event(), threading.Event()

    def work() -> None:
        begin.wait(10)
        try:
            found.extend([time.time(), os.urandom(1), os.environ.get("PATH"), len(os.listdir("/"))])
        except BaseException as error:
            found.append(error)
        done.set()

    thread = threading.Thread(target=work)
    thread.start()
    with guard.during("strategy", "choose"):
        begin.set()
        done.wait(10)
    thread.join()
    assert len(found) == 4 and not any(isinstance(value, BaseException) for value in found)


def test_seeded_generators_and_plain_dates_are_allowed(guard: Guard) -> None:
    with guard.during("strategy", "choose"):
        assert random.Random(3).random() == 0.23796462709189137  # the documented Mersenne twister, seed 3
        assert np.random.default_rng(3).random() == np.random.Generator(np.random.PCG64(3)).random()
        assert np.random.default_rng(seed=3).random() == np.random.default_rng(np.random.SeedSequence(3)).random()
        assert datetime.datetime(2024, 2, 28) + datetime.timedelta(days=2) == datetime.datetime(2024, 3, 1)
        assert datetime.date(2024, 2, 29) < datetime.date(2024, 3, 1)


def test_dates_are_what_they_were_under_guard(guard: Guard) -> None:
    elsewhere = Timestamp(seconds=86400).ToDatetime()
    assert isinstance(elsewhere, datetime.datetime)
    assert isinstance(datetime.datetime(1970, 1, 2), datetime.date)
    assert issubclass(datetime.datetime, datetime.date)
    assert datetime.datetime(1970, 1, 2) == elsewhere


IMPORTED_BY_NAME = """
from datetime import date, datetime
from os import environ, getenv, urandom
from random import Random, random
from time import monotonic, time
from uuid import uuid4
from numpy.random import default_rng, rand
import datetime as dt, numpy as np, time as clock

class Holder:
    clock = monotonic
    when = datetime
    @staticmethod
    def read():
        return Holder.clock()
"""
BY_NAME = {
    "time()": lambda m: m.time(),
    "monotonic()": lambda m: m.monotonic(),
    "clock.time()": lambda m: m.clock.time(),
    "datetime.now()": lambda m: m.datetime.now(),
    "dt.datetime.now()": lambda m: m.dt.datetime.now(),
    "date.today()": lambda m: m.date.today(),
    "random()": lambda m: m.random(),
    "Random()": lambda m: m.Random(),
    "rand()": lambda m: m.rand(),
    "default_rng()": lambda m: m.default_rng(),
    "np.random.default_rng()": lambda m: m.np.random.default_rng(),
    "urandom(1)": lambda m: m.urandom(1),
    "getenv": lambda m: m.getenv("PATH"),
    "environ": lambda m: m.environ["PATH"],
    "uuid4()": lambda m: m.uuid4(),
    "Holder.clock()": lambda m: m.Holder.read(),
    "Holder.when.now()": lambda m: m.Holder.when.now(),
}


@pytest.fixture
def module(monkeypatch: pytest.MonkeyPatch) -> types.ModuleType:
    made = types.ModuleType("guarded_by_test")
    made.__guarded__ = True  # type: ignore[attr-defined]
    exec(IMPORTED_BY_NAME, vars(made))
    monkeypatch.setitem(sys.modules, made.__name__, made)
    return made


@pytest.mark.parametrize("call", BY_NAME.values(), ids=BY_NAME.keys())
def test_names_that_a_service_module_imported_are_refused_too(
    module: types.ModuleType, call: Callable[[types.ModuleType], object]
) -> None:
    with (
        Guard() as guard,
        guard.during("strategy", "choose"),
        pytest.raises(Nondeterministic, match="strategy"),
    ):
        call(module)


def everything() -> dict[str, object]:
    held = {
        f"{owner.__name__}.{name}": value
        for owner in (time, random, secrets, uuid, os, datetime, np.random, type(os.environ))
        for name, value in vars(owner).items()
        if not name.startswith("__") or name == "__getitem__"
    }
    return held | {f"global.{name}": value for name, value in np.random.bit_generator.__dict__.items()}


def test_everything_is_as_before_once_the_guard_closes(module: types.ModuleType) -> None:
    before, names = everything(), dict(vars(module))
    with Guard() as guard:
        assert time.time is not before["time.time"]
        with guard.during("strategy", "choose"), pytest.raises(Nondeterministic):
            time.time()
    assert everything() == before
    assert vars(module) == names


def test_everything_is_as_before_after_an_error() -> None:
    before = everything()
    with pytest.raises(ZeroDivisionError), Guard():
        raise ZeroDivisionError
    assert everything() == before


def test_there_is_one_guard_at_a_time() -> None:
    before = everything()
    with Guard() as outer:
        inner = Guard()
        with pytest.raises(RuntimeError, match="another is open"), inner:
            pass
        with outer.during("strategy", "choose"), pytest.raises(Nondeterministic):
            time.time()
    assert everything() == before


def test_a_module_first_imported_under_one_guard_is_blocked_under_the_next(module: types.ModuleType) -> None:
    """Imports inside functions happen while a guard is open; what they bind must not outlive it unguarded."""
    with Guard():
        exec("from time import time as late", vars(module))
    with Guard() as guard, guard.during("strategy", "choose"), pytest.raises(Nondeterministic):
        module.late()


class Reader(Service):
    """Reads a clock, and hides the refusal."""

    name = "reader"
    Config = Nothing
    target = Publishes(topics.PUSH_TARGET)
    tick = Timer(0.1)

    def __init__(self, config: Nothing, swallow: bool) -> None:
        super().__init__(config)
        self.state = Count()
        self.swallow = swallow

    @on(tick)
    def read(self, now: Time) -> Effects:
        stamp = 0
        try:
            stamp = time.time_ns()
        except Exception:
            if not self.swallow:
                raise
            stamp = time.monotonic_ns()
        yield self.target(PushTarget(stamp=stamp))


@pytest.mark.parametrize("swallow", [False, True])
def test_a_node_runs_its_handlers_under_guard(guard: Guard, swallow: bool) -> None:
    """Also a handler that swallows the refusal has done what a replay cannot repeat."""
    node = Node(Reader(Nothing(), swallow), guard)
    node.begin(0)
    with pytest.raises(Nondeterministic, match=r"'reader' called time\.time_ns in handler 'read'"):
        node.fire("tick", 1, 100, 100)
    time.time()


class Thawer(Service):
    """Reads a clock when it is restored or frozen."""

    name = "thawer"
    Config = Nothing

    def __init__(self, config: Nothing, verb: str) -> None:
        super().__init__(config)
        self.state = Count()
        self.verb = verb

    def freeze(self) -> None:
        if self.verb == "freeze":
            time.time()

    def thaw(self) -> None:
        if self.verb == "thaw":
            time.time()


def test_freezing_is_guarded(guard: Guard) -> None:
    with pytest.raises(Nondeterministic, match="thawer"):
        Node(Thawer(Nothing(), "freeze"), guard).begin(0)


def test_thawing_is_guarded(guard: Guard) -> None:
    snapshot = Node(Thawer(Nothing(), ""), guard).begin(0)[0]
    with pytest.raises(Nondeterministic, match="thawer"):
        Node(Thawer(Nothing(), "thaw"), guard).resume(Snapshot.FromString(snapshot.payload))


FORBIDDEN = {"time", "datetime", "random", "secrets", "uuid", "os", "socket", "threading", "subprocess", "platform"}
FORBIDDEN |= {"multiprocessing", "asyncio", "signal", "select", "tempfile", "ctypes", "gc", "weakref"}


OUTSIDE = {
    *(f"drivers.robotino.rest.{name}" for name in ("wire", "exchange", "connecting", "server", "listener", "check")),
    *(f"drivers.robotino.serial.{name}" for name in ("wire", "port", "line", "check")),
    *(f"drivers.sapien.{name}" for name in ("emulator", "painter")),
}
"""What stands between a driver and a device or socket, or at the far end of it: no part of any service."""


def dotted(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


def test_services_import_nothing_that_reads_the_world() -> None:
    """A default argument, a partial or a table can hold a clock where no guard finds it; its import shows."""
    every = {dotted(path): tree for path, tree in sources("services", "drivers")}
    assert every.keys() >= OUTSIDE
    found = [
        f"{module}:{line} imports {name}"
        for module, tree in every.items()
        for name, line in imported(tree)
        if module not in OUTSIDE and (name.split(".")[0] in FORBIDDEN or name in OUTSIDE)
    ]
    assert found == []


def test_no_compiled_kernel_draws_random_numbers() -> None:
    """numba has generators of its own that no guard reaches."""
    found = [
        f"{path.name}:{node.lineno} {node.name}"
        for path, tree in sources("services", "drivers")
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
        and any("njit" in ast.unparse(decorator) for decorator in node.decorator_list)
        and "random" in ast.unparse(node)
    ]
    assert found == []
