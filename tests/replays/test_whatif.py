"""The report of a replay with changed settings says first what was changed and how much that changes."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from replays import report, whatif
from replays.differences import Differences, FieldError
from replays.recording import load
from replays.replay import replay
from replays.result import ChangedSetting, Comparison, Finding, NodeResult, Report, TopicResult
from replays.units import unit_of
from runtime import topics
from runtime.messages import VelocityCommand


def made(path: Path, fields: dict[str, FieldError], findings: int = 3) -> Report:
    """Return a report of a service of which 30 of 40 corridors differ in `fields`, and no target does."""
    row = TopicResult(40, 40, 10, beyond=30, first=2_000_000_000, differences=Differences(fields))
    node = NodeResult("corridor", topics={"push/target": TopicResult(7, 7, 7), "corridor": row})
    node.findings = [Finding("corridor", k, 2_000_000_000 + k, f"finding {k}") for k in range(findings)]
    changes = [ChangedSetting("corridor.path_weight", 3.0, 1.0)]
    return Report(load(path), Comparison.BYTES, [], ["corridor.path_weight"], [node], changes)


def test_the_first_line_says_what_was_changed_and_how_much_it_changes(session_file: Path) -> None:
    loaded = load(session_file)
    found = replay(loaded, ["controller"], {"controller": {"k_gamma": 0.3}})
    was = loaded.config["sections"]["controller"]["k_gamma"]
    row = found.nodes[0].topics["command"]
    lines = list(report.text(found))
    share = f"{100 * row.beyond / row.recorded:.3g} %"
    assert lines[0].startswith(
        f"With controller.k_gamma 0.3 instead of {was}, other values in {row.beyond} of {row.recorded} messages of "
        f"command ({share}), from "
    )
    most = max(row.differences.fields.items(), key=lambda item: item[1].largest)
    assert lines[0].endswith(f"; command {most[0]} by up to {most[1].largest:.3g} m/s, RMS {most[1].rms:.3g} m/s")
    assert len(lines) < 12
    whole = report.as_json(found)
    assert whole["changes"] == [{"key": "controller.k_gamma", "recorded": was, "replayed": 0.3}]
    assert len(whole["services"][0]["findings"]) == len(found.nodes[0].findings) > 10
    json.dumps(whole)


def test_a_setting_that_changes_nothing_is_said_to(session_file: Path) -> None:
    loaded = load(session_file)
    same = loaded.config["sections"]["controller"]["k_gamma"]
    lines = list(report.text(replay(loaded, ["controller"], {"controller": {"k_gamma": same}})))
    assert f"With controller.k_gamma {same} instead of {same}, nothing changes: " in lines[0]


def test_quantities_stand_first_and_long_lists_are_cut_with_a_count(session_file: Path) -> None:
    fields = {
        "stamp": FieldError(9e8, 9e16, 3, 0),
        "version": FieldError(4.0, 16.0, 1, 0),
        "reason": FieldError(math.inf, math.inf, 2, 0),
        "width_push[]": FieldError(0.02, 0.0002, 2, 0),
        "path.x[]": FieldError(0.5, 0.5, 4, 0),
        "path.y[]": FieldError(0.25, 0.25, 4, 0),
        "clearance[]": FieldError(0.125, 0.125, 4, 0),
        "robot_diameter": FieldError(0.01, 1e-4, 1, 0),
    }
    found = made(session_file, fields)
    assert whatif.summary(found) == (
        "With corridor.path_weight 1.0 instead of 3.0, other values in 30 of 40 messages of corridor (75 %), "
        "from 2.00 s on; corridor path.x[] by up to 0.5 m, RMS 0.354 m"
    )
    lines = list(whatif.text(found))
    shown = [line.split()[0].rstrip(":") for line in lines if line.startswith("    ") and "more fields" not in line]
    assert shown == ["path.x[]", "path.y[]", "clearance[]", "width_push[]", "robot_diameter", "reason"]
    assert "    and 2 more fields" in lines
    assert "as recorded: push/target (7)" in lines
    assert any("and 2 more findings; --json has all" in line for line in lines)
    assert not any("inf" in line.split() for line in lines)


@pytest.mark.parametrize(
    ("topic", "path", "unit"),
    [
        ("command", "twist.vx", "m/s"),
        ("command", "twist.omega", "rad/s"),
        ("command", "deadline", "ns"),
        ("corridor", "path.x[]", "m"),
        ("corridor", "clearance[]", "m"),
        ("object/state", "yaw_variance", "rad^2"),
        ("object/state", "covariance[]", "m^2"),
        ("push/status", "distance_left", "m"),
        ("push/status", "reason", ""),
        ("scan", "ranges[]", ""),
    ],
)
def test_units_are_those_that_the_messages_state(topic: str, path: str, unit: str) -> None:
    kind = next(one.message for one in topics.TOPICS.values() if one.name == topic)
    assert unit_of(kind, path) == unit


def test_a_field_that_is_none_has_no_unit() -> None:
    assert unit_of(VelocityCommand, "twist.nothing") == ""
    assert unit_of(VelocityCommand, "nothing.vx") == ""
