"""Reads Rerun files back with Rerun's own reader."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from rerun.chunk import RrdReader


def column(rrd: Path, entity: str, component: str) -> tuple[NDArray[np.int64], list[list[object]]]:
    """Times (ns) and rows of one component, read back with Rerun's own reader."""
    chunks = RrdReader(rrd).store().stream().filter(content=entity, is_static=False, components=component).to_chunks()
    tables = [chunk.to_record_batch() for chunk in chunks]
    times = np.concatenate([table["t"].cast(pa.int64()).to_numpy() for table in tables])
    rows = [row for table in tables for row in table[component].to_pylist()]
    order = np.argsort(times, kind="stable")
    return times[order], [rows[index] for index in order]
