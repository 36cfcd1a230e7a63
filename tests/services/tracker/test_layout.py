"""The tags of an object, and the layouts that no object can have."""

from __future__ import annotations

import numpy as np
import pytest

from services.tracker.layout import BadLayout, Layout, Tag, cube


def test_the_tags_of_a_cube_lie_on_its_faces() -> None:
    tags = cube(range(5), 0.14, 0.105, bottom=0.3).by_id()
    middles = np.array([tags[id].position for id in range(5)])
    expected = [[0, 0, 0.44], [0.07, 0, 0.37], [0, 0.07, 0.37], [-0.07, 0, 0.37], [0, -0.07, 0.37]]
    np.testing.assert_allclose(middles, expected, atol=1e-12)
    # From the left the front is on the left side: upper left is forward and up.
    h = 0.0525
    np.testing.assert_allclose(
        tags[2].corners(),
        [[h, 0.07, 0.37 + h], [-h, 0.07, 0.37 + h], [-h, 0.07, 0.37 - h], [h, 0.07, 0.37 - h]],
        atol=1e-12,
    )
    # From above, the front being up, left is on the left side.
    np.testing.assert_allclose(
        tags[0].corners(), [[h, h, 0.44], [h, -h, 0.44], [-h, -h, 0.44], [-h, h, 0.44]], atol=1e-12
    )


@pytest.mark.parametrize("id", range(5))
def test_tags_face_outwards(id: int) -> None:
    tag = cube(range(5), 0.14, 0.105).by_id()[id]
    corners = tag.corners()
    # Clockwise as seen from where it can be seen.
    normal = np.cross(corners[3] - corners[0], corners[1] - corners[0])
    outward = tag.position - [0.0, 0.0, 0.07]
    np.testing.assert_allclose(normal / np.linalg.norm(normal), outward / np.linalg.norm(outward), atol=1e-12)


def test_layouts_that_cannot_be_are_refused() -> None:
    flat = Tag(1, 0.1, np.eye(3), np.zeros(3))
    with pytest.raises(BadLayout, match=r"\[1, 1\]"):
        Layout((flat, flat))
    with pytest.raises(BadLayout, match="at least one"):
        Layout(())
    with pytest.raises(BadLayout, match=r"side of 0\.0"):
        Tag(1, 0.0, np.eye(3), np.zeros(3))
    with pytest.raises(BadLayout, match="rotation that is none"):
        Tag(1, 0.1, np.diag([1.0, 1.0, -1.0]), np.zeros(3))
    with pytest.raises(BadLayout, match="shapes"):
        Tag(1, 0.1, np.eye(3), np.zeros(2))
    with pytest.raises(BadLayout, match="five"):
        cube(range(4), 0.14, 0.105)
    with pytest.raises(BadLayout, match="five"):
        cube(range(5), 0.1, 0.105)
