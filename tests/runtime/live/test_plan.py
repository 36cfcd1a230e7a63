"""Two launchers of one system must have been given the same."""

from __future__ import annotations

import pytest

from experiments.session import prepare
from experiments.systems import NODES
from runtime.bus.config import BusConfig
from runtime.config.layers import Layer
from runtime.live.launcher import Launcher, PlanDiffers
from runtime.live.plan import Plan
from tests.live_system import running, short_session


def plan(robot: str, endpoint: str, **settings: object) -> Plan:
    bus = {"robot": robot, "listen": [endpoint], "connect": [endpoint]}
    sim = {"scene": "open", "goal": [-0.2, 0.1], "object": "cylinder", "seed": 2}
    return prepare([Layer("test", {"sim": sim, "bus": bus, **settings})]).plan()


def test_plans_differ_by_settings_but_not_by_their_bus() -> None:
    one = plan("a", "tcp/127.0.0.1:7001")
    assert one.differences(plan("a", "tcp/127.0.0.1:7002")) == []
    other = plan("a", "tcp/127.0.0.1:7001", controller={"k_gamma": 0.7})
    assert one.differences(other) == ["controller.k_gamma"]


def test_a_launcher_with_other_settings_does_not_join() -> None:
    with running(short_session("joined")) as system:
        other = plan("joined", system.bus.connect[0], controller={"k_gamma": 0.7})
        bus = system.bus
        assert isinstance(bus, BusConfig)
        with pytest.raises(PlanDiffers, match="controller.k_gamma"):
            Launcher(other, bus, [NODES[2]], join=True).run()
