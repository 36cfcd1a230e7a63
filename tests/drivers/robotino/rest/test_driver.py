"""The double of the server against the reference's figures, and the driver against the double, faults and all."""

from __future__ import annotations

import json
from math import pi

import numpy as np
import pytest

from drivers.robotino.infrared import FARTHEST
from drivers.robotino.plant import IdealPlant, LaserReading
from drivers.robotino.rest.config import RestConfig
from drivers.robotino.rest.restapid import Response, Restapid
from drivers.robotino.rest.service import RobotinoRest
from runtime.messages import Alive, HttpAnswer, HttpFault, HttpRequest, Odometry, Twist2, VelocityCommand
from runtime.time import SECOND
from tests.drivers.robotino.rest.rig import Rig
from tests.drivers.robotino.rig import driven as after

WISH = (0.2, 0.0, 0.3)
BRAKING = 0.2 / 0.4
"""s, from 0.2 m/s by the 0.4 m/s^2 of controld3, which no client can change"""


def server_at(seconds: float, server: Restapid, plant: IdealPlant, start: float = 0.0) -> None:
    for k in range(round((seconds - start) * 1000)):
        plant.pass_by(0.001)
        server.advance(start + (k + 1) / 1000, plant)


def test_a_velocity_is_shaped_and_runs_out() -> None:
    server, plant = Restapid(), IdealPlant.at_rest()
    assert server.handle("PUT", "/data/omnidrive", b"[0.3, 0, 0]", plant).status == 200
    server_at(0.25, server, plant)
    assert plant.twist[0] == pytest.approx(0.1, abs=1e-3), "0.4 m/s^2"
    server_at(0.45, server, plant, 0.25)
    assert plant.twist[0] == pytest.approx(0.18, abs=1e-3)
    server_at(0.75, server, plant, 0.45)
    assert plant.twist[0] == pytest.approx(0.1, abs=5e-3), "zero was told at 0.5 s; the ramp goes down from 0.2 m/s"
    server_at(1.2, server, plant, 0.75)
    assert plant.twist == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("body", [b"[2.1, 0, 0]", b"[0, -2.1, 0]", b"[0, 0, 3.1]"])
def test_too_much_is_zero_and_400(body: bytes) -> None:
    server, plant = Restapid(), IdealPlant.at_rest()
    server.handle("PUT", "/data/omnidrive", b"[0.1, 0, 0]", plant)
    assert server.handle("PUT", "/data/omnidrive", body, plant).status == 400
    assert server.wish == (0.0, 0.0, 0.0)


def test_the_odd_habits_of_omnidrive() -> None:
    server, plant = Restapid(), IdealPlant.at_rest()
    assert server.handle("POST", "/data/omnidrive?sid=x", b"[0.1]", plant).status == 200
    assert server.wish == (0.1, 0.0, 0.0), "what lacks is 0"
    assert server.handle("PUT", "/data/omnidrive", b"{no json", plant).status == 400
    assert server.wish == (0.1, 0.0, 0.0), "as it was"
    assert server.handle("PUT", "/data/omnidrive", b'{"vx": 1}', plant).status == 200
    assert server.wish == (0.0, 0.0, 0.0), "what is no array is zero"


def test_two_clients_the_last_one_wins() -> None:
    server, plant = Restapid(), IdealPlant.at_rest()
    server.handle("PUT", "/data/omnidrive?sid=a", b"[0.1, 0, 0]", plant)
    server.handle("PUT", "/data/omnidrive?sid=b", b"[0, 0.2, 0]", plant)
    assert server.wish == (0.0, 0.2, 0.0)


def test_reads_are_of_the_exact_shapes() -> None:
    server, plant = Restapid(), IdealPlant.at_rest()
    assert server.handle("GET", "/data/bumper", b"", plant).body == b'{\n    "value": false\n}\n'
    distances = json.loads(server.handle("GET", "/data/distancesensorarray?sid=1", b"", plant).body)
    assert distances == [0.4099999964237213] * 9, "32 bits, widened"
    assert server.handle("GET", "/data/scan0", b"", plant) == Response(200), "no laser: empty"
    assert server.handle("GET", "/data/gantt", b"", plant) == Response(200)
    assert Restapid(unknown=404).handle("GET", "/data/gantt", b"", plant).status == 404
    assert server.handle("OPTIONS", "/data/bumper", b"", plant).body == b"Allow: DELETE, GET, POST, PUT"


def test_the_first_picture_after_a_pause_fails() -> None:
    server, plant = Restapid(picture=b"\xff\xd8\xff\xd9"), IdealPlant.at_rest()
    assert server.handle("GET", "/cam0", b"", plant).status == 500
    assert server.handle("GET", "/cam0?stamp=1", b"", plant) == Response(200, "image/jpeg", b"\xff\xd8\xff\xd9")
    server_at(10.5, server, plant)
    assert server.handle("GET", "/cam0", b"", plant).status == 500


def driven(seconds: float = 2.0, wish: tuple[float, float, float] = WISH, **values: object) -> Rig:
    return after(Rig(**values), 0.3, seconds, wish)  # type: ignore[arg-type]


def off(rig: Rig) -> list[float]:
    """Return how far published odometry was from where the base was, m: it is up to 0.05 s and an answer old."""
    return [float(np.hypot(one.pose.x - p[0], one.pose.y - p[1])) for one, p in rig.odometry]


def test_a_command_is_followed_and_the_odometry_is_the_bases() -> None:
    rig = driven(4.0)
    assert rig.plant.twist == pytest.approx(WISH, abs=1e-6)
    assert max(off(rig)) < 0.2 * 0.06
    assert 19 <= len(rig.odometry) / 4.3 <= 21
    rates = {
        path: len([one for one in rig.requests if one.path == path]) / 4.3 for path in {r.path for r in rig.requests}
    }
    assert rates["/data/omnidrive"] == pytest.approx(20, abs=1)
    assert rates["/data/distancesensorarray"] == pytest.approx(20, abs=1)
    assert rates["/data/powermanagement"] == pytest.approx(1, abs=0.3)
    assert rig.statuses[-1].battery_voltage == 24.0 and not rig.statuses[-1].link_down


def test_a_laser_is_passed_on_and_its_absence_is_no_fault_of_others() -> None:
    rig = Rig()
    rig.run(1.0)
    assert not rig.scans and rig.faults("no scan") > 5 and rig.odometry
    rig.plant.scan = LaserReading(-1.9, 1.9, (1.0, 0.0, 2.0))
    rig.run(1.0)
    assert 8 <= len(rig.scans) <= 11
    assert list(rig.scans[-1].ranges) == pytest.approx([1.0, 20.0, 2.0]), "nothing seen is as far as it sees"


@pytest.mark.parametrize("kind", ["HTTP_TIMEOUT", "HTTP_REFUSED", "HTTP_CUT", "HTTP_MALFORMED"])
def test_a_server_that_is_gone_for_two_seconds(kind: str) -> None:
    """It hangs, is restarted, resets connections, or sends garbage: the base's own time-outs stop it, we come back."""
    rig = driven()
    since, count = rig.now, len(rig.odometry)
    became = HttpFault.Value(kind)
    rig.trouble = lambda _: became
    rig.run(2.0)
    assert rig.moving_after(since) < 0.5 + BRAKING + 0.05, "the server's 0.5 s, and braking"
    assert rig.statuses[-1].link_down
    assert rig.faults(kind.removeprefix("HTTP_").lower()) > 10
    assert len(rig.odometry) <= count + 2
    rig.trouble = lambda _: None
    rig.run(1.5)
    assert not rig.statuses[-1].link_down and rig.plant.twist == pytest.approx(WISH, abs=1e-6)
    assert max(off(rig)) < 0.2 * 0.06, "the base's odometry went on while nobody asked"


def test_sensors_that_fail_stop_the_base_by_our_side() -> None:
    """Answers 500 to every read for 3 s: the drive still listens, and is told zero."""
    rig = driven()
    since = rig.now
    rig.trouble = lambda one: Response(500, "text/plain", b"no") if one.method == "GET" else None
    rig.run(3.0)
    assert rig.faults("status 500") > 20
    assert rig.moving_after(since) <= 0.2 + 0.06 + BRAKING, "0.2 s of the command, a tick, and braking"
    told = [json.loads(one.body) for one in rig.requests if one.method == "PUT"][-1]
    assert told == [0.0, 0.0, 0.0]
    rig.trouble = lambda _: None
    rig.run(1.5)
    assert rig.plant.twist == pytest.approx(WISH, abs=1e-6)


@pytest.mark.parametrize(
    "body",
    [b"", b"garbage", b"[0,0,0]", b"[NaN,0,0,0,0,0,5]", b'{"value": 3}', b"[" * 2000, b"[9e9,0,0,0,0,0,99999999]"],
)
def test_wrong_answers_are_counted_and_never_published(body: bytes) -> None:
    rig = driven()
    rig.trouble = lambda one: Response(200, body=body) if one.method == "GET" else None
    odometry, ranges, scans = len(rig.odometry), len(rig.ranges), len(rig.scans)
    rig.run(1.0)
    assert len(rig.odometry) <= odometry + 1 and len(rig.ranges) <= ranges + 1 and len(rig.scans) == scans
    assert sum(rig.service.state.faults.counts.values()) > 20
    assert rig.statuses[-1].link_down and not rig.statuses[-1].bumper


def test_odometry_that_is_set_anew_never_jumps() -> None:
    rig = driven(2.0)
    rig.plant.reckoning.x = rig.plant.reckoning.y = rig.plant.reckoning.theta = 0.0
    rig.server.restart()
    rig.run(2.0)
    assert rig.faults("odometry") == 1
    steps = [one for one, _ in rig.odometry]
    for a, b in zip(steps[:-1], steps[1:], strict=True):
        assert np.hypot(b.pose.x - a.pose.x, b.pose.y - a.pose.y) < 0.2 * ((b.stamp - a.stamp) / SECOND + 0.05) + 0.002


def test_an_answer_that_was_given_up_changes_nothing() -> None:
    rig = driven()
    count = len(rig.odometry)
    old = HttpAnswer(id=3, path="/data/odometry", status=200, body=b"[5,5,0,0,0,0,99999]")
    rig.take(rig.service.hear(old, rig.now))
    assert len(rig.odometry) == count


def test_odometry_that_stands_still_is_stale() -> None:
    rig = driven()
    frozen = rig.server.handle("GET", "/data/odometry", b"", rig.plant)
    since = rig.now
    rig.trouble = lambda one: frozen if one.path == "/data/odometry" else None
    rig.run(1.5)
    assert rig.faults("stale") == 1 and rig.statuses[-1].link_down
    assert rig.moving_after(since) <= 0.3 + BRAKING


def test_stale_odometry_stops_the_base_before_a_patient_command_runs_out() -> None:
    """The command would last 0.5 s; odometry counts as stale after 0.25 s, and the next tick tells zero."""
    rig = driven()
    newest = rig.odometry[-1][0].driver_sequence
    command = VelocityCommand(twist=Twist2(vx=0.2), driver_sequence=newest, deadline=SECOND // 2)
    frozen = rig.server.handle("GET", "/data/odometry", b"", rig.plant)
    rig.trouble = lambda one: frozen if one.path == "/data/odometry" else None
    rig.wish, since, before = None, rig.now, len(rig.requests)
    rig.take(rig.service.obey(command, rig.now))
    rig.run(0.5)
    zero = [one.stamp for one in rig.requests[before:] if one.method == "PUT" and json.loads(one.body) == [0.0] * 3]
    assert zero and (zero[0] - since) / SECOND <= 0.25 + 2 * 0.05


def test_a_hung_driver_is_stopped_by_the_server() -> None:
    for idle, most in ((0.5, 0.5), (0.2, 0.2)):
        rig = driven(server=Restapid(idle=idle))
        rig.hung, since = True, rig.now
        rig.run(2.0)
        assert rig.moving_after(since) <= most + BRAKING + 0.05


def test_last_words_controller_gone_and_bumper_all_say_zero() -> None:
    for end in (
        lambda rig: rig.service.finish(rig.now),
        lambda rig: rig.service.call(Alive(nodes=["task"]), rig.now),
    ):
        rig = driven()
        rig.take(end(rig))
        assert json.loads(rig.requests[-1].body) == [0.0, 0.0, 0.0]


def test_while_the_bumper_is_pressed_the_base_stands_whatever_is_commanded() -> None:
    rig = driven()
    rig.plant.bumper, since = True, rig.now
    rig.run(2.0)
    assert rig.statuses[-1].bumper and rig.moving_after(since) < 0.2 + BRAKING
    rig.plant.bumper = False
    rig.run(1.0)
    assert rig.plant.twist == pytest.approx(WISH, abs=0.01), "and goes on"


def test_at_the_first_answer_that_is_no_odometry_the_base_is_told_zero() -> None:
    rig = driven()
    since = rig.now
    rig.trouble = lambda one: Response(500) if one.path == "/data/odometry" else None
    rig.run(1.5)
    assert rig.moving_after(since) < 0.05 + 0.02 + BRAKING, "not only when commands have become old"


def test_a_velocity_waits_a_tenth_of_a_second_at_most_for_the_one_before() -> None:
    rig = driven(config=RestConfig(timeout=2.0))
    assert {one.timeout for one in rig.requests if one.method == "PUT"} == {SECOND // 10}
    assert {one.timeout for one in rig.requests if one.method == "GET"} == {2 * SECOND}


def test_what_a_slow_answer_says_is_of_when_it_was_asked_for() -> None:
    """And what comes after more than a quarter of a second is of no use."""
    service = RobotinoRest(RestConfig(timeout=2.0))
    asked = {one.message.lane: one.message for one in service.ask(0) if isinstance(one.message, HttpRequest)}  # type: ignore[union-attr]
    body = b"[0.1, 0, 0, 0, 0, 0, 7]"
    late = HttpAnswer(id=asked["odometry"].id, path="/data/odometry", status=200, body=body)
    found = [one.message for one in service.hear(late, SECOND // 5) if isinstance(one.message, Odometry)]  # type: ignore[union-attr]
    assert [one.stamp for one in found] == [0]
    again = {one.message.lane: one.message for one in service.ask(SECOND) if isinstance(one.message, HttpRequest)}  # type: ignore[union-attr]
    later = HttpAnswer(id=again["odometry"].id, path="/data/odometry", status=200, body=b"[0.1, 0, 0, 0, 0, 0, 8]")
    said = list(service.hear(later, SECOND + SECOND // 3))  # type: ignore[arg-type]
    assert not any(isinstance(one.message, Odometry) for one in said)  # type: ignore[union-attr]
    assert service.state.faults.counts["late odometry"] == 1


def test_a_heading_that_no_base_can_have_come_to_is_not_believed() -> None:
    rig = driven(2.0, (0.0, 0.0, 0.3))
    before = rig.odometry[-1][0].pose.theta
    rig.plant.reckoning.theta += 2.5
    rig.run(1.0)
    assert rig.faults("odometry") == 1
    after_ = rig.odometry[-1][0].pose.theta
    assert 0.2 < after_ - before < 0.5


def test_no_lane_has_two_requests_under_way() -> None:
    under_way: dict[str, int] = {}

    def slow(one: HttpRequest) -> HttpFault.ValueType | None:
        under_way[one.lane] = under_way.get(one.lane, 0) + 1
        return HttpFault.HTTP_TIMEOUT

    rig = driven()
    rig.trouble = slow
    rig.run(0.24)
    assert {count for lane, count in under_way.items() if lane != "drive"} == {1}
    assert under_way["drive"] == 4, "the newest is always there to be told"


def test_a_restored_driver_goes_on_alike_to_the_byte() -> None:
    rig = driven()
    other = RobotinoRest(rig.config)
    other.restore(rig.service.snapshot(), {})

    def work(service: RobotinoRest) -> list[bytes]:
        return [one.message.SerializeToString() for one in service.ask(rig.now)]  # type: ignore[union-attr]

    assert work(rig.service) == work(other)
    assert rig.service.snapshot() == other.snapshot()


def test_the_plants_far_readings_are_the_tables() -> None:
    assert json.loads(Restapid().handle("GET", "/data/distancesensorarray", b"", IdealPlant.at_rest()).body)[0] == (
        pytest.approx(FARTHEST)
    )
    assert abs(json.loads(Restapid().handle("GET", "/data/odometry", b"", IdealPlant.at_rest()).body)[2]) <= pi
