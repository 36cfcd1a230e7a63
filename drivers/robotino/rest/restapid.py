"""A double of the REST server and the controld3 behind it, as on image 2.0.17 (reference 1).

It is given requests and the time, and drives a `Plant`; it reads no clock and no socket. Not there: management
(programs, network, services); reads of these get what an unknown path gets, and writes 400. All sessions have one role,
where the real one keeps a role of each `sid`.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from math import isfinite, radians

import numpy as np

from drivers.robotino.kinematics import ROBOTINO_3_4, Twist, ramped
from drivers.robotino.plant import Plant
from drivers.robotino.rest.picture import drawn

VXMAX, VYMAX, OMEGAMAX = 2.0, 2.0, 3.0
"""restapid.conf: beyond these a command is replaced by zero, and answered with 400"""
_SPEED, _TURN = 0.75 * 1.0, 0.75 * radians(90)
"""m/s and rad/s: controld3.conf in speed mode normal"""
_ACCELERATION, _TURN_ACCELERATION = 0.4, radians(180)
_TICK = 0.1
"""s, of the counter that goes down to the time-out"""
_MOTOR_TIMEOUT = 0.5
"""s without a velocity message after which controld3 sets the motors to zero, hard"""
_PUBLISH = 0.05
"""s between two odometries"""
_ROUNDING = 1e-6
_SCAN = 0.1
_CAMERA_DROPPED = 10.0
"""s without a request after which the camera is let go"""
_ROLES = ("guest", "operator", "administrator")
JSON = "application/json"


@dataclass(frozen=True)
class Response:
    """An answer: status, media type, body."""

    status: int
    media: str = JSON
    body: bytes = b""


@dataclass
class Restapid:
    """The server.

    Attributes:
        idle: s without a command after which zero is sent once, counted in steps of 0.1 s: 0.5 as in 2.0.17, 0.2 as the
            documents say.
        unknown: status of paths that are not there: 200 with nothing on 2.0.17, 404 on 4.20.9.
        volts: of the battery.
        now: s. ticked: ticks of the idle counter. left: ticks to the time-out; 0: it has run out.
        told: s, of the last velocity message to controld3, or -1.
        wish: the velocity that was told; shaped: what the wheels are told by now.
        published, sequence: odometry as it is read, and its counter. scan: that of the laser.
        camera: s, of the last request of a picture, or -1.
        picture: a JPEG that /cam0 gives; none: no camera.
        outputs, relays, power: written states; power in percent.
        role: guest, operator or administrator: a guest may not write.
    """

    idle: float = 0.5
    unknown: int = 200
    volts: float = 24.0
    now: float = 0.0
    ticked: int = 0
    left: int = 0
    told: float = -1.0
    wish: Twist = (0.0, 0.0, 0.0)
    shaped: Twist = (0.0, 0.0, 0.0)
    published: tuple[float, ...] = (0.0,) * 6
    publications: int = 0
    sequence: int = 0
    camera: float = -1.0
    picture: bytes = b""
    outputs: list[bool] = field(default_factory=lambda: [False] * 8)
    relays: list[bool] = field(default_factory=lambda: [False] * 2)
    power: float = 0.0
    role: str = "administrator"

    def advance(self, now: float, plant: Plant) -> None:
        """Let time pass up to `now`, s, and tell the plant how its wheels are to turn from now on."""
        while (self.ticked + 1) * _TICK <= now:
            self.ticked += 1
            if self.left:
                self.left -= 1
                if not self.left:
                    self._tell((0.0, 0.0, 0.0), self.ticked * _TICK)
        if self.told >= 0.0 and now - self.told > _MOTOR_TIMEOUT:
            self.wish = self.shaped = (0.0, 0.0, 0.0)
        seconds, self.now = now - self.now, now
        self.shaped = ramped(self.shaped, self.wish, _ACCELERATION * seconds, _TURN_ACCELERATION * seconds)
        motors = ROBOTINO_3_4.motors(self.shaped)
        most = ROBOTINO_3_4.max_rpm
        # Each wheel by itself, so that the course bends at the limit: as controld3 does it.
        a, b, c = (min(max(one, -most), most) for one in motors)
        plant.drive(ROBOTINO_3_4.twist((a, b, c)))
        if (count := int(now / _PUBLISH + _ROUNDING)) > self.publications:
            self.sequence += count - self.publications
            self.publications = count
            self.published = (*plant.pose, *plant.twist)

    def restart(self) -> None:
        """Begin as after a restart of controld3: counters at zero, standing still."""
        self.wish = self.shaped = (0.0, 0.0, 0.0)
        self.left, self.told, self.sequence, self.camera = 0, -1.0, 0, -1.0

    def handle(self, method: str, target: str, body: bytes, plant: Plant) -> Response:
        """Return the answer to a request, and do what it asks for."""
        path = target.partition("?")[0]
        if method == "OPTIONS":
            return Response(200, "text/plain", b"Allow: DELETE, GET, POST, PUT")
        if method == "DELETE":
            return Response(200, "text/plain", target.encode())
        if method in ("PUT", "POST"):
            return self._write(path, body)
        if method != "GET":
            return Response(400)
        if path == "/cam0":
            return self._camera()
        reader = _READ.get(path)
        return Response(self.unknown) if reader is None else reader(self, plant)

    def _tell(self, wish: Twist, now: float) -> None:
        """Give controld3 a velocity."""
        vx, vy, omega = wish
        speed = (vx * vx + vy * vy) ** 0.5
        share = min(1.0, _SPEED / speed) if speed > 0.0 else 1.0
        self.wish = (share * vx, share * vy, min(max(omega, -_TURN), _TURN))
        self.told = now

    def _write(self, path: str, body: bytes) -> Response:
        try:
            found = json.loads(body)
        except (ValueError, RecursionError):
            return Response(400)
        if path == "/data/login":
            return self._login(found)
        if self.role == _ROLES[0]:
            return Response(400)
        if path == "/data/omnidrive":
            return self._omnidrive(found)
        if path == "/data/digitaloutputarray" and _flags(found, 8):
            self.outputs = list(found)
        elif path == "/data/relayarray" and _flags(found, 2):
            self.relays = list(found)
        elif path == "/data/digitaloutput" and _one(found, 8):
            self.outputs[found["num"]] = found["val"]
        elif path == "/data/relay" and _one(found, 2):
            self.relays[found["num"]] = found["val"]
        elif path == "/data/poweroutput" and (percent := _percent(found)) is not None:
            self.power = percent
        else:
            return Response(400)
        return Response(200)

    def _login(self, found: object) -> Response:
        """Take another role. Passwords are empty, as shipped."""
        role = found.get("role") if isinstance(found, dict) else None
        if role not in _ROLES:
            return _json({"message": "unknown role", "success": False})
        self.role = str(role)
        return _json({"message": "", "success": True})

    def _omnidrive(self, found: object) -> Response:
        """Take a velocity. What lacks counts as 0, and so does all of what is no array."""
        values = found if isinstance(found, list) else []
        numbers = [float(one) if isinstance(one, int | float) and abs(one) < 1e300 else 0.0 for one in values[:3]]
        vx, vy, omega = (*numbers, 0.0, 0.0, 0.0)[:3]
        self.left = max(1, round(self.idle / _TICK))
        if not (abs(vx) <= VXMAX and abs(vy) <= VYMAX and abs(omega) <= OMEGAMAX and isfinite(vx + vy + omega)):
            self._tell((0.0, 0.0, 0.0), self.now)
            return Response(400)
        self._tell((vx, vy, omega), self.now)
        return Response(200)

    def _camera(self) -> Response:
        before, self.camera = self.camera, self.now
        if not self.picture or before < 0.0 or self.now - before > _CAMERA_DROPPED:
            return Response(
                500, "text/plain", b"No camera connected" if not self.picture else b"No jpeg image available"
            )
        return Response(200, "image/jpeg", self.picture)

    def _odometry(self, _: Plant) -> Response:
        return _json([*(_single(one) for one in self.published), self.sequence])

    def _distances(self, plant: Plant) -> Response:
        return _json([_single(one) for one in plant.distances])

    def _bumper(self, plant: Plant) -> Response:
        return _json({"value": plant.bumper})

    def _image(self, plant: Plant) -> Response:
        return Response(200, "image/png", drawn(plant.distances, plant.bumper))

    def _power(self, _: Plant) -> Response:
        low = self.volts < 17.2
        return _json(
            {
                "batteryLow": low,
                "batteryLowShutdownCounter": 60000,
                "batteryType": "Li-Ion",
                "ext_power": False,
                "num_chargers": 1,
                "voltage": _single(self.volts),
            }
        )

    def _scan(self, plant: Plant) -> Response:
        scan = plant.scan
        if scan is None:
            return Response(200)  # no laser service runs
        step = (scan.last - scan.first) / (len(scan.ranges) - 1)
        return _json(
            {
                "angle_increment": _single(step),
                "angle_max": _single(scan.last),
                "angle_min": _single(scan.first),
                "intensities": [0] * len(scan.ranges),
                "range_max": 20,
                "range_min": 0,
                "ranges": [_single(one) for one in scan.ranges],
                "scan_time": _SCAN,
                "seq": int(self.now / _SCAN),
                "stamp": int(1000 * self.now),
                "time_increment": 0,
            }
        )


def _json(value: object) -> Response:
    """Return a value as Qt prints it: indented, with a final newline."""
    return Response(200, JSON, (json.dumps(value, indent=4) + "\n").encode())


def _single(value: float) -> float:
    """Return a number as it is after it was held in 32 bits."""
    return float(np.float32(value))


def _flags(found: object, count: int) -> bool:
    return isinstance(found, list) and len(found) == count and all(isinstance(one, bool) for one in found)


def _one(found: object, count: int) -> bool:
    if not isinstance(found, dict):
        return False
    number, value = found.get("num"), found.get("val")
    return isinstance(number, int) and not isinstance(number, bool) and 0 <= number < count and isinstance(value, bool)


def _percent(found: object) -> float | None:
    value = found.get("value") if isinstance(found, dict) else None
    return float(value) if isinstance(value, int | float) and abs(value) <= 100 else None


def _charger(number: int) -> dict[str, object]:
    return {
        "bat1temp": 25.0, "bat2temp": 25.0, "batteryVoltage": 24.0, "chargerNumber": number, "chargingCurrent": 0.0,
        "state": "Idle", "state_number": 1, "time": 0, "version": "1.2.3",
    }  # fmt: skip


def _said(value: object) -> Callable[[Restapid, Plant], Response]:
    return lambda server, plant: _json(value)  # noqa: ARG005


_READ: dict[str, Callable[[Restapid, Plant], Response]] = {
    "/data/odometry": Restapid._odometry,
    "/data/distancesensorarray": Restapid._distances,
    "/data/bumper": Restapid._bumper,
    "/data/powermanagement": Restapid._power,
    "/data/scan0": Restapid._scan,
    "/data/analoginputarray": _said([0.0] * 8),
    "/data/digitalinputarray": _said([False] * 8),
    "/data/digitaloutputstatus": lambda server, plant: _json(server.outputs),  # noqa: ARG005
    "/data/relaystatus": lambda server, plant: _json(server.relays),  # noqa: ARG005
    "/data/festoolcharger": lambda server, plant: Response(200),  # noqa: ARG005
    "/data/controllerinfo": _said({"TYPE": "CONTROLLERINFO", "payload": {"hardware": "3.0.0", "software": "1.2.3"}}),
    "/data/charger0": _said(_charger(0)),
    "/data/charger1": _said(_charger(1)),
    "/data/services": _said([]),
    "/data/userrole": lambda server, plant: _json({"role": server.role}),  # noqa: ARG005
    "/sensorimage": Restapid._image,
}
