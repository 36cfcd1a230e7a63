"""Which functions of the standard library and of numpy a replay could not repeat."""

from __future__ import annotations

import _thread
import os
import random
import threading
import time
from collections.abc import Callable, Iterator
from types import BuiltinFunctionType, ModuleType
from typing import Any

import numpy as np

_TIMELESS = ("mktime", "strptime", "tzset")
_SYSTEM: tuple[str, ...] = (
    "urandom",
    "getrandom",
    "getenv",
    "getpid",
    "getppid",
    "stat",
    "lstat",
    "getcwd",
    "times",
    "cpu_count",
)
_SYSTEM += ("getloadavg", "uname", "access")


def functions() -> Iterator[tuple[ModuleType, str]]:
    """Return (module, name) of every plain function that is out of bounds."""
    for name, value in vars(time).items():
        if isinstance(value, BuiltinFunctionType) and not name.startswith("_") and name not in _TIMELESS:
            yield time, name
    shared = random.seed.__self__  # type: ignore[attr-defined]
    for name, value in vars(random).items():
        if getattr(value, "__self__", None) is shared:
            yield random, name
    # The source of SystemRandom, of `secrets`, and of every unseeded generator of numpy.
    yield random, "_urandom"
    for name, value in vars(np.random).items():
        if getattr(value, "__self__", None) is np.random.mtrand._rand and not name.startswith("_"):
            yield np.random, name
    for name in ("seed", "set_state", "get_state", "set_bit_generator", "get_bit_generator"):
        value = vars(np.random).get(name)
        if value is not None and getattr(value, "__self__", None) is not np.random.mtrand._rand:
            yield np.random, name
    # A thread would be out of the guard's sight.
    yield threading, "_start_new_thread"
    yield _thread, "start_new_thread"
    for name in _SYSTEM:
        if hasattr(os, name):
            yield os, name


class SharedGenerator:
    """Stands in for numpy's process-wide generator, for who takes it from numpy now.

    scipy's distributions took it when they were imported: give them a generator of the service's own.
    """

    def __init__(self, original: Any, refuse: Callable[[str], None]) -> None:
        self._original = original
        self._refuse = refuse

    def __getattr__(self, name: str) -> Any:
        self._refuse(f"numpy's shared generator ({name})")
        return getattr(self._original, name)
