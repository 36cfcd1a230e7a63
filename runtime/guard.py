"""Keeps handlers from reading what a replay could not give them again.

While a handler runs, the wall clock, `random`, unseeded numpy generators, the operating system's randomness, the
environment, files, sockets and processes are out of bounds: touching one raises `Nondeterministic`, which names
the service and the call. Functions are replaced once, when a guard is opened, also where a service module has
imported them by name; inside a handler the check is one comparison.
"""

from __future__ import annotations

import datetime
import os
import random
import secrets
import sys
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from types import ModuleType, TracebackType
from typing import Any

import numpy as np

from runtime.errors import PushlaneError


class Nondeterministic(PushlaneError):
    """A handler did something that a replay cannot repeat."""

    exit_code = 1


_CLOCKS: tuple[str, ...] = (
    "time",
    "time_ns",
    "monotonic",
    "monotonic_ns",
    "perf_counter",
    "perf_counter_ns",
    "process_time",
)
_CLOCKS += ("process_time_ns", "thread_time", "thread_time_ns", "sleep", "localtime", "gmtime", "ctime")
_RANDOM: tuple[str, ...] = (
    "random",
    "uniform",
    "randint",
    "randrange",
    "choice",
    "choices",
    "shuffle",
    "sample",
    "gauss",
)
_RANDOM += (
    "normalvariate",
    "expovariate",
    "betavariate",
    "triangular",
    "vonmisesvariate",
    "getrandbits",
    "seed",
)
_LEGACY: tuple[str, ...] = (
    "rand",
    "randn",
    "randint",
    "random",
    "random_sample",
    "normal",
    "uniform",
    "choice",
    "shuffle",
)
_LEGACY += ("permutation", "standard_normal", "exponential", "poisson", "seed", "bytes", "vonmises", "beta")
_EVENTS = ("open", "os.", "socket.", "subprocess.", "shutil.", "tempfile.", "glob.", "ctypes.dlopen")
_GUARDED_PACKAGES = ("services", "drivers")

_active: Guard | None = None


class Guard:
    """Blocks the outside world while a handler runs.

    `with guard:` replaces the functions; `with guard.during(node, handler):` blocks them for this thread.
    `guard.node` is set and cleared directly by `runtime.node` on its hot path.
    """

    def __init__(self) -> None:
        self.node: str | None = None
        self.handler = ""
        self.thread = 0
        self._replaced: list[tuple[Any, str, object]] = []

    def __enter__(self) -> Guard:
        global _active
        if _active is not None:
            raise RuntimeError("one guard at a time: another is open in this process")
        _active = self
        self.thread = threading.get_ident()
        try:
            originals = dict(self._plan())
            for (owner, name), replacement in originals.items():
                self._replace(owner, name, replacement)
            self._replace_imported()
        except BaseException:
            self.__exit__(None, None, None)
            raise
        _install_audit_hook()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        global _active
        _active = None
        for owner, name, original in reversed(self._replaced):
            setattr(owner, name, original)
        self._replaced.clear()

    def during(self, node: str, handler: str) -> AbstractContextManager[None]:
        """Block for the time of one handler of `node`."""
        return _during(self, node, handler)

    def refuse(self, what: str) -> None:
        """Raise if a handler runs on this thread now.

        Raises:
            Nondeterministic: naming the service, its handler and `what` it did.
        """
        if self.node is not None and threading.get_ident() == self.thread:
            node, self.node = self.node, None
            raise Nondeterministic(
                f"service '{node}' called {what} in handler '{self.handler}': a replay could not repeat that; "
                "use the logical time `now`, the configuration, or a generator seeded from it"
            )

    def _plan(self) -> Iterator[tuple[tuple[Any, str], object]]:
        for module, names in ((time, _CLOCKS), (random, _RANDOM), (np.random, _LEGACY)):
            for name in names:
                yield (module, name), self._blocked(module.__name__, name, getattr(module, name))
        for module, name in (
            (os, "urandom"),
            (os, "getenv"),
            (uuid, "uuid1"),
            (uuid, "uuid4"),
            (secrets, "token_bytes"),
        ):
            yield (module, name), self._blocked(module.__name__, name, getattr(module, name))
        environment = type(os.environ)
        yield (environment, "__getitem__"), self._blocked("os", "environ", environment.__getitem__)
        yield (np.random, "default_rng"), self._seeded("numpy.random.default_rng", np.random.default_rng)
        yield (random, "Random"), _guarded_random(self)

    def _replace(self, owner: Any, name: str, replacement: object) -> None:
        self._replaced.append((owner, name, getattr(owner, name)))
        setattr(owner, name, replacement)

    def _replace_imported(self) -> None:
        """Replace what guarded modules hold by `from time import time` and the like.

        datetime's classes are replaced only here: other libraries compare them by identity.
        """
        now = {id(original): getattr(owner, name) for owner, name, original in self._replaced}
        moments = _guarded_datetime(self), _guarded_date(self)
        now |= {id(datetime.datetime): moments[0], id(datetime.date): moments[1]}
        now[id(datetime)] = _like_datetime(*moments)
        for module in [m for m in sys.modules.values() if isinstance(m, ModuleType)]:
            if module.__name__.split(".")[0] not in _GUARDED_PACKAGES and not hasattr(module, "__guarded__"):
                continue
            for name, value in list(vars(module).items()):
                if id(value) in now and not name.startswith("__"):
                    self._replace(module, name, now[id(value)])

    def _blocked(self, module: str, name: str, original: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **kwargs: Any) -> Any:
            self.refuse(f"{module}.{name}")
            return original(*args, **kwargs)

        return call

    def _seeded(self, name: str, original: Callable[..., Any]) -> Callable[..., Any]:
        def call(seed: Any = None) -> Any:
            if seed is None:
                self.refuse(f"{name}() without a seed")
            return original(seed)

        return call


@contextmanager
def _during(guard: Guard, node: str, handler: str) -> Iterator[None]:
    guard.node, guard.handler = node, handler
    try:
        yield
    finally:
        guard.node = None


def _guarded_random(guard: Guard) -> type[random.Random]:
    class Random(random.Random):
        def __init__(self, x: Any = None) -> None:
            if x is None:
                guard.refuse("random.Random() without a seed")
            super().__init__(x)

    return Random


_datetime = datetime.datetime
_date = datetime.date


def _like_datetime(moment: type, day: type) -> ModuleType:
    """Return a module like datetime with these classes in it."""
    module = ModuleType("datetime")
    vars(module).update({k: v for k, v in vars(datetime).items() if not k.startswith("__")})
    module.datetime, module.date = moment, day  # type: ignore[attr-defined]
    return module


def _guarded_datetime(guard: Guard) -> type[datetime.datetime]:
    class Datetime(_datetime):
        @classmethod
        def now(cls, tz: datetime.tzinfo | None = None) -> Datetime:
            guard.refuse("datetime.now")
            return super().now(tz)

        @classmethod
        def utcnow(cls) -> Datetime:
            guard.refuse("datetime.utcnow")
            return super().now(datetime.UTC).replace(tzinfo=None)

        @classmethod
        def today(cls) -> Datetime:
            guard.refuse("datetime.today")
            return super().now()

    return Datetime


def _guarded_date(guard: Guard) -> type[datetime.date]:
    class Date(_date):
        @classmethod
        def today(cls) -> Date:
            guard.refuse("date.today")
            return super().today()

    return Date


_audit_installed = False


def _install_audit_hook() -> None:
    """Hear of files, sockets and processes. A hook cannot be removed, so there is one for all guards."""
    global _audit_installed
    if _audit_installed:
        return
    _audit_installed = True
    sys.addaudithook(_audit)


def _audit(event: str, args: tuple[Any, ...]) -> None:
    if _active is not None and _active.node is not None and event.startswith(_EVENTS):
        _active.refuse(f"{event}{args[:1]}")
