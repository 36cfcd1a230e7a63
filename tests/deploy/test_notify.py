"""The launcher under a supervisor that speaks systemd's protocol: ready, alive, stopping. The socket is a real one."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from runtime.bus.config import BusConfig
from runtime.bus.session import client
from runtime.live.notify import BadSupervisor, Notifier
from tests.figures import Figures
from tests.live_system import free_endpoint


@contextmanager
def supervisor(address: str) -> Iterator[socket.socket]:
    """Listen where a service is to report; `address` as in NOTIFY_SOCKET."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as found:
        found.bind(f"\0{address[1:]}" if address.startswith("@") else address)
        found.settimeout(0.2)
        yield found


def said(listener: socket.socket) -> list[str]:
    """Return what has come."""
    found = []
    try:
        while True:
            found.append(listener.recv(4096).decode())
    except TimeoutError:
        return found


@pytest.mark.parametrize("abstract", [False, True])
def test_it_says_ready_once_alive_now_and_then_and_stopping(tmp_path: Path, abstract: bool) -> None:
    address = f"@pushlane-test-{os.getpid()}" if abstract else str(tmp_path / "notify")
    environment = {"NOTIFY_SOCKET": address, "WATCHDOG_USEC": "300000", "WATCHDOG_PID": str(os.getpid()), "HOME": "/"}
    with supervisor(address) as listener:
        notifier = Notifier(environment)
        assert environment == {"HOME": "/"}, "child processes must not speak in its name"
        end = time.monotonic() + 0.55
        while time.monotonic() < end:
            notifier.alive()
            notifier.ready()
            time.sleep(0.005)
        notifier.stopping()
        notifier.alive()
        found = said(listener)
    assert found.count("READY=1") == 1
    assert found[-1] == "STOPPING=1"
    # At a third of 0.3 s: at 0, 0.1, ... 0.5 s on an idle machine, fewer on a busy one, never more.
    assert 3 <= found.count("WATCHDOG=1") <= 6
    assert set(found) == {"READY=1", "WATCHDOG=1", "STOPPING=1"}


def test_without_a_supervisor_or_a_watchdog_it_is_silent(tmp_path: Path) -> None:
    bare = Notifier({})
    bare.ready()
    bare.alive()
    bare.stopping()
    address = str(tmp_path / "notify")
    for watchdog in ({}, {"WATCHDOG_USEC": "100000", "WATCHDOG_PID": str(os.getppid())}):
        with supervisor(address) as listener:
            notifier = Notifier({"NOTIFY_SOCKET": address, **watchdog})
            notifier.alive()
            notifier.ready()
            assert said(listener) == ["READY=1"]
            notifier.stopping()
        Path(address).unlink()


def test_a_supervisor_that_is_gone_or_does_not_listen_stops_nothing(tmp_path: Path) -> None:
    address = str(tmp_path / "notify")
    with supervisor(address):
        notifier = Notifier({"NOTIFY_SOCKET": address, "WATCHDOG_USEC": "3"})
        begin = time.monotonic()
        for _ in range(2000):  # far more than a socket holds
            notifier.alive()
        assert time.monotonic() - begin < 5.0
    Path(address).unlink()
    notifier.alive()
    notifier.stopping()


@pytest.mark.parametrize(
    ("environment", "says"),
    [
        ({"NOTIFY_SOCKET": "notify"}, "NOTIFY_SOCKET=notify: expected a path, or @NAME"),
        ({"NOTIFY_SOCKET": "/x", "WATCHDOG_USEC": "soon"}, "WATCHDOG_USEC=soon: expected microseconds"),
    ],
)
def test_an_environment_without_sense_is_refused(environment: dict[str, str], says: str) -> None:
    with pytest.raises(BadSupervisor, match=says):
        Notifier(environment)


def test_a_launcher_is_ready_when_its_services_are_and_falls_silent_when_it_hangs(
    tmp_path: Path, figures: Figures
) -> None:
    address, watchdog = str(tmp_path / "notify"), 1.5
    endpoint = free_endpoint()
    places = [f'bus.{key}=["{endpoint}"]' for key in ("listen", "connect")]
    settings = [word for place in places for word in ("--set", place)]
    command = [sys.executable, "-m", "runtime.cli.main", "run", "--only", "learner", *settings]
    environment = {**os.environ, "NOTIFY_SOCKET": address, "WATCHDOG_USEC": f"{watchdog * 1e6:.0f}"}
    with supervisor(address) as listener:
        listener.settimeout(60.0)
        process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
        try:
            times: list[tuple[float, str]] = []
            while not times or times[-1][1] != "READY=1":
                text = listener.recv(4096).decode()
                times.append((time.monotonic(), text))
            children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
            commands = [Path(f"/proc/{child}/cmdline").read_bytes() for child in children]
            assert any(b"learner" in one for one in commands)
            with client(BusConfig(connect=(endpoint,))) as session:
                up = [str(one.ok.key_expr) for one in session.liveliness().get("pushlane/robot/@node/*") if one.ok]
            assert "pushlane/robot/@node/learner" in up, "ready without its service"
            for child in children:
                assert b"NOTIFY_SOCKET" not in Path(f"/proc/{child}/environ").read_bytes()
            end = time.monotonic() + 2 * watchdog
            listener.settimeout(watchdog)
            while time.monotonic() < end:
                times.append((time.monotonic(), listener.recv(4096).decode()))
            longest = max(b - a for (a, _), (b, _) in zip(times, times[1:], strict=False))
            figures(f"watchdog of {watchdog} s: longest silence {longest:.2f} s")
            # A launcher that hangs says nothing more: systemd would kill it after WatchdogSec.
            process.send_signal(signal.SIGSTOP)
            listener.settimeout(0.2)
            said(listener)
            listener.settimeout(watchdog)
            assert said(listener) == []
            process.send_signal(signal.SIGCONT)
            process.send_signal(signal.SIGTERM)
            assert process.wait(15.0) == 0
            assert said(listener)[-1] == "STOPPING=1"
            assert not any(Path(f"/proc/{child}").exists() for child in children), "it left processes behind"
        finally:
            if process.poll() is None:
                # Asked to end, so that it takes its services with it.
                process.send_signal(signal.SIGCONT)
                process.terminate()
                process.wait(15.0)
            assert process.stdout is not None
            process.stdout.close()
