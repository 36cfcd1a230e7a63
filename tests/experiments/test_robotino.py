"""Checks of a base, small moves, and the emulated base behind real sockets and a real terminal."""

from __future__ import annotations

import json
import tomllib
import urllib.error
import urllib.request
from pathlib import Path

import pytest
from typer.testing import CliRunner

from drivers.robotino.health import Row
from drivers.robotino.plant import IdealPlant, LaserReading
from drivers.robotino.rest.config import RestConfig
from drivers.robotino.rest.restapid import Restapid
from drivers.robotino.rest.server import RestServer
from drivers.robotino.rest.service import RobotinoRest
from drivers.robotino.rest.wire import HttpWire
from drivers.robotino.serial.board import Board
from drivers.robotino.serial.config import SerialConfig
from drivers.robotino.serial.line import PtyLine
from drivers.robotino.serial.service import RobotinoSerial
from drivers.robotino.serial.wire import SerialWire
from drivers.sapien.emulator import EmulatedBoard, EmulatedServer
from experiments.robotino import emulation, health
from experiments.session import prepare
from experiments.systems import REAL
from runtime import registry, topics
from runtime.cli.main import VERB_MODULES, app
from runtime.config.layers import ConfigError, Layer, read_toml
from runtime.errors import PushlaneError
from runtime.live.alone import Alone
from runtime.messages import Twist2, VelocityCommand
from runtime.time import SECOND
from tests.drivers.robotino.rest.base import Base

pytestmark = pytest.mark.alone

MOUNT = {"x": 0.1, "z": 1.0, "pitch": 0.9}
WORLD = prepare([Layer("test", {"sim": {"scene": "open", "object": "box", "seed": 3}})]).world


def go(base: Alone, vx: float, seconds: float) -> None:
    """Command a motion for so long, then none."""
    end = base.now + round(seconds * SECOND)
    while base.now < end:
        newest = base.last(topics.ODOMETRY)
        assert newest is not None
        twist = Twist2(vx=vx)
        command = VelocityCommand(twist=twist, driver_sequence=newest.driver_sequence, deadline=SECOND // 5)
        base.give(topics.COMMAND, command)
        base.run(0.05)
    base.run(1.0)


def ready(base: Alone) -> bool:
    return base.run(10.0, lambda: base.last(topics.ODOMETRY) is not None)


def check_backwards(driver: Alone, standing: EmulatedServer | EmulatedBoard) -> None:
    """Drive back from the object; odometry and truth agree, and each tells of a motion backwards only."""
    before = standing.standing()
    with driver.running():
        assert ready(driver)
        go(driver, -0.2, 1.5)
        said = driver.last(topics.ODOMETRY)
    after = standing.standing()
    assert said is not None
    moved = [b - a for a, b in zip(before.robot[:2], after.robot[:2], strict=True)]
    way = (moved[0] ** 2 + moved[1] ** 2) ** 0.5
    assert way > 0.1
    assert said.pose.x == pytest.approx(-way, abs=0.02)
    assert abs(said.pose.y) < 0.02
    assert after.twist == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)


def test_an_emulated_base_over_rest_goes_where_its_odometry_says() -> None:
    base = EmulatedServer(WORLD, Restapid(idle=1.0))
    with RestServer(base.handle) as far, base.running():
        check_backwards(Alone(RobotinoRest(RestConfig(url=far.url)), HttpWire(far.url)), base)


def test_an_emulated_base_over_the_serial_link_goes_where_its_odometry_says() -> None:
    base = EmulatedBoard(WORLD, Board())
    with PtyLine(base.far(), base.plant) as line, base.running():
        check_backwards(Alone(RobotinoSerial(SerialConfig()), SerialWire(line.device)), base)


def test_beside_the_serial_link_scans_are_read_over_rest_and_nothing_is_driven() -> None:
    base = EmulatedBoard(WORLD, Board())
    with RestServer(base.handle) as far, base.running():
        with urllib.request.urlopen(f"{far.url}/data/scan0", timeout=10) as answer:
            scan = json.load(answer)
        assert len(scan["ranges"]) == WORLD.laser.beams
        drive = urllib.request.Request(f"{far.url}/data/omnidrive", b"[1, 0, 0]", method="PUT")
        with pytest.raises(urllib.error.HTTPError, match="400"):
            urllib.request.urlopen(drive, timeout=10)
        with urllib.request.urlopen(f"{far.url}/data/odometry", timeout=10) as answer:
            assert answer.read() == b""


def test_a_wiggle_goes_there_and_back() -> None:
    base, said = Base(Restapid(idle=1.0)), []
    with RestServer(base.handle) as far:
        assert health.wiggle(far.url, True, said.append)
    x, y, _ = base.plant.pose
    assert abs(x) < 0.03 and abs(y) < 1e-6
    speeds = [json.loads(body)[0] for method, path, body in base.asked if method == "PUT"]
    assert max(speeds) == pytest.approx(0.05) and min(speeds) == pytest.approx(-0.05)


def test_a_wiggle_of_a_base_that_does_not_move_fails() -> None:
    base, said = Base(Restapid(idle=1.0)), []
    base.plant.drive = lambda twist: None  # type: ignore[method-assign]
    with RestServer(base.handle) as far:
        assert not health.wiggle(far.url, True, said.append)
    assert "forward 0 mm (50 wanted)" in said[0] and said[0].endswith("NOT as it should be")


def test_a_base_that_moves_already_or_has_no_room_is_not_moved() -> None:
    base, said = Base(Restapid(idle=0.5)), []
    base.plant.distances = (0.41, 0.1, *[0.41] * 7)
    with RestServer(base.handle) as far:
        assert not health.wiggle(far.url, True, said.append)
        assert said.pop() == "not moved: something is 0.10 m from it, by its infra-red sensors; 0.15 m are needed"
        base.plant.distances = (0.41,) * 9
        base.plant.reckoning.x, twist = 0.0, base.plant.twist
        base.server.wish = base.server.shaped = (0.2, 0.0, 0.0)
        base.plant.drive = lambda _: IdealPlant.drive(base.plant, (0.2, 0.0, 0.0))  # type: ignore[method-assign]
        assert not health.wiggle(far.url, True, said.append)
        assert twist == (0.0, 0.0, 0.0) and said.pop().startswith("not moved: it moves already")


def test_an_address_without_a_scheme_is_not_taken_for_a_device() -> None:
    invoked("--version")
    with pytest.raises(ConfigError, match="expected http://172.26.1.1 for a base over REST"):
        CliRunner().invoke(app, ["robotino", "check", "172.26.1.1"], catch_exceptions=False)


def test_a_base_at_no_address_is_refused_before_anything_starts() -> None:
    camera = {"calibration": {"width": 64, "height": 48, "focal": [50, 50], "centre": [32, 24]}, "mount": MOUNT}
    tracker = {"diameter": 0.3}
    values = {"system": {"base": "robotino-rest"}, "opencv-camera": camera, "tracker": tracker}
    with pytest.raises(PushlaneError, match="url '127.0.0.1:8080', expected http://HOST"):
        prepare([Layer("test", {**values, "robotino-rest": {"url": "127.0.0.1:8080"}})])
    assert prepare([Layer("test", {**values, "robotino-rest": {"url": "http://127.0.0.1:8080"}})]).nodes


def test_what_a_push_cannot_do_without_is_named() -> None:
    rows = [Row(name, "ok", "", 1.0) for name in ("odometry", "bumper", "distances", "power", "laser")]
    assert health.lacks([*rows, Row("camera", "missing", "", 1.0)], True) == []
    assert health.lacks(rows[1:], True) == ["odometry"]
    assert health.lacks([*rows, Row("camera", "bad", "", 1.0)], True) == ["camera"]


def invoked(*arguments: str) -> tuple[int, str]:
    if not app.registered_groups:
        for module in VERB_MODULES:
            __import__(module, fromlist=["register"]).register(app)
    found = CliRunner().invoke(app, [*arguments])
    return found.exit_code, found.output


def test_the_check_reads_everything_and_moves_nothing() -> None:
    base = Base()
    with RestServer(base.handle) as far:
        code, text = invoked("robotino", "check", far.url)
        assert code == 1 and "before a push can begin: laser" in text
        base.plant.scan = LaserReading(-1.0, 1.0, (1.0, 2.0, 3.0))
        code, text = invoked("robotino", "check", far.url)
    assert code == 0, text
    assert "24.0 V" in text and "odometry" in text
    assert {method for method, _, _ in base.asked} == {"GET"}


def test_the_check_of_a_base_that_is_away_says_so() -> None:
    with RestServer(Base().handle) as far:
        url = far.url
    code, text = invoked("robotino", "check", url, "--timeout", "0.5")
    assert code == 1 and "unreachable" in text


def test_the_check_over_a_serial_line() -> None:
    base = EmulatedBoard(WORLD, Board())
    with PtyLine(base.far(), base.plant) as line:
        code, text = invoked("robotino", "check", line.device)
    assert code == 0, text
    assert "3.0.0" in text
    code, text = invoked("robotino", "check", "/dev/there-is-none")
    assert code == 1 and "missing" in text


@pytest.mark.parametrize("link", ["rest", "serial"])
def test_the_system_file_of_an_emulated_base_is_one(link: str, tmp_path: Path) -> None:
    place = emulation.Place("127.0.0.1", 0, tmp_path / "robotino", 0.5, True)
    file = tmp_path / "system.toml"
    file.write_text(emulation.system(WORLD, link, place, "http://127.0.0.1:1"))
    session = prepare([read_toml(file)])
    assert session.nodes == REAL[f"robotino-{link}"]
    camera = session.effective.sections["opencv-camera"]
    assert camera.calibration.focal[0] == pytest.approx(WORLD.scene.camera.focal, abs=1e-3)  # type: ignore[attr-defined]
    assert tomllib.loads(file.read_text())["tracker"]["diameter"] == WORLD.body.diameter


def test_a_service_has_a_wire_only_where_nobody_else_is_its_other_end() -> None:
    config = RestConfig(url="http://127.0.0.1:1")
    assert registry.wire("robotino-rest", ["emulated-rest", "robotino-rest"], config) is None
    assert isinstance(registry.wire("robotino-rest", REAL["robotino-rest"], config), HttpWire)
    assert isinstance(registry.wire("robotino-serial", REAL["robotino-serial"], SerialConfig()), SerialWire)
    assert registry.wire("controller", REAL["robotino-rest"], None) is None
    with pytest.raises(PushlaneError, match="url '', expected http://HOST"):
        registry.wire("robotino-rest", REAL["robotino-rest"], RestConfig())


def test_a_real_camera_has_no_default() -> None:
    with pytest.raises(ConfigError, match=r"opencv-camera\.calibration"):
        prepare([Layer("test", {"system": {"base": "robotino-rest"}})])
