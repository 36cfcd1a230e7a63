"""Extra channels that let a plain viewer draw a session without any code of ours.

Rerun and Foxglove both draw a ROS 2 `nav_msgs/OccupancyGrid` in CDR, and need one transform to place it. Replay
ignores these channels: they are derived from the map.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import Writer

from runtime import topics
from runtime.messages import OccupancyGrid
from runtime.recorder.schema import descriptor_set
from runtime.time import SECOND

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

    from runtime.sample import Sample

PREFIX = "viewer/"
_GRID_TYPE = "nav_msgs/msg/OccupancyGrid"


class ViewerChannels:
    """Writes the derived channels beside the samples."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._map: int | None = None

    def add(self, sample: Sample) -> None:
        """Write what viewers need beside `sample`, if anything."""
        if sample.topic != topics.MAP.name:
            return
        if self._map is None:
            self._map = self._register_map(sample)
        grid = OccupancyGrid.FromString(sample.payload)
        self._writer.add_message(self._map, sample.time, _cdr(grid), sample.time, sample.sequence)

    def _register_map(self, sample: Sample) -> int:
        self._add_transform(sample)
        definition, _ = _types().generate_msgdef(_GRID_TYPE, ros_version=2)
        schema = self._writer.register_schema(_GRID_TYPE, SchemaEncoding.ROS2, definition.encode())
        return self._writer.register_channel(f"{PREFIX}map", MessageEncoding.CDR, schema)

    def _add_transform(self, sample: Sample) -> None:
        kind = FrameTransform.DESCRIPTOR
        schema = self._writer.register_schema(
            kind.full_name, SchemaEncoding.Protobuf, descriptor_set(kind.file).SerializeToString()
        )
        channel = self._writer.register_channel(f"{PREFIX}tf", MessageEncoding.Protobuf, schema)
        transform = FrameTransform(parent_frame_id="tf#/", child_frame_id="map")
        transform.rotation.w = 1.0
        self._writer.add_message(channel, sample.time, transform.SerializeToString(), sample.time, 1)


@cache
def _types() -> Typestore:
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)


def _cdr(grid: OccupancyGrid) -> bytes:
    types = _types().types
    stamp = types["builtin_interfaces/msg/Time"](sec=grid.stamp // SECOND, nanosec=grid.stamp % SECOND)
    point = types["geometry_msgs/msg/Point"](x=grid.origin.x, y=grid.origin.y, z=0.0)
    turn = types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
    info = types["nav_msgs/msg/MapMetaData"](
        map_load_time=stamp,
        resolution=grid.resolution,
        width=grid.width,
        height=grid.height,
        origin=types["geometry_msgs/msg/Pose"](position=point, orientation=turn),
    )
    message = types[_GRID_TYPE](
        header=types["std_msgs/msg/Header"](stamp=stamp, frame_id="map"),
        info=info,
        data=np.frombuffer(grid.cells, np.int8),
    )
    return bytes(_types().serialize_cdr(message, _GRID_TYPE))
