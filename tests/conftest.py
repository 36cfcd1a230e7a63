"""Tests side by side: those marked `alone` have the machine for themselves, and what tests measure is printed."""

from __future__ import annotations

import fcntl
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.figures import FIGURE, Figures


@pytest.fixture
def figures(record_property: Callable[[str, object], None]) -> Figures:
    """Take a line with a figure, to be printed at the end of the run."""
    return lambda line: record_property(FIGURE, line)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Let a test that is marked `alone` wait for the tests of the other workers, and these for it."""
    worker = getattr(item.config, "workerinput", None)
    if worker is None:
        return (yield)
    stem = f"pushlane-tests-{worker['testrunuid']}"
    folder = Path(tempfile.gettempdir())
    alone = item.get_closest_marker("alone") is not None
    # Who comes waits at the gate, so that one who wants the machine for himself is not passed by others for ever.
    with (folder / f"{stem}.gate").open("w") as gate, (folder / f"{stem}.machine").open("w") as machine:
        fcntl.flock(gate, fcntl.LOCK_EX)
        fcntl.flock(machine, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        fcntl.flock(gate, fcntl.LOCK_UN)
        return (yield)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the figures."""
    found = [
        (report.nodeid, text)
        for reports in terminalreporter.stats.values()
        for report in reports
        if isinstance(report, pytest.TestReport) and report.when == "call"
        for key, text in report.user_properties
        if key == FIGURE
    ]
    if found:
        terminalreporter.section("figures")
    for nodeid, text in sorted(found, key=lambda one: one[0]):
        terminalreporter.line(f"{nodeid.rpartition('/')[2]}:\n    " + str(text).replace("\n", "\n    "))


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Take the locks away, after the last worker."""
    run = getattr(session.config, "workerinput", None)
    if run is None:
        for path in Path(tempfile.gettempdir()).glob("pushlane-tests-*"):
            path.unlink(missing_ok=True)
