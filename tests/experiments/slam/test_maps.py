"""Maps of map_server's format, and where a scan was taken on one."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.ndimage import distance_transform_edt

from experiments.slam.logs import Log
from experiments.slam.maps import BadMap, read, write
from experiments.slam.whole import NotFound, run
from services.geometry.pose import between
from services.mapping.config import FilterConfig
from services.mapping.globally import locate
from services.mapping.grid import RESOLUTION, Maps
from services.mapping.scan import Scan
from tests.experiments.slam.shared import SHARED, needed
from tests.figures import Figures
from tests.services.mapping.rooms import ANGLES, MOUNT, ROUND, ranges_at, scan_at

IKEA = SHARED / "maps" / "ikea.yaml"
TEXT = "image: a.pgm\nresolution: 0.05\norigin: [1.0, 2.0, 0.0]\n"


@given(
    arrays(np.uint8, st.tuples(st.integers(1, 80), st.integers(1, 80)), elements=st.sampled_from([0, 100, 255])),
    st.integers(-100, 100), st.integers(-100, 100),
)  # fmt: skip
def test_a_map_comes_back_as_it_was_written(
    tmp_path_factory: pytest.TempPathFactory, cells: np.ndarray, i: int, j: int
) -> None:
    corner = np.array([i, j]) * RESOLUTION
    again, its = read(write(tmp_path_factory.mktemp("map"), cells, corner))
    assert np.array_equal(again, cells)
    assert its == pytest.approx(corner)
    # And through the tiles of the filter, in which it lies somewhere.
    shown, low = Maps.known(cells, corner, 3).picture(2)
    x, y = (round(float(one)) for one in (corner - low) / RESOLUTION)
    assert np.array_equal(shown[y : y + len(cells), x : x + len(cells[0])], cells)
    assert (shown != 255).sum() == (cells != 255).sum()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "expected image, resolution and origin"),
        ("image: [", "a.yaml"),
        ("image: a.pgm\nresolution: 0.05\n", "expected image, resolution and origin"),
        (TEXT.replace("0.05", "much"), "is no number"),
        (TEXT.replace("1.0, 2.0, 0.0", "1.0, 2.0"), "is no number"),
        (TEXT.replace("1.0", ".nan"), "expected finite ones"),
        (TEXT.replace("0.05", "0.1"), "resolution 0.1 m and yaw 0.0 rad; expected 0.05 m"),
        (TEXT.replace("0.0]", "0.7]"), "yaw 0.7 rad"),
        (TEXT.replace("0.05", ".nan"), "resolution nan m"),
        (TEXT + "mode: raw\n", "mode raw; expected trinary"),
        (TEXT + "free_thresh: 0.9\n", "thresholds 0.9 and 0.65"),
        (TEXT, "a.pgm: no picture that can be read"),
        (TEXT.replace("a.pgm", "gone.pgm"), "gone.pgm: there is no such file"),
    ],
)
def test_what_is_wrong_with_a_map_is_named(text: str, why: str, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(text)
    (tmp_path / "a.pgm").write_bytes(b"no picture")
    with pytest.raises(BadMap, match=why.replace("[", r"\[")):
        read(tmp_path / "a.yaml")


def room_map() -> tuple[np.ndarray, np.ndarray]:
    """Return the map of the room of `rooms`, from a round in it."""
    maps = Maps.of(1)
    for x, y in ROUND:
        pose = np.array([x, y, 0.3])
        scan = scan_at(pose)
        maps.draw(0, pose, scan.ends, scan.returned, scan.start, 1e6)
    return maps.picture(0)


def test_a_base_put_down_anywhere_finds_itself_and_stays_found(figures: Figures) -> None:
    cells, corner = room_map()
    true = [np.array([0.8 + 0.12 * k, 0.9, 0.05 * k]) for k in range(20)]
    steps = [np.zeros(3), *(between(a, b) * 1.05 for a, b in zip(true, true[1:], strict=False))]
    ranges = [ranges_at(pose) for pose in true]
    log = Log(ranges, [ANGLES] * 20, MOUNT, np.array(steps), np.array([9.0, 9.0, 0.0]), None, 79.0)
    found = run(log, FilterConfig(particles=10), lambda: None, (cells, corner))
    errors = np.hypot(*(found.poses - np.array(true))[:, :2].T)
    figures(f"errors: {errors.mean():.3f} m mean, {errors.max():.3f} m at most")
    assert errors.max() < 0.06
    shown, _ = Maps.known(cells, corner, 1).picture(0)
    assert np.array_equal(found.cells, shown), "a given map is not drawn on"
    # A map whose cells do not lie on ours, as those of others do: nothing is moved by that.
    off = np.array([0.024, -0.017])
    again = run(log, FilterConfig(particles=10), lambda: None, (cells, corner + off))
    assert np.hypot(*(again.poses - np.array(true))[:, :2].T - off[:, None]).max() < 0.06
    assert np.abs((again.poses - found.poses)[:, :2] - off).mean() < 0.002
    with pytest.raises(NotFound):
        run(log, FilterConfig(), lambda: None, (np.full((10, 10), 100, np.uint8), np.zeros(2)))


def cast(occupied: np.ndarray, corner: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Return what a laser at `pose` measures to the first occupied cell: by small steps along each beam."""
    ahead = np.arange(0.05, 10.0, 0.01)
    found = np.full(360, np.inf)
    for k, bearing in enumerate(ANGLES + pose[2]):
        ends = pose[:2] + ahead[:, None] * np.array([math.cos(bearing), math.sin(bearing)])
        i, j = ((ends - corner) / RESOLUTION).astype(int).T
        inside = (i >= 0) & (j >= 0) & (i < occupied.shape[1]) & (j < occupied.shape[0])
        met = np.flatnonzero(inside)[occupied[j[inside], i[inside]]]
        if len(met):
            found[k] = ahead[met[0]]
    return found


@pytest.mark.shared
@needed(IKEA)
def test_one_scan_is_enough_in_a_real_flat(figures: Figures) -> None:
    cells, corner = read(IKEA)
    assert cells.shape == (384, 384) and corner.tolist() == [-10.0, -10.0]
    # Counted in the file with another reader: 705 cells of grey 0, 6459 of 254.
    assert ((cells == 100).sum(), (cells == 0).sum()) == (705, 6459)
    maps = Maps.known(cells, corner, 1)
    rows, columns = np.nonzero(distance_transform_edt(cells == 0) * RESOLUTION > 0.3)
    generator = np.random.Generator(np.random.PCG64(7))
    good, trials = 0, 15
    for one in generator.integers(len(rows), size=trials):
        pose = np.array(
            [*(corner + (np.array([columns[one], rows[one]]) + 0.5) * RESOLUTION), generator.uniform(-3, 3)]
        )
        ranges = cast(cells == 100, corner, pose) + 0.01 * generator.standard_normal(360)
        found, _ = locate(maps, Scan.of(ranges, ANGLES, np.zeros(3), 20.0, 79.0))
        turn = (found[0, 2] - pose[2] + math.pi) % math.tau - math.pi
        good += bool(math.hypot(*(found[0] - pose)[:2]) < 0.1 and abs(turn) < 0.1)
    figures(f"{good} of {trials} poses found within 0.1 m and 0.1 rad from one scan")
    assert good >= trials - 1
