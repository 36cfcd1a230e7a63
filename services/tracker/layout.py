"""Where the tags of an object sit on it.

The object's frame: its origin is the centre of its bounding circle on the floor, x forward, y left, z up. A tag's
frame: its origin is the middle of the marker, x to the right and y up as it is printed, z out of the print.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from services.geometry.pose import rotation

Array = NDArray[np.float64]


class BadLayout(ValueError):
    """Tags that no object can carry."""


@dataclass(frozen=True)
class Tag:
    """One tag of an object.

    Attributes:
        id: in its dictionary.
        side: m, of the black square.
        rotation: (3, 3), from the tag's frame to the object's.
        position: (3,), m, its middle, object's frame.
    """

    id: int
    side: float
    rotation: Array
    position: Array

    def __post_init__(self) -> None:
        """Check the tag.

        Raises:
            BadLayout: its side is not positive, or its rotation is none.
        """
        if not self.side > 0.0:
            raise BadLayout(f"tag {self.id} has a side of {self.side} m, expected more than 0")
        if self.rotation.shape != (3, 3) or self.position.shape != (3,):
            raise BadLayout(f"tag {self.id} has a pose of shapes {self.rotation.shape} and {self.position.shape}")
        turned = self.rotation.T @ self.rotation
        if not (np.allclose(turned, np.eye(3), atol=1e-6) and np.linalg.det(self.rotation) > 0.0):
            raise BadLayout(f"tag {self.id} has a rotation that is none: {self.rotation.tolist()}")

    def corners(self) -> Array:
        """Return the corners, (4, 3), m, object's frame: upper left, upper right, lower right, lower left."""
        return square(self.side) @ self.rotation.T + self.position


@dataclass(frozen=True)
class Layout:
    """The tags of an object, each with an id of its own."""

    tags: tuple[Tag, ...]

    def __post_init__(self) -> None:
        """Check the layout.

        Raises:
            BadLayout: there is no tag, or two have one id.
        """
        ids = [tag.id for tag in self.tags]
        if not ids or len(set(ids)) != len(ids):
            raise BadLayout(f"the tags have the ids {ids}, expected at least one and each once")

    def by_id(self) -> dict[int, Tag]:
        """Return the tags by their ids."""
        return {tag.id: tag for tag in self.tags}


def square(side: float) -> Array:
    """Return the corners of a tag of `side`, m, (4, 3), its own frame, in the order in which they are found."""
    return 0.5 * side * np.array([[-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, -1.0, 0.0]])


def cube(
    ids: Sequence[int], edge: float, side: float, bottom: float = 0.0, at: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Layout:
    """Return the layout of a cube that stands on the object.

    Args:
        ids: five, of the tags on top, in front, on the left, behind and on the right.
        edge, side: m, of the cube and of the markers.
        bottom: m, the height of the cube's lower face.
        at: x, y, yaw of the cube, m and rad, object's frame: the centre of the bounding circle, and its x axis.

    Raises:
        BadLayout: there are not five ids, or the markers are larger than the cube.
    """
    if len(ids) != 5 or side > edge:
        raise BadLayout(f"a cube of {edge} m with the ids {list(ids)} and markers of {side} m, expected five that fit")
    up = np.array([0.0, 0.0, 1.0])
    middle = (bottom + 0.5 * edge) * up
    # The upper side of the marker on top points forward.
    tags = [Tag(ids[0], side, _facing(up, np.array([1.0, 0.0, 0.0])), middle + 0.5 * edge * up)]
    for id, normal in zip(ids[1:], ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0)), strict=True):
        out = np.array(normal)
        tags.append(Tag(id, side, _facing(out, up), middle + 0.5 * edge * out))
    turned, off = np.eye(3), np.array((at[0], at[1], 0.0))
    turned[:2, :2] = rotation(at[2])
    return Layout(
        tuple(replace(tag, rotation=turned @ tag.rotation, position=turned @ tag.position + off) for tag in tags)
    )


def _facing(normal: Array, upper: Array) -> Array:
    """Return the rotation, (3, 3), of a tag that faces `normal`, its upper side towards `upper`."""
    return np.column_stack([np.cross(upper, normal), upper, normal])
