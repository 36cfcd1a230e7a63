from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

import replays.inspect.convert
from replays.inspect import NoDisplay, NoVulkan, Unreadable, ViewError, open_viewer, palette, screenshot, to_rrd
from replays.inspect.layout import Layout
from replays.inspect.session import read_session
from replays.inspect.show import show
from runtime.messages import ObjectState, RobotPose
from tests.replays.inspect.synthetic_session import write_session


def middle(picture: NDArray[np.uint8], colour: palette.Colour) -> NDArray[np.float64]:
    """Mean place (x, y), px, of the largest patch of a colour in the map view, which is the left half."""
    left = picture[:800, : picture.shape[1] * 9 // 20]
    mask = (np.abs(left.astype(int) - np.array(colour[2::-1])).max(axis=2) < 12).astype(np.uint8)
    mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((7, 7), np.uint8))  # without the trail
    _, _, stats, centroids = cv2.connectedComponentsWithStats(mask)
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    return np.asarray(centroids[largest], np.float64)


@pytest.mark.render
def test_the_picture_shows_robot_and_object_where_they_are(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    push = tmp_path / "a.mcap"
    # Nothing that is drawn over the two.
    write_session(push, 8.0, frozenset({"command", "odometry", "push/target", "push/behaviour", "truth"}))
    show(push, tmp_path / "a.rrd", tmp_path / "3.png", at=3.0)
    assert "written to" in capsys.readouterr().out
    screenshot(tmp_path / "a.rrd", tmp_path / "6.png", at=6.0)
    places = []
    for name in ("3.png", "6.png"):
        picture = cv2.imread(str(tmp_path / name))
        assert picture.shape == (1080, 1920, 3)
        places.append((middle(picture, palette.ROBOT), middle(picture, palette.OBJECT)))
    session = read_session(push)
    robot, thing = session.track("robot/pose", RobotPose), session.track("object/state", ObjectState)
    known = []
    for at in (3_000_000_000, 6_000_000_000):
        now = np.array([at])
        pose, o = robot.messages[robot.latest(now)[0]].pose, thing.messages[thing.latest(now)[0]].position
        known.append((np.array([pose.x, pose.y]), np.array([o.x, o.y])))
    # The way between the two moments gives the scale; every other distance must fit it, with y up.
    scale = np.hypot(*(places[1][1] - places[0][1])) / np.hypot(*(known[1][1] - known[0][1]))
    flip = np.array([1.0, -1.0])
    for first, second in ((0, 0), (0, 1), (1, 0), (1, 1)):
        seen = places[first][second] - places[0][1]
        true = (known[first][second] - known[0][1]) * scale * flip
        assert seen == pytest.approx(true, abs=8.0)


@pytest.mark.render
@pytest.mark.parametrize("session", ["push", "predicted"])
def test_every_view_can_show_its_data(
    session: str, request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def views(part: rrb.Container | rrb.View) -> Iterator[rrb.View]:
        if isinstance(part, rrb.View):
            yield part
        else:
            for each in part.contents:
                yield from views(each)

    found: list[rrb.View] = []
    laid_out = Layout.blueprint

    def side_by_side(self: Layout) -> rrb.Blueprint:
        found.extend(views(laid_out(self).root_container))
        return rrb.Blueprint(rrb.Grid(*found, grid_columns=5), auto_views=False, auto_layout=False)

    monkeypatch.setattr(replays.inspect.convert.Layout, "blueprint", side_by_side)
    to_rrd(request.getfixturevalue(session), tmp_path / "a.rrd")
    assert len(found) > 15
    screenshot(tmp_path / "a.rrd", tmp_path / "a.png")


@pytest.mark.render
def test_views_that_cannot_show_their_data_are_named(tmp_path: Path) -> None:
    recording = rr.RecordingStream("broken", recording_id="broken")
    views = rrb.Horizontal(rrb.Spatial3DView(origin="/map", name="Map"), rrb.Spatial3DView(origin="/mesh"))
    recording.save(tmp_path / "a.rrd", rrb.Blueprint(views, auto_views=False))
    recording.set_time("t", duration=1.0)
    form = rr.components.ImageFormat(width=4, height=4, color_model="RGBA", channel_datatype="U8")
    recording.log("map", rr.GridMap(data=b"short", format=form, cell_size=1.0))
    recording.log("mesh", rr.Mesh3D(vertex_positions=np.eye(3), triangle_indices=[[0, 1, 9]]))
    recording.flush()
    recording.disconnect()
    with pytest.raises(ViewError, match=r'Map: Invalid data length.*Failed to load mesh "/mesh"'):
        screenshot(tmp_path / "a.rrd", tmp_path / "a.png", size=(640, 480))


def test_without_vulkan_the_packages_are_named(push: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    to_rrd(push, tmp_path / "a.rrd")
    for name in ("VK_DRIVER_FILES", "VK_ICD_FILENAMES"):
        monkeypatch.setenv(name, str(tmp_path / "none.json"))
    with pytest.raises(NoVulkan, match=r"mesa-vulkan-drivers \(25 or newer.*libvulkan1"):
        screenshot(tmp_path / "a.rrd", tmp_path / "a.png")


def test_without_a_screen_the_other_ways_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(NoDisplay, match=r"--save.*--screenshot"):
        open_viewer(tmp_path / "a.rrd")


def test_a_missing_recording_is_refused(tmp_path: Path) -> None:
    with pytest.raises(Unreadable, match="no such file"):
        screenshot(tmp_path / "none.rrd", tmp_path / "a.png")
