"""The files that users install: configurations load and agree with each other, units are what systemd understands."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from experiments.session import prepare
from experiments.systems import NODES, REAL
from runtime import registry
from runtime.bus.access import access_control
from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.cli.options import bus_of, layers
from tests.figures import Figures

DEPLOY = Path(__file__).parents[2] / "deploy"
SYSTEMS = ("simulation", "laptop", "robot", "robot-and-laptop", "robotino-rest", "robotino-serial")
UNITS = sorted((DEPLOY / "systemd").glob("*.service"))
LARGEST_EXPOSURE = 1.5

needs_systemd = pytest.mark.skipif(
    shutil.which("systemd-analyze") is None,
    reason="systemd-analyze is not installed; deploy/system-packages installs it on Debian 12",
)


def test_every_file_is_looked_at() -> None:
    assert {path.stem for path in DEPLOY.glob("*.toml")} == {*SYSTEMS, "operator"}
    assert [path.stem for path in UNITS] == ["pushlane-laptop", "pushlane-robot"]


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_system_loads_and_gives_every_service_to_one_host(name: str) -> None:
    found = layers(DEPLOY / f"{name}.toml", None)
    hosts = found[0].values.pop("hosts", {})
    session = prepare(found)
    bus = session.effective.sections["bus"]
    assert isinstance(bus, BusConfig)
    assert session.nodes == REAL.get(name, NODES)
    if hosts:
        assert sorted(one for services in hosts.values() for one in services) == sorted(session.nodes)
    if bus.access is None:
        places = (*bus.listen, *bus.connect)
        assert all("/127.0.0.1:" in place for place in places), "without access control it stays on loopback"
        return
    assert bus.access.hosts == {host: tuple(services) for host, services in hosts.items()}
    assert bus.access.operators == ("operator",)
    assert bus.tls is not None
    assert bus.tls.key == str(DEPLOY / "certificates" / "own.key")
    rules = access_control(bus.access, Keys(bus.robot))["rules"]
    assert isinstance(rules, list)
    allowed = {rule["id"].split(":")[0] for rule in rules if f"pushlane/{bus.robot}/command" in rule["key_exprs"]}
    assert allowed == {"robot"}


def test_what_the_operator_has_fits_what_the_robot_has() -> None:
    operator, robot = bus_of(DEPLOY / "operator.toml", None), bus_of(DEPLOY / "robot-and-laptop.toml", None)
    assert (operator.robot, operator.connect) == (robot.robot, robot.connect)
    assert operator.tls is not None
    assert operator.access is None
    assert bus_of(DEPLOY / "robot.toml", None).robot == robot.robot


def test_the_configurations_do_not_claim_a_real_driver() -> None:
    if "drivers.sapien" in registry.SERVICES["driver"]:
        for name in ("robot", "robot-and-laptop"):
            assert "The driver is the simulated one" in (DEPLOY / f"{name}.toml").read_text()


def analysed(unit: Path, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run systemd-analyze on a copy of `unit` that starts the command that is here."""
    here = Path(sys.executable).parent / "pushlane"
    copy = folder / unit.name
    copy.write_text(unit.read_text().replace("/opt/pushlane/.venv/bin/pushlane", str(here)))
    command = ["systemd-analyze", *arguments, str(copy)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@needs_systemd
@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.stem)
def test_systemd_has_nothing_to_say_about_a_unit(unit: Path, tmp_path: Path) -> None:
    found = analysed(unit, tmp_path, "verify", "--man=no")
    # It ends with 0 on a value that it does not understand, so any word is a fault.
    assert (found.returncode, found.stdout + found.stderr) == (0, "")


@needs_systemd
@pytest.mark.parametrize(
    ("old", "new"),
    [("WatchdogSec=3", "WatchdogSec=three"), ("ProtectHome=yes", "ProtectHom=yes"), ("Type=notify", "Type=notifi")],
)
def test_a_fault_in_a_unit_would_be_seen(old: str, new: str, tmp_path: Path) -> None:
    wrong = tmp_path / "pushlane-wrong.service"
    wrong.write_text(UNITS[0].read_text().replace(old, new))
    assert new in wrong.read_text()
    folder = tmp_path / "copy"
    folder.mkdir()
    found = analysed(wrong, folder, "verify", "--man=no")
    assert found.stdout + found.stderr != ""


@needs_systemd
def test_systemd_has_nothing_to_say_about_the_unit_with_the_serial_device(tmp_path: Path) -> None:
    here = Path(sys.executable).parent / "pushlane"
    folder = tmp_path / "pushlane-robot.service.d"
    folder.mkdir()
    drop = (DEPLOY / "systemd" / folder.name / "serial.conf").read_text()
    (folder / "serial.conf").write_text(drop.replace("/opt/pushlane/.venv/bin/pushlane", str(here)))
    found = analysed(DEPLOY / "systemd" / "pushlane-robot.service", tmp_path, "verify", "--man=no")
    assert (found.returncode, found.stdout + found.stderr) == (0, "")
    (folder / "serial.conf").write_text(drop.replace("DevicePolicy=closed", "DevicePolicy=shut"))
    wrong = analysed(DEPLOY / "systemd" / "pushlane-robot.service", tmp_path, "verify", "--man=no")
    assert wrong.stdout + wrong.stderr != "", "it is looked at"


@needs_systemd
@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.stem)
def test_a_unit_is_shut_in(unit: Path, tmp_path: Path, figures: Figures) -> None:
    found = analysed(unit, tmp_path, "security", "--offline=yes", f"--threshold={10 * LARGEST_EXPOSURE:.0f}")
    level = re.search(r"exposure level for \S+: ([0-9.]+)", found.stdout)
    assert level is not None, found.stdout + found.stderr
    figures(f"{unit.stem}: exposure {level[1]} of 10")
    assert found.returncode == 0
    assert float(level[1]) <= LARGEST_EXPOSURE


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.stem)
def test_a_unit_starts_a_host_that_its_system_has(unit: Path) -> None:
    text = unit.read_text()
    system = re.search(r"run /etc/pushlane/(\S+\.toml) --host (\S+)", text)
    assert system is not None
    hosts = tomllib.loads((DEPLOY / system[1]).read_text())["hosts"]
    assert system[2] in hosts
    assert ("--join" in text) == ("driver" not in hosts[system[2]])
    tls = tomllib.loads((DEPLOY / system[1]).read_text())["bus"]["tls"]
    for name, path in tls.items():
        file = Path(path).name
        assert f"LoadCredential={file}:/etc/pushlane/{path}" in text
        assert f"--set bus.tls.{name}=${{CREDENTIALS_DIRECTORY}}/{file}" in text
