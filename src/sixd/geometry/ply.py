"""PLY files, ASCII and binary: the columns of their vertices and faces, strictly checked.

Why not a library: ASCII numbers must be parsed as float64 (the reference toolkit does, and errors
are compared to 1e-6 mm), in milliseconds, without a second of imports, and every broken file must
end in a message that names it.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from sixd.geometry.ply_header import PlyElement, PlyFile

Columns = dict[str, NDArray[Any]]

# Lists of a triangle have these lengths; a file where all do is read in one piece.
_INDEX_LISTS = ("vertex_indices", "vertex_index")
_TRIANGLE_LISTS = {**dict.fromkeys(_INDEX_LISTS, 3), "texcoord": 6}


@dataclass(frozen=True)
class PlyContent:
    """What a PLY file holds of a triangle mesh."""

    vertex: Columns
    """Property name -> ``(V,)``; ASCII numbers are float64, binary ones as stored."""
    triangles: NDArray[np.int64]
    """``(F, 3)``; polygons are cut into fans around their first corner."""
    corner_uv: NDArray[np.float64] | None
    """``(F, 3, 2)`` where faces carry ``texcoord``."""
    texture_name: str | None


def read_ply(path: Path, *, faces: bool = True, only: tuple[str, ...] = ()) -> PlyContent:
    """Read a PLY file.

    Args:
        path: the file.
        faces: False leaves the faces unread (and unchecked).
        only: vertex properties wanted; empty means all.

    Raises:
        MissingDataError: there is no such file.
        FormatError: not a PLY file, or one that breaks its own header; the path is named.
    """
    return _Reader(path).read(faces, only)


class _Reader(PlyFile):
    def read(self, faces: bool, only: tuple[str, ...]) -> PlyContent:
        wanted = {e.name for e in self.elements} & ({"vertex", "face"} if faces else {"vertex"})
        if faces and any(e.name == "tristrips" for e in self.elements):
            self.fail("triangle strips are not read", "an element named face", "tristrips")
        vertex: Columns = {}
        triangles, corner_uv = np.zeros((0, 3), np.int64), None
        for element in self.elements:
            if not wanted:
                break
            if element.name == "face" and faces:
                triangles, corner_uv = self._faces(element)
            else:
                columns = self._plain(element, only if element.name == "vertex" else ("",))
                vertex = columns if element.name == "vertex" else vertex
            wanted.discard(element.name)
        return PlyContent(vertex, triangles, corner_uv, self.texture_name)

    def _plain(self, element: PlyElement, only: tuple[str, ...]) -> Columns:
        """Columns of an element; those of list properties are left out."""
        if element.has_lists:
            rows = self._records(element)
            keep = [p.name for p in element.properties if not p.count_dtype]
            return {name: np.array([row[name][0] for row in rows], np.float64) for name in keep}
        names = [p.name for p in element.properties]
        if not element.count:
            return {name: np.zeros(0) for name in names}
        kept = [i for i, name in enumerate(names) if not only or name in only]
        if self.byte_order:
            table = self._binary_table(element, [(p.name, p.dtype, 1) for p in element.properties])
            return {names[i]: table[names[i]][:, 0].copy() for i in kept}
        lines = self._lines(element)
        if not kept:
            self.line += element.count
            return {}
        values = self._ascii_table(lines, tuple(kept) if only else None)
        if values is None or values.shape[1] != len(kept):
            self._blame_a_line(element, lines)
        self.line += element.count
        return {names[i]: values[:, column] for column, i in enumerate(kept)}

    def _faces(self, element: PlyElement) -> tuple[NDArray[np.int64], NDArray[np.float64] | None]:
        lists = {p.name for p in element.properties if p.count_dtype}
        index_names = [name for name in _INDEX_LISTS if name in lists]
        if not index_names and element.count:
            got = ", ".join(p.name for p in element.properties) or "no properties"
            self.fail("faces have no vertices", "property list uchar int vertex_indices", got)
        if not element.count:
            return np.zeros((0, 3), np.int64), None
        start = self.offset, self.line
        corners = self._all_triangles(element)
        if corners is None:
            self.offset, self.line = start
            corners = self._fans(element, index_names[0])
        indices, uv = corners[index_names[0]], corners.get("texcoord")
        return indices, None if uv is None else uv.reshape(-1, 3, 2)

    def _all_triangles(self, element: PlyElement) -> Columns | None:
        """Faces in one piece, or None where not all are triangles."""
        layout: list[tuple[str, str, int]] = []
        for p in element.properties:
            if p.count_dtype:
                if p.name not in _TRIANGLE_LISTS:
                    return None
                layout.append((f"{p.name} count", p.count_dtype, 1))
            layout.append((p.name, p.dtype, _TRIANGLE_LISTS[p.name] if p.count_dtype else 1))
        if self.byte_order:
            itemsize = sum(np.dtype(kind).itemsize * n for _, kind, n in layout)
            if len(self.data) - self.offset < itemsize * element.count:
                return None
            table = self._binary_table(element, layout)
            columns: Columns = {name: table[name] for name, _, _ in layout}
        else:
            lines = self._lines(element)
            whole = all(kind[0] != "f" for _, kind, _ in layout)
            values = self._ascii_table(lines, None, np.int64 if whole else np.float64)
            ends = np.cumsum([n for _, _, n in layout])
            if values is None or values.shape[1] != ends[-1]:
                return None
            self.line += element.count
            columns = {
                name: values[:, end - n : end]
                for (name, _, n), end in zip(layout, ends, strict=True)
            }
        lists = {k: n for k, n in _TRIANGLE_LISTS.items() if f"{k} count" in columns}
        if any((columns[f"{name} count"] != length).any() for name, length in lists.items()):
            return None
        for name in lists.keys() & set(_INDEX_LISTS):
            if not (np.isfinite(columns[name]) & (columns[name] == np.floor(columns[name]))).all():
                return None
        kinds = {name: np.float64 if name == "texcoord" else np.int64 for name in lists}
        return {name: columns[name].astype(kind) for name, kind in kinds.items()}

    def _fans(self, element: PlyElement, index_name: str) -> Columns:
        """Faces one by one: triangles and larger polygons, cut into fans."""
        indices: list[tuple[float, ...]] = []
        uvs: list[tuple[float, ...]] = []
        has_uv = any(p.name == "texcoord" and p.count_dtype for p in element.properties)
        first_line = self.line + 1
        for i, row in enumerate(self._records(element)):
            corners, uv = row[index_name], row["texcoord"] if has_uv else ()
            line = None if self.byte_order else first_line + i
            if len(corners) < 3 or not all(
                0 <= c < 2**53 and float(c).is_integer() for c in corners
            ):
                self.fail("not a face", "3 vertex indices or more", str(corners), line)
            if has_uv and len(uv) != 2 * len(corners):
                self.fail("texcoord does not fit", f"{2 * len(corners)} values", str(uv), line)
            for k in range(1, len(corners) - 1):
                indices.append((corners[0], corners[k], corners[k + 1]))
                uvs.append((*uv[:2], *uv[2 * k : 2 * k + 4]))
        columns: Columns = {index_name: np.array(indices, np.float64).astype(np.int64)}
        if has_uv:
            columns["texcoord"] = np.array(uvs, np.float64)
        return columns

    def _binary_table(
        self, element: PlyElement, layout: list[tuple[str, str, int]]
    ) -> NDArray[Any]:
        dtype = np.dtype([(name, self.byte_order + kind, (n,)) for name, kind, n in layout])
        size = dtype.itemsize * element.count
        if len(self.data) - self.offset < size:
            self.fail_truncated(element, f"{size} bytes", f"{len(self.data) - self.offset} bytes")
        table: NDArray[Any] = np.frombuffer(self.data, dtype, element.count, self.offset)
        self.offset += size
        return table

    def _lines(self, element: PlyElement) -> list[str]:
        """The element's lines; the offset moves behind them."""
        # A record is a character and a line end at least: no absurd count gets past here.
        if 2 * element.count > len(self.data) - self.offset + 1:
            self.fail_truncated(element, f"{element.count} lines", "fewer")
        lines = self.data[self.offset :].split(b"\n", element.count)
        if len(lines) < element.count or (len(lines) == element.count and not lines[-1].strip()):
            self.fail_truncated(element, f"{element.count} lines", f"{len(lines)} lines")
        rest = lines.pop() if len(lines) > element.count else b""
        self.offset = len(self.data) - len(rest)
        return b"\n".join(lines).decode("latin-1").split("\n") if lines else []

    def _ascii_table(
        self, lines: list[str], columns: tuple[int, ...] | None, dtype: type = np.float64
    ) -> NDArray[Any] | None:
        """Numbers of equally long lines, or None."""
        if not any(map(str.strip, lines[:1])):
            return None  # loadtxt would skip it, and warn when all are blank
        try:
            table: NDArray[Any] = np.loadtxt(lines, dtype, comments=None, usecols=columns, ndmin=2)
        except (ValueError, OverflowError):
            return None
        return table if len(table) == len(lines) else None

    def _blame_a_line(self, element: PlyElement, lines: list[str]) -> NoReturn:
        width = len(element.properties)
        for i, text in enumerate(lines):
            with contextlib.suppress(ValueError, OverflowError):
                if len([float(word) for word in text.split()]) == width:
                    continue
            expected = f"{width} numbers: " + " ".join(p.name for p in element.properties)
            self.fail(f"bad {element.name}", expected, repr(text), self.line + 1 + i)
        self.fail(f"bad {element.name} table", f"{len(lines)} lines of numbers", "other text")

    def _records(self, element: PlyElement) -> list[dict[str, tuple[float, ...]]]:
        """One dict per record; slow, for lists of any length."""
        if self.byte_order:
            return [self._binary_record(element) for _ in range(element.count)]
        records = []
        for text in self._lines(element):
            try:
                values = [float(word) for word in text.split()]
                record, used = _split_record(element, values)
            except (ValueError, OverflowError, IndexError):
                record, used, values = {}, 0, [0.0]
            if used != len(values):
                self.fail(f"bad {element.name}", element.describe(), repr(text), self.line + 1)
            records.append(record)
            self.line += 1
        return records

    def _binary_record(self, element: PlyElement) -> dict[str, tuple[float, ...]]:
        record = {}
        for p in element.properties:
            length = 1
            if p.count_dtype:
                length = int(self._take(element, p.count_dtype, 1)[0])
            record[p.name] = tuple(self._take(element, p.dtype, length).tolist())
        return record

    def _take(self, element: PlyElement, kind: str, count: int) -> NDArray[Any]:
        dtype = np.dtype(self.byte_order + kind)
        if count < 0 or len(self.data) - self.offset < count * dtype.itemsize:
            left = len(self.data) - self.offset
            self.fail_truncated(element, f"{count} more values of a list", f"{left} bytes")
        values = np.frombuffer(self.data, dtype, count, self.offset)
        self.offset += count * dtype.itemsize
        return values


def _split_record(
    element: PlyElement, values: list[float]
) -> tuple[dict[str, tuple[float, ...]], int]:
    record: dict[str, tuple[float, ...]] = {}
    at = 0
    for p in element.properties:
        length = 1
        if p.count_dtype:
            if not values[at].is_integer():
                raise ValueError
            length, at = int(values[at]), at + 1
        record[p.name] = tuple(values[at : at + length])
        if length < 0 or len(record[p.name]) != length:
            raise ValueError
        at += length
    return record, at
