"""What a session says about itself before its first message: who made it, with what, from which configuration."""

from __future__ import annotations

import os
import platform
import subprocess
import uuid
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import msgspec

METADATA_NAME = "pushlane"
CONFIG_NAME = "config.json"
END_NAME = "end"
"""Metadata that a live recorder writes last: the services that went on without it, and their last journal entries."""
FORMAT = 1

# Their numbers end up in payloads: another version of one may give other last digits.
_PACKAGES = (
    "numpy",
    "scipy",
    "numba",
    "sapien",
    "protobuf",
    "opencv-python-headless",
    "contourpy",
    "msgspec",
)
_CPU_FLAGS = (
    "sse4_1",
    "sse4_2",
    "avx",
    "f16c",
    "fma",
    "avx2",
    "bmi2",
    "avx512f",
    "avx512dq",
    "avx512bw",
    "avx512vl",
)


class Header(msgspec.Struct, frozen=True, kw_only=True):
    """The facts of a session.

    Attributes:
        format: of the log; grows when a reader must know.
        run: random id of the session.
        mode: local, lockstep or live.
        commit: git commit of the code, empty where unknown.
        dirty: the checkout had uncommitted changes.
        seed: of the simulation.
        nodes: services in scheduling order.
        host: name of the machine.
        cpu: architecture and the features that numeric libraries choose their code by.
        versions: of Python, the C library and the packages whose numbers end up in payloads.
        only: patterns of the topics that were recorded; none for all.
    """

    format: int
    run: str
    mode: str
    commit: str
    dirty: bool
    seed: int
    nodes: list[str]
    host: str
    cpu: list[str]
    versions: dict[str, str]
    only: list[str] = []

    def metadata(self) -> dict[str, str]:
        """Return the header as the flat text pairs that MCAP metadata holds."""
        return {name: msgspec.json.encode(value).decode() for name, value in msgspec.structs.asdict(self).items()}

    @classmethod
    def from_metadata(cls, pairs: dict[str, str]) -> Header:
        """Return the header that `metadata` made `pairs` from.

        Raises:
            msgspec.MsgspecError: they are no header.
        """
        return msgspec.convert({name: msgspec.json.decode(text) for name, text in pairs.items()}, cls)


def of_this_machine(mode: str, seed: int, nodes: list[str], only: list[str] | None = None) -> Header:
    """Return the header of a session that starts here and now."""
    commit, dirty = _git()
    return Header(
        format=FORMAT,
        run=uuid.uuid4().hex,
        mode=mode,
        commit=commit,
        dirty=dirty,
        seed=seed,
        nodes=nodes,
        host=platform.node(),
        cpu=cpu_features(),
        versions=versions(),
        only=only or [],
    )


def cpu_features() -> list[str]:
    """Return this machine's architecture and the features that change the last digits of numeric code."""
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return [platform.machine()]
    flags = next((line.split(":")[1].split() for line in text.splitlines() if line.startswith("flags")), [])
    forced = os.environ.get("OPENBLAS_CORETYPE")
    return [
        platform.machine(),
        *(flag for flag in _CPU_FLAGS if flag in flags),
        *([f"openblas={forced}"] if forced else []),
    ]


def versions(more: Iterable[str] = ()) -> dict[str, str]:
    """Return the versions of everything whose numbers end up in payloads, and of `more` packages."""
    found = {"python": platform.python_version(), "libc": " ".join(platform.libc_ver())}
    for package in (*_PACKAGES, *more):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "missing"
    return found


def _git() -> tuple[str, bool]:
    root = Path(__file__).parent
    try:
        commit = subprocess.run(
            ["git", "rev-parse", "HEAD"], cwd=root, capture_output=True, text=True, check=True, timeout=5
        ).stdout.strip()
        status = subprocess.run(
            ["git", "status", "--porcelain", "--untracked-files=no"],
            cwd=root,
            capture_output=True,
            text=True,
            check=True,
            timeout=5,
        ).stdout
    except (OSError, subprocess.SubprocessError):
        return "", False
    return commit, bool(status.strip())
