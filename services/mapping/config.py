"""Settings of the mapping service."""

from __future__ import annotations

import base64
import zlib
from typing import Annotated

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from runtime.errors import PushlaneError


class FilterConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the particle filter."""

    particles: Annotated[int, Meta(ge=1, le=1000, description="particles, each with a map")] = 30
    seed: Annotated[int, Meta(ge=0, lt=2**53, description="of everything drawn")] = 1
    furthest: Annotated[float, Meta(gt=0, le=100, description="m, beams are looked at up to there")] = 20.0
    memory: Annotated[
        float, Meta(ge=2, le=1e6, description="scans that a cell remembers at most: what came before fades")
    ] = 12.0


class KnownMap(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A map that was made before, of cells of 0.05 m that lie along the axes.

    cells: base64 of the zlib-compressed bytes of (height, width) cells, row y first: 0 free, 100 occupied, 255 unknown.
    x, y: m, map frame, the outer corner of cell (0, 0).
    """

    cells: str
    width: Annotated[int, Meta(ge=1, le=20_000)]
    height: Annotated[int, Meta(ge=1, le=20_000)]
    x: float
    y: float

    @classmethod
    def of(cls, cells: NDArray[np.uint8], corner: NDArray[np.float64]) -> KnownMap:
        """Return the map of `cells`, (H, W), and its corner, (2,), m."""
        packed = base64.b64encode(zlib.compress(np.ascontiguousarray(cells).tobytes(), 9)).decode()
        return cls(cells=packed, width=cells.shape[1], height=cells.shape[0], x=float(corner[0]), y=float(corner[1]))

    def grid(self) -> NDArray[np.uint8]:
        """Return the cells, (H, W).

        Raises:
            BadKnownMap: they are not what the class says.
        """
        size = self.width * self.height
        try:
            plain = zlib.decompressobj().decompress(base64.b64decode(self.cells, validate=True), size + 1)
        except (ValueError, zlib.error) as error:
            raise BadKnownMap(f"mapping.known.cells: {error}; expected base64 of zlib") from error
        if len(plain) != size:
            raise BadKnownMap(f"mapping.known.cells: not {self.width} x {self.height} cells")
        cells = np.frombuffer(plain, np.uint8).reshape(self.height, self.width)
        wrong = ~np.isin(cells, (0, 100, 255))
        if wrong.any():
            raise BadKnownMap(f"mapping.known.cells: {cells[wrong][0]} in a cell; expected 0, 100 or 255")
        return cells


class BadKnownMap(PushlaneError):
    """A known map in the configuration is no map."""

    exit_code = 2


class MappingConfig(FilterConfig, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the mapping service."""

    start: Annotated[
        tuple[float, float, float], Meta(description="x, y, theta: where the base starts, map frame, m and rad")
    ] = (0.0, 0.0, 0.0)
    known: Annotated[
        KnownMap | None,
        Meta(description="a map made before: the base is localised in it, and scans are drawn over it"),
    ] = None
    search: Annotated[
        bool, Meta(description="look for the start all over the known map with the first scan; else believe `start`")
    ] = False
    nothing: Annotated[float, Meta(gt=0, le=200, description="m, laser readings from here on met nothing")] = 9.99
    step: Annotated[float, Meta(ge=0, le=5, description="m on which scans are matched again")] = 0.05
    turn: Annotated[float, Meta(ge=0, le=3.15, description="rad by which scans are matched again")] = 0.05
    pause: Annotated[float, Meta(ge=0, le=60, description="s after which scans are matched again, at rest")] = 0.5
    shown_memory: Annotated[
        float, Meta(ge=2, le=1e6, description="scans that a cell of the published map remembers at most")
    ] = 6.0
    map_period: Annotated[float, Meta(ge=0, le=60, description="s between two maps at least")] = 0.5
    object_margin: Annotated[
        float, Meta(ge=0, le=1, description="m around the pushed object in which nothing is taken for the room")
    ] = 0.10
    object_speed: Annotated[
        float,
        Meta(ge=0, le=5, description="m/s that it may have been pushed on since it was seen, and that more margin"),
    ] = 0.4
    wait: Annotated[float, Meta(ge=0, le=60, description="s to wait for the object at first, not to map it")] = 3.0
