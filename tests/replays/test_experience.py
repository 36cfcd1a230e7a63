"""Experience of an object: saved from a recording, put into the next push's configuration, and of use there."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from experiments.session import prepare, run
from replays.experience import learned
from replays.recording import load
from replays.replay import replay
from runtime.cli.experience import encoded, with_experience
from runtime.config.layers import ConfigError, Layer
from runtime.messages import Log, PushResponse, Truth
from services.predictive import model as m
from services.predictive.experience import Experience
from services.predictive.known import SPREAD, Known, plausible, prior_spread
from tests.figures import Figures
from tests.test_cli import pushlane

RECORDINGS = Path(__file__).parents[2] / "replays" / "recordings"
METHOD = {"strategy": "predictive", "controller": "predictive"}
ROBOT = 0.46


def an_experience(diameter: float = 0.3) -> dict[str, Any]:
    """Return plain experience of an object with wheels."""
    response = m.prior_response(diameter)
    response[[m.ANISOTROPY, m.AXIS, m.COASTING]] = 2.0, 0.6, 0.5
    spread = prior_spread(diameter)
    known = Known(
        object="cart",
        diameter=diameter,
        robot_diameter=ROBOT,
        contour=tuple(m.prior_contour(ROBOT, diameter).tolist()),
        spread=tuple(spread[np.tril_indices(m.CONTOUR)].tolist()),
        response=tuple(response.tolist()),
        touches=40,
        windows=60,
    )
    found: dict[str, Any] = msgspec.to_builtins(known)
    return found


class Pushed:
    """What a push of a few seconds published."""

    def __init__(self, sim: dict[str, Any], *layers: Layer, record: Path | None = None) -> None:
        self.responses: list[tuple[int, PushResponse]] = []
        self.truths: list[Truth] = []
        self.said: list[str] = []
        self.session = prepare([Layer("test", {"sim": {**METHOD, **sim}}), *layers])
        run(self.session, record, sinks=[self._keep])

    def _keep(self, sample: Any) -> None:
        if sample.topic == "push/response":
            self.responses.append((sample.time, PushResponse.FromString(sample.payload)))
        elif sample.topic == "truth":
            self.truths.append(Truth.FromString(sample.payload))
        elif sample.topic == "log/learner":
            self.said.append(Log.FromString(sample.payload).message)

    def errors(self, seconds: float, fixed: PushResponse | None = None) -> float:
        """Return the mean error, m, of predictions over 0.4 s in the first `seconds` of touch, against the truth.

        What was held at the time (or `fixed`) says where the object will be; the robot's motion is the true one.
        """
        times = np.array([time for time, _ in self.responses])
        first = next(truth.stamp for truth in self.truths if truth.touching)
        base, misses = np.array([0.4, 0.1, 0.5 * ROBOT]), []
        for index, start in enumerate(self.truths[:-8]):
            if not start.touching or start.stamp > first + seconds * 1e9:
                continue
            held = fixed or self.responses[int(np.searchsorted(times, start.stamp, side="right")) - 1][1]
            state, o, v = np.zeros(m.STATE), start.object, start.object_twist
            state[[m.X, m.Y, m.YAW, m.VX, m.VY, m.OMEGA]] = o.x, o.y, o.theta, v.vx, v.vy, v.omega
            for then in self.truths[index + 1 : index + 9]:
                robot, moves = then.robot, then.robot_twist
                state[[m.RX, m.RY, m.RVX, m.RVY]] = robot.x, robot.y, moves.vx, moves.vy
                m.answer(state, 0.05, base, np.array(held.contour), np.array(held.response))
            end = self.truths[index + 8].object
            misses.append(math.hypot(state[m.X] - end.x, state[m.Y] - end.y))
        return float(np.mean(misses))

    def share(self, seconds: float) -> float:
        """Return that error as a share of a stranger's: pushes differ in how fast they are."""
        d = self.session.effective.sections["driver"].body.diameter  # type: ignore[attr-defined]
        contour, response = m.prior_contour(ROBOT, d).tolist(), m.prior_response(d).tolist()
        return self.errors(seconds) / self.errors(seconds, PushResponse(contour=contour, response=response))

    def field(self, seconds: float) -> float:
        """Return the learner's own error as a share of the prior's, over the first `seconds` of both."""
        known = [one for _, one in self.responses if one.prior_error]
        known = [one for one in known if one.stamp < known[0].stamp + seconds * 1e9]
        return float(np.mean([one.error for one in known]) / np.mean([one.prior_error for one in known]))


def test_the_second_push_begins_with_what_the_first_learned_and_predicts_better(
    tmp_path: Path, figures: Figures
) -> None:
    shares = []
    for name, seed in (("cart", 2), ("plane", 2), ("box", 2)):
        first, file = tmp_path / f"{name}.mcap", tmp_path / f"{name}.json"
        Pushed({"scene": "corridor-1", "object": name, "seed": seed, "time_limit": 25.0}, record=first)
        known = learned(load(first))
        file.write_bytes(encoded(known))
        assert known.object == name
        assert known.windows > 10
        sim = {"scene": "corridor-2", "object": name, "seed": seed, "time_limit": 6.0}
        second = tmp_path / f"{name}-2.mcap"
        again = Pushed(sim, *with_experience([], file), record=second)
        begun = again.responses[0][1]
        for field in ("contour", "response", "spread"):
            assert tuple(getattr(begun, field)) == pytest.approx(getattr(known, field), abs=1e-15)
        assert (begun.touches, begun.windows) == (known.touches, known.windows)
        assert again.said == [f"begins with experience of '{name}': {known.touches} touches, {known.windows} windows"]
        assert again.responses[-1][1].windows > known.windows  # and goes on learning
        assert tuple(again.responses[-1][1].contour) != known.contour
        # The replay needs nothing but the recording.
        file.unlink()
        first.unlink()
        recording = load(second)
        assert recording.config["sections"]["learner"]["known"]["windows"] == known.windows
        assert replay(recording).identical
        stranger = Pushed(sim)
        assert stranger.said == []
        shares.append((again.share(1.0), stranger.share(1.0)))
        figures(
            f"{name}, seed {seed}: first second of touch, error over 0.4 s as a share of a stranger's: with experience "
            f"{shares[-1][0]:.2f}, without {shares[-1][1]:.2f}; the learner's own: with {again.field(1.0):.2f}, "
            f"without {stranger.field(1.0):.2f}"
        )
    mine, other = np.mean(shares, axis=0)
    figures(f"mean: with experience {mine:.2f}, without {other:.2f}")
    assert mine < 0.9 * other


def test_experience_of_another_object_is_left_and_said(tmp_path: Path) -> None:
    sim = {"scene": "open", "object": "can", "seed": 4, "time_limit": 1.0}
    stranger = Pushed(sim)
    wrong = an_experience(0.5)
    pushed = Pushed(sim, Layer("experience", {"learner": {"known": wrong}}))
    assert len(pushed.said) == 1
    assert "experience of 'cart' is not used: it is of an object of 0.500 m, this one has 0.2" in pushed.said[0]
    assert pushed.responses == stranger.responses
    fitting = an_experience(1.15 * stranger.session.effective.sections["driver"].body.diameter)  # type: ignore[attr-defined]
    pushed = Pushed(sim, Layer("experience", {"learner": {"known": fitting}}))
    assert pushed.responses[0][1].windows == 60
    small = {**fitting, "robot_diameter": 0.40}
    pushed = Pushed(sim, Layer("experience", {"learner": {"known": small}}))
    assert "it was made with a base of 0.400 m, this one has 0.460 m" in pushed.said[0]


def changed(key: str, value: object) -> Callable[[dict[str, Any]], None]:
    """Return what sets a key of the experience."""

    def change(known: dict[str, Any]) -> None:
        known[key] = value

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (changed("contour", [0.3] * 23), "a.json: learner.known.contour: expected `array` of length >= 24"),
        (changed("spread", [1e-4] * (SPREAD + 1)), "a.json: learner.known.spread: expected `array` of length <= 300"),
        (changed("response", ["x"] * 7), "a.json: learner.known.response[0]: expected `float`, got `str`"),
        (changed("contour", [math.nan] * 24), "finite"),
        (
            changed("contour", [-0.25] * 12 + [0.35] * 12),
            "a.json: learner.known: the contour goes from -0.250 to 0.350 m",
        ),
        (changed("spread", [-1.0] + [0.0] * 299), "it is no covariance"),
        (changed("response", [0.0] * 7), "response is to have length, friction and coasting above 0"),
        (changed("diameter", -0.3), "a.json: learner.known.diameter: expected `float` > 0"),
        (changed("windows", -1), "a.json: learner.known.windows: expected `int` >= 0"),
        (changed("mood", 1), "a.json: learner.known.mood: no such key"),
    ],
)
def test_bad_numbers_are_refused_at_the_edge(change: Callable[[dict[str, Any]], None], words: str) -> None:
    known = an_experience()
    change(known)
    with pytest.raises(ConfigError) as caught:
        prepare([Layer("a.json", {"learner": {"known": known}})])
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "is no file of `pushlane experience save`"),
        ('{"format": "x", "version": 1, "known": {}}', "Invalid enum value 'x'"),
        ('{"format": "pushlane-experience", "version": 2, "known": {}}', "has version 2, expected 1"),
        ('{"format": "pushlane-experience", "version": 1, "known": {"diameter": NaN}}', "malformed"),
        ('{"format": "pushlane-experience", "version": 1, "known": {}}', "required field `diameter`"),
        (None, "cannot read"),
    ],
)
def test_files_that_are_none_are_named_in_one_line(text: str | None, words: str, tmp_path: Path) -> None:
    if text is not None:
        (tmp_path / "a.json").write_text(text)
    ran = pushlane(
        "sim", "--perception", "truth", "--scene", "open", "--time-limit", "1", "--experience", "a.json", cwd=tmp_path
    )
    assert ran.returncode == 2
    assert words in ran.stderr
    assert len(ran.stderr.strip().splitlines()) == 1


def test_the_command_saves_what_can_be_used_and_says_what_cannot(tmp_path: Path) -> None:
    sim = {"scene": "open", "object": "can", "seed": 4, "time_limit": 6.0}
    Pushed(sim, record=tmp_path / "a.mcap")
    saved = pushlane("experience", "save", "a.mcap", "-o", "a.json", "--name", "my can", cwd=tmp_path)
    assert saved.returncode == 0, saved.stderr
    assert saved.stdout.startswith("my can of 0.2")
    content = msgspec.json.decode((tmp_path / "a.json").read_bytes())
    assert (content["format"], content["version"], content["known"]["object"]) == ("pushlane-experience", 1, "my can")
    assert len((tmp_path / "a.json").read_bytes()) < 12000
    before = (tmp_path / "a.json").read_bytes()
    again = pushlane("experience", "save", "a.mcap", "-o", "a.json", cwd=tmp_path)
    assert (again.returncode, "a.json is there already" in again.stderr) == (2, True)
    assert (tmp_path / "a.json").read_bytes() == before
    short = ["--perception", "truth", "--scene", "open", "--time-limit", "1", "--experience", "a.json"]
    shown = pushlane("sim", *short, "--set", "learner.known.windows=-1", cwd=tmp_path)
    assert "--set: learner.known.windows: expected `int` >= 0" in shown.stderr
    golden = str(RECORDINGS / "corridor-1-relaxed.mcap")
    none = pushlane("experience", "save", golden, "-o", "b.json", cwd=tmp_path)
    assert (none.returncode, "only pushes with strategy or controller predictive learn" in none.stderr) == (2, True)
    assert not (tmp_path / "b.json").exists()
    blind = Layer("test", {"perception": {"yaw": False}})
    pushed = Pushed(sim, *with_experience([blind], tmp_path / "a.json"), record=tmp_path / "c.mcap")
    assert "experience of 'my can' is not used: the tracker sees no yaw" in pushed.said[0]
    assert pushed.responses[0][1].windows == 0
    none = pushlane("experience", "save", "c.mcap", "-o", "c.json", cwd=tmp_path)
    assert (none.returncode, "the tracker saw no yaw" in none.stderr) == (2, True)


def test_only_the_possible_part_of_a_contour_is_kept() -> None:
    diameter = 0.4
    contour = m.prior_contour(ROBOT, diameter)
    same, spread = plausible(contour, prior_spread(diameter), ROBOT, diameter)
    assert same is contour
    assert spread == pytest.approx(prior_spread(diameter))
    wild = contour.copy()
    wild += 0.15 * (1.0 - np.cos(math.tau * np.arange(m.CONTOUR) / m.CONTOUR))  # right ahead, 0.3 m too far behind
    found, spread = plausible(wild, 1e-6 * np.eye(m.CONTOUR), ROBOT, diameter)
    ahead, behind = (m.radius(found, bearing)[0] for bearing in (0.0, math.pi))
    assert ahead == pytest.approx(m.radius(wild, 0.0)[0], abs=0.01)
    assert m.radius(wild, math.pi)[0] > 0.65
    assert behind == pytest.approx(contour[0], abs=0.06)
    row = m.basis(np.array([math.pi]))[0][0]
    assert math.sqrt(row @ spread @ row) > 0.03  # and learned anew there


def test_wheels_that_are_known_are_not_forgotten_and_wrong_ones_are() -> None:
    from tests.services.predictive.test_experience import pushed_about

    wheels, even = np.array(an_experience()["response"]), m.prior_response(0.3)
    known = msgspec.convert(an_experience(), Known)
    soon = pushed_about(wheels, 3.0, 0.007, known)
    assert soon.response[m.ANISOTROPY] * math.cos(2.0 * (soon.response[m.AXIS] - 0.6)) > 1.2
    late = pushed_about(even, 40.0, 0.007, known)
    assert abs(late.response[m.ANISOTROPY]) < 0.5
    assert isinstance(late, Experience)
