"""PLY files, written: little endian or ASCII, whole or not at all."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sixd.files import write_atomically
from sixd.geometry.ply import Columns


def write_columns(
    path: Path,
    vertex: Mapping[str, NDArray[Any]],
    triangles: NDArray[np.integer[Any]],
    corner_uv: NDArray[np.float64] | None,
    texture_name: str | None,
    *,
    binary: bool,
) -> None:
    """Write a PLY file, whole or not at all.

    Args:
        path: the file; its folder must exist.
        vertex: property name -> ``(V,)`` of u1, i4, f4 or f8.
        triangles: ``(F, 3)``.
        corner_uv: ``(F, 3, 2)`` or None.
        texture_name: image named in the header, or None.
        binary: little endian, else ASCII with the shortest digits that read back the same.
    """
    names = {"u1": "uchar", "i4": "int", "f4": "float", "f8": "double"}
    face: Columns = {"count": np.full(len(triangles), 3, "u1"), "corner": triangles.astype("<i4")}
    lists = ["property list uchar int vertex_indices"]
    if corner_uv is not None:
        face["uv count"] = np.full(len(triangles), 6, "u1")
        face["uv"] = corner_uv.reshape(-1, 6).astype("<f8")
        lists.append("property list uchar double texcoord")
    n_vertices = len(next(iter(vertex.values())))
    header = [
        "ply",
        f"format {'binary_little_endian' if binary else 'ascii'} 1.0",
        *([f"comment TextureFile {texture_name}"] if texture_name else []),
        f"element vertex {n_vertices}",
        *(f"property {names[column.dtype.str[1:]]} {name}" for name, column in vertex.items()),
        f"element face {len(triangles)}",
        *lists,
        "end_header\n",
    ]
    encode = _binary_rows if binary else _ascii_rows
    body = encode(vertex, n_vertices) + encode(face, len(triangles))
    write_atomically(path, "\n".join(header).encode("latin-1") + body)


def _binary_rows(columns: Mapping[str, NDArray[Any]], count: int) -> bytes:
    dtype = np.dtype([(n, c.dtype.newbyteorder("<"), c.shape[1:]) for n, c in columns.items()])
    table = np.zeros(count, dtype)
    for name, column in columns.items():
        table[name] = column
    return table.tobytes()


def _ascii_rows(columns: Mapping[str, NDArray[Any]], count: int) -> bytes:
    if not count:
        return b""
    # tolist of a float32 would print its float64 digits; str of the float32 is the short form.
    parts = [
        np.array([str(x) for x in column.ravel()], object).reshape(count, -1)
        for column in columns.values()
    ]
    rows = np.concatenate(parts, axis=1).tolist()
    return "".join(" ".join(row) + "\n" for row in rows).encode("ascii")
