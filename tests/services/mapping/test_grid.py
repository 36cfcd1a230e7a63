"""What beams draw, against sampling along them; and that sharing tiles changes nothing but the memory."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.mapping.config import FilterConfig
from services.mapping.grid import HITS, MEAN_X, OCCUPIED, RESOLUTION, SIDE, VISITS, Maps
from tests.services.mapping.rooms import ranges_at, scan_at

START = np.zeros(2)
HERE = np.zeros(3)


def value(maps: Maps, x: float, y: float, particle: int = 0) -> np.ndarray:
    """Return the cell at (x, y), m."""
    i, j = math.floor(x / RESOLUTION) - maps.corner[0] * SIDE, math.floor(y / RESOLUTION) - maps.corner[1] * SIDE
    return maps.cells[maps.index[particle, j // SIDE, i // SIDE], j % SIDE, i % SIDE]


def off_the_lines(most: float) -> st.SearchStrategy[float]:
    """Coordinates that lie in a cell beyond rounding."""
    return st.floats(-most, most).filter(lambda x: 1e-6 < (x / RESOLUTION) % 1.0 < 1.0 - 1e-6)


@given(off_the_lines(8.0), off_the_lines(8.0), st.booleans())
def test_a_beam_passes_the_cells_that_it_passes(x: float, y: float, returned: bool) -> None:
    maps = Maps.of(1)
    maps.draw(0, HERE, np.array([[x, y]]), np.array([returned]), START, 1e6)
    shown, corner = maps.picture(0)
    seen = np.zeros_like(shown, bool)
    # The oracle: points along the beam, closer than cells, those near a corner of one left out.
    length = math.hypot(x, y)
    certain = 0
    for t in np.linspace(0.0, 1.0, 2 + int(length / 0.002)):
        fx, fy = (t * x - corner[0]) / RESOLUTION, (t * y - corner[1]) / RESOLUTION
        if min(fx % 1.0, fy % 1.0, 1.0 - fx % 1.0, 1.0 - fy % 1.0) > 1e-6:
            seen[int(fy), int(fx)] = True
    for j, i in np.argwhere(seen):
        certain += shown[j, i] != 255
    assert certain == seen.sum(), "every cell on the beam is known"
    # Cells touched without a sample in them are cut at a corner, by less than the samples' distance.
    extra = np.argwhere((shown != 255) & ~seen)
    for j, i in extra:
        corners = np.array([[i, j], [i + 1, j], [i, j + 1], [i + 1, j + 1]]) * RESOLUTION + corner
        near = np.abs(x * corners[:, 1] - y * corners[:, 0]) / max(length, 1e-9)
        assert near.min() < 0.003
    occupied = np.argwhere(shown == 100)
    assert len(occupied) == int(returned)
    if returned:
        end = [int((y - corner[1]) / RESOLUTION), int((x - corner[0]) / RESOLUTION)]
        assert occupied[0].tolist() == end
        assert value(maps, x, y)[MEAN_X] == pytest.approx(x, abs=1e-6)


def test_walls_are_where_they_are() -> None:
    maps = Maps.of(1)
    pose = np.array([1.0, 1.0, 0.3])
    scan = scan_at(pose)
    maps.draw(0, pose, scan.ends, scan.returned, scan.start, 1e6)
    shown, corner = maps.picture(0)
    ys, xs = np.nonzero(shown == 100)
    x, y = corner[0] + (xs + 0.5) * RESOLUTION, corner[1] + (ys + 0.5) * RESOLUTION
    off = np.min(np.abs([x, x - 6, y, y - 4, y - 2.8, x - 2.5, x - 4.2, x - 4.6, y - 2.2, y - 2.7]), axis=0)
    assert off.max() <= 0.5 * RESOLUTION + 1e-9
    assert len(xs) > 150
    inside = shown[int((1.5 - corner[1]) / RESOLUTION), int((3.0 - corner[0]) / RESOLUTION)]
    assert inside == 0
    assert shown[0, 0] == 255, "nothing is known outside"


@given(
    st.lists(st.tuples(st.integers(0, 3), st.floats(0.5, 2.0), st.floats(0.5, 2.0), st.floats(-3, 3)), max_size=12),
    st.lists(st.integers(0, 3), min_size=4, max_size=4),
)
def test_particles_that_share_differ_in_nothing_from_particles_that_do_not(
    drawn: list[tuple[int, float, float, float]], chosen: list[int]
) -> None:
    shared, own = Maps.of(4), [Maps.of(1) for _ in range(4)]
    scans = []
    for k, (particle, x, y, theta) in enumerate(drawn):
        if k == len(drawn) // 2:
            shared.take(np.array(chosen))
            copies = []
            for one in chosen:
                copy = Maps.of(1)
                for pose, scan in [entry[1:] for entry in scans if entry[0] == one]:
                    copy.draw(0, pose, scan.ends, scan.returned, scan.start, 1e6)
                copies.append(copy)
            own = copies
            scans = [(new, *entry[1:]) for new, old in enumerate(chosen) for entry in scans if entry[0] == old]
        pose = np.array([x, y, theta])
        scan = scan_at(pose)
        shared.draw(particle, pose, scan.ends, scan.returned, scan.start, 1e6)
        own[particle].draw(0, pose, scan.ends, scan.returned, scan.start, 1e6)
        scans.append((particle, pose, scan))
    for particle in range(4):
        shown, corner = shared.picture(particle)
        alone, its = own[particle].picture(0)
        known, theirs = np.argwhere(shown != 255), np.argwhere(alone != 255)
        assert np.allclose(known[:, ::-1] * RESOLUTION + corner, theirs[:, ::-1] * RESOLUTION + its)
        assert (shown[shown != 255] == alone[alone != 255]).all()
    used = shared.index[shared.index >= 0]
    assert np.array_equal(np.bincount(used, minlength=len(shared.owners)), shared.owners)


def test_what_goes_and_what_comes_is_taken_up_within_two_seconds() -> None:
    """Ten scans a second, after it has been otherwise for long."""
    maps, memory = Maps.of(1), FilterConfig().memory
    here, behind = np.array([[2.0, 0.0]]), np.array([[3.0, 0.0]])

    def scans_until(occupied: bool, end: np.ndarray) -> int:
        for k in range(100):
            cell = value(maps, 2.0, 0.0)
            if bool(cell[HITS] >= OCCUPIED * cell[VISITS]) == occupied:
                return k
            maps.draw(0, HERE, end, np.array([True]), START, memory)
        return 100

    def long(end: np.ndarray) -> None:
        for _ in range(500):
            maps.draw(0, HERE, end, np.array([True]), START, memory)

    long(here)
    assert 1 < scans_until(False, behind) <= 20
    long(behind)
    assert 1 < scans_until(True, here) <= 20


def test_a_cell_knows_the_mean_of_all_ends_in_it() -> None:
    maps = Maps.of(1)
    for ends in ([1.001, 1.049, 1.002], [1.020]):
        beams = np.array([[x, 0.01] for x in ends])
        maps.draw(0, HERE, beams, np.full(len(ends), True), START, 1e6)
    cell = value(maps, 1.02, 0.01)
    assert cell[MEAN_X] == pytest.approx((1.001 + 1.049 + 1.002 + 1.020) / 4)
    assert (cell[HITS], cell[VISITS]) == (2.0, 2.0), "a scan counts once"
    maps.draw(0, HERE, np.empty((0, 2)), np.empty(0, bool), START, 1e6)
    assert value(maps, 1.02, 0.01)[HITS] == 2.0, "a scan that saw nothing draws nothing"


def test_the_laser_of_these_tests_is_right() -> None:
    pose = np.array([1.0, 1.0, 0.0])
    found = ranges_at(pose)
    assert found[180] == pytest.approx(6.0 - 1.1)
    assert found[0] == pytest.approx(1.1)
    assert found[270] == pytest.approx(1.8) and found[90] == pytest.approx(1.0)
