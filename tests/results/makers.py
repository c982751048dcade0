"""Results to test with: random tables, and files with one thing wrong."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from sixd.results import Detections, PoseEstimates, Rle
from sixd.results.tables import Table

HEADER = "scene_id,im_id,obj_id,score,R,t,time"
IDENTITY = "1 0 0 0 1 0 0 0 1"
ROW = f"2,3,5,0.5,{IDENTITY},10 -20 700,0.25"

ids = st.integers(0, 2**63 - 1) | st.integers(0, 50)
finite = st.floats(allow_nan=False, allow_infinity=False)
times = st.just(float("nan")) | st.floats(min_value=0, allow_infinity=False)


@st.composite
def pose_tables(draw: st.DrawFn, max_rows: int = 6) -> PoseEstimates:
    n = draw(st.integers(0, max_rows))

    def column(values: st.SearchStrategy[Any], width: int = 1) -> list[Any]:
        return draw(st.lists(values, min_size=n * width, max_size=n * width))

    return PoseEstimates.from_arrays(
        scene_id=np.array(column(ids), np.int64),
        im_id=np.array(column(ids), np.int64),
        obj_id=np.array(column(ids), np.int64),
        score=column(finite),
        R=np.reshape(column(finite, 9), (n, 9)),
        t_mm=np.reshape(column(finite, 3), (n, 3)),
        time_s=column(times),
    )


rles = st.builds(
    Rle,
    st.tuples(st.integers(0, 4000), st.integers(0, 4000)),
    st.text(max_size=12) | st.lists(st.integers(-(2**63), 2**63 - 1), max_size=5),
)


@st.composite
def detection_tables(draw: st.DrawFn, max_rows: int = 6) -> Detections:
    n = draw(st.integers(0, max_rows))
    some_ids = st.lists(ids, min_size=n, max_size=n)
    box = st.just([np.nan] * 4) | st.lists(finite, min_size=4, max_size=4)
    return Detections.from_arrays(
        scene_id=np.array(draw(some_ids), np.int64),
        im_id=np.array(draw(some_ids), np.int64),
        obj_id=np.array(draw(some_ids), np.int64),
        score=draw(st.lists(finite, min_size=n, max_size=n)),
        bbox_xywh_px=np.reshape(draw(st.lists(box, min_size=n, max_size=n)), (n, 4)),
        segmentation=draw(st.lists(st.none() | rles, min_size=n, max_size=n)),
        time_s=draw(st.lists(times, min_size=n, max_size=n)),
    )


def bits(table: Table) -> dict[str, Any]:
    """Every bit of what the table says, without where it was read."""
    return {
        name: column if isinstance(column, tuple) else (column.dtype, column.tobytes())
        for name, column in table._columns()
        if name not in ("line", "entry")
    }


def csv_file(path: Path, *rows: str, header: str = HEADER, end: str = "\n") -> Path:
    path.write_bytes((end.join([header, *rows]) + end).encode())
    return path


def row_with(**fields: str) -> str:
    """`ROW` with some fields replaced."""
    names = HEADER.split(",")
    values = dict(zip(names, ROW.split(","), strict=True)) | fields
    return ",".join(values[name] for name in names)


def random_rotations(n: int, seed: int = 0) -> NDArray[np.float64]:
    q = np.random.default_rng(seed).normal(size=(n, 4))
    w, x, y, z = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    return np.stack(
        [
            *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        ],
        axis=-1,
    ).reshape(n, 3, 3)


def double_of(raw: bytes) -> float:
    return float(struct.unpack("<d", raw)[0])
