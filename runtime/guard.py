"""Keeps handlers from reading what a replay could not give them again.

While a handler runs, the wall clock, `random`, unseeded numpy generators, the operating system's randomness, the
environment, files, sockets, processes and threads are out of bounds: touching one raises `Nondeterministic`, which
names the service and the call, and a handler that swallows the error is stopped all the same. Functions are
replaced once, when a guard is opened, also where a service module or class holds them by name; inside a handler
the check is one comparison. What cannot be replaced (clocks inside other compiled libraries, the order of a set of
text) is kept out by review and by the import rules of services and drivers.
"""

from __future__ import annotations

import datetime
import os
import random
import sys
import threading
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import ModuleType, TracebackType
from typing import Any

import numpy as np

from runtime import forbidden
from runtime.errors import PushlaneError


class Nondeterministic(PushlaneError):
    """A handler did something that a replay cannot repeat."""

    exit_code = 1


_EVENTS = ("open", "os.", "socket.", "subprocess.", "shutil.", "tempfile.", "glob.", "ctypes.dlopen", "_thread.start")
_GUARDED_PACKAGES = ("services", "drivers")

_active: Guard | None = None


class Guard:
    """Blocks the outside world while a handler runs.

    `with guard:` replaces the functions; `with guard.strictly(node, handler):`, or `enter` and `leave` where speed
    matters, blocks them for this thread.
    """

    def __init__(self) -> None:
        self.node: str | None = None
        self.handler = ""
        self._thread = 0
        self._violation: Nondeterministic | None = None
        self._replaced: list[tuple[Any, str, object]] = []

    def __enter__(self) -> Guard:
        global _active
        if _active is not None:
            raise RuntimeError("one guard at a time: another is open in this process")
        _active = self
        self._thread = threading.get_ident()
        try:
            for owner, name, replacement in list(_plan()):
                self._replace(owner, name, replacement)
            self._replace_held()
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

    @contextmanager
    def during(self, node: str, handler: str) -> Iterator[None]:
        """Block for the time of one handler of `node`. What it touches is refused, and forgotten at the end."""
        self.enter(node, handler)
        try:
            yield
        finally:
            self.node = self._violation = None

    @contextmanager
    def strictly(self, node: str, handler: str) -> Iterator[None]:
        """Block like `during`, and raise at the end if the handler swallowed a refusal.

        Raises:
            Nondeterministic: see there.
        """
        self.enter(node, handler)
        try:
            yield
        finally:
            self.leave()

    def enter(self, node: str, handler: str) -> None:
        """Begin to block; `leave` is to follow."""
        self.handler = handler
        self.node = node

    def leave(self) -> None:
        """End blocking.

        Raises:
            Nondeterministic: the handler touched something, and swallowed the error.
        """
        self.node = None
        if self._violation is not None:
            violation, self._violation = self._violation, None
            raise violation

    def refuse(self, what: str) -> None:
        """Raise if a handler runs on this thread now.

        Raises:
            Nondeterministic: naming the service, its handler and `what` it did.
        """
        if self.node is None or threading.get_ident() != self._thread:
            return
        node, self.node = self.node, None  # making the error must not be refused
        self._violation = self._violation or Nondeterministic(
            f"service '{node}' called {what} in handler '{self.handler}': a replay could not repeat that; "
            "use the logical time `now`, the configuration, or a generator seeded from it"
        )
        self.node = node
        raise self._violation

    def _replace(self, owner: Any, name: str, replacement: object) -> None:
        self._replaced.append((owner, name, vars(owner)[name]))
        setattr(owner, name, replacement)

    def _replace_held(self) -> None:
        """Replace what guarded modules, and classes in them, hold by `from time import time` and the like.

        datetime's classes are replaced only here: other libraries compare them by identity.
        """
        now = {id(original): vars(owner)[name] for owner, name, original in self._replaced}
        now |= {id(datetime.datetime): _Datetime, id(datetime.date): _Date, id(datetime): _like_datetime()}
        for module in [one for one in sys.modules.values() if isinstance(one, ModuleType)]:
            if module.__name__.split(".")[0] not in _GUARDED_PACKAGES and not hasattr(module, "__guarded__"):
                continue
            classes = [
                value
                for value in vars(module).values()
                if isinstance(value, type) and value.__module__ == module.__name__
            ]
            for owner in (module, *classes):
                for name, value in list(vars(owner).items()):
                    if id(value) in now and not name.startswith("__"):
                        self._replace(owner, name, now[id(value)])


def _refuse(what: str) -> None:
    # Whichever guard is open now: what was imported under an earlier one still holds that one's functions.
    if _active is not None:
        _active.refuse(what)


def _plan() -> Iterator[tuple[Any, str, object]]:
    """Return (owner, name, replacement) of everything that is replaced for all the process."""
    for owner, name in forbidden.functions():
        yield owner, name, _blocked(owner.__name__, name, vars(owner)[name])
    environment = type(os.environ)
    for name in ("__getitem__", "__iter__", "__len__"):
        yield environment, name, _blocked("os", "environ", getattr(environment, name))
    yield np.random, "default_rng", _seeded("numpy.random.default_rng", np.random.default_rng)
    yield np.random.mtrand, "_rand", forbidden.SharedGenerator(np.random.mtrand._rand, _refuse)
    yield random, "Random", _Random
    yield uuid, "uuid1", _blocked("uuid", "uuid1", uuid.uuid1)
    yield uuid, "uuid4", _blocked("uuid", "uuid4", uuid.uuid4)


def _blocked(module: str, name: str, original: Callable[..., Any]) -> Callable[..., Any]:
    def call(*args: Any, **kwargs: Any) -> Any:
        _refuse(f"{module}.{name}")
        return original(*args, **kwargs)

    return call


def _seeded(name: str, original: Callable[..., Any]) -> Callable[..., Any]:
    def call(seed: Any = None) -> Any:
        if seed is None:
            _refuse(f"{name}() without a seed")
        return original(seed)

    return call


class _Alike(type):
    """Makes `isinstance` and `issubclass` of a guarded class answer as the original class would."""

    def __instancecheck__(cls, value: object) -> bool:
        return isinstance(value, cls.__mro__[1])

    def __subclasscheck__(cls, other: type) -> bool:
        return issubclass(other, cls.__mro__[1])


class _Random(random.Random, metaclass=_Alike):
    def __init__(self, x: Any = None) -> None:
        if x is None:
            _refuse("random.Random() without a seed")
        super().__init__(x)


class _Datetime(datetime.datetime, metaclass=_Alike):
    @classmethod
    def now(cls, tz: datetime.tzinfo | None = None) -> _Datetime:
        _refuse("datetime.now")
        return super().now(tz)

    @classmethod
    def utcnow(cls) -> _Datetime:
        _refuse("datetime.utcnow")
        return super().now(datetime.UTC).replace(tzinfo=None)

    @classmethod
    def today(cls) -> _Datetime:
        _refuse("datetime.today")
        return super().now()


class _Date(datetime.date, metaclass=_Alike):
    @classmethod
    def today(cls) -> _Date:
        _refuse("date.today")
        return super().today()


def _like_datetime() -> ModuleType:
    """Return a module like datetime with the guarded classes in it."""
    module = ModuleType("datetime")
    vars(module).update({k: v for k, v in vars(datetime).items() if not k.startswith("__")})
    module.datetime, module.date = _Datetime, _Date  # type: ignore[attr-defined]
    return module


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
