"""Network namespaces for tests: several hosts on one machine. Needs root and iproute2; tests skip without."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import pytest

needs_netns = pytest.mark.skipif(
    os.geteuid() != 0 or shutil.which("ip") is None, reason="network namespaces need root and iproute2"
)


@dataclass(frozen=True)
class Host:
    """A namespace with one link to the namespace of the test.

    Attributes:
        prefix: what a command line begins with to run there.
        address: its own; here: this side's address of the link.
        link: name of this side's interface.
    """

    name: str
    prefix: tuple[str, ...]
    address: str
    here: str
    link: str


@contextmanager
def hosts(count: int) -> Iterator[list[Host]]:
    """Make `count` hosts, each linked with this one, and remove them at the end."""
    made: list[Host] = []
    try:
        for index in range(count):
            name, link = f"plt{os.getpid() % 10000}h{index}", f"plt{os.getpid() % 10000}v{index}"
            # Two test runs at a time must not share a network.
            net = f"10.{192 + os.getpid() // 32 % 32}.{8 * (os.getpid() % 32) + index}"
            host = Host(name, ("ip", "netns", "exec", name), f"{net}.2", f"{net}.1", link)
            _ip("netns", "add", name)
            made.append(host)
            _ip("link", "add", link, "type", "veth", "peer", "name", "eth0", "netns", name)
            _ip("addr", "add", f"{host.here}/24", "dev", link)
            _ip("link", "set", link, "up")
            _ip("-n", name, "addr", "add", f"{host.address}/24", "dev", "eth0")
            _ip("-n", name, "link", "set", "eth0", "up")
            _ip("-n", name, "link", "set", "lo", "up")
        yield made
    finally:
        for host in made:
            subprocess.run(["ip", "link", "del", host.link], check=False, capture_output=True)
            _ip("netns", "del", host.name)


def _ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True, capture_output=True)
