"""PLY files, ASCII and binary: the columns of their vertices and faces, strictly checked.

Why not a library: ASCII numbers must be parsed as float64 (the reference toolkit does, and errors
are compared to 1e-6 mm), in milliseconds, without a second of imports, and every broken file must
end in a message. docs/decisions tells the measurements.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from sixd.errors import FormatError, MissingDataError, Problem

Columns = dict[str, NDArray[Any]]

_NAMED_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip
_BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
# Lists of a triangle have these lengths; a file where all do is read in one piece.
_INDEX_LISTS = ("vertex_indices", "vertex_index")
_TRIANGLE_LISTS = {**dict.fromkeys(_INDEX_LISTS, 3), "texcoord": 6}


@dataclass(frozen=True)
class _Property:
    name: str
    dtype: str
    count_dtype: str = ""
    """Type of the length, for lists only."""


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: tuple[_Property, ...]

    @property
    def has_lists(self) -> bool:
        return any(p.count_dtype for p in self.properties)


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


class _Reader:
    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self.data = path.read_bytes()
        except OSError as error:
            reason = error.strerror or type(error).__name__
            raise MissingDataError(f"mesh {path} cannot be read: {reason}") from error
        self.byte_order = ""
        self.texture_name: str | None = None
        self.offset = 0
        """Where the next element starts."""
        self.line = 1
        """Its line, for ASCII files."""

    def fail(self, what: str, expected: str, got: str, line: int | None = None) -> NoReturn:
        fix = "export the mesh again as PLY (triangles, ASCII or binary)"
        problem = Problem("bad-ply", what, str(self.path), line, "", expected, got[:200], fix)
        raise FormatError([problem])

    def read(self, faces: bool, only: tuple[str, ...]) -> PlyContent:
        elements = self._header()
        names = [e.name for e in elements]
        if "vertex" not in names:
            self.fail("no vertices", "an element named vertex", ", ".join(names) or "no elements")
        if faces and "tristrips" in names:
            self.fail("triangle strips are not read", "an element named face", "tristrips")
        wanted = ["vertex", "face"] if faces and "face" in names else ["vertex"]
        vertex: Columns = {}
        triangles, corner_uv = np.zeros((0, 3), np.int64), None
        for element in elements:
            if element.name == "face" and faces:
                triangles, corner_uv = self._faces(element)
            else:
                columns = self._plain(element, only if element.name == "vertex" else ("",))
                vertex = columns if element.name == "vertex" else vertex
            wanted = [name for name in wanted if name != element.name]
            if not wanted:
                break
        return PlyContent(vertex, triangles, corner_uv, self.texture_name)

    # -- header ----------------------------------------------------------------------------

    def _header(self) -> list[_Element]:
        if self.data[:3] != b"ply" or self.data[3:4] not in (b"\n", b"\r"):
            self.fail("not a PLY file", "first line: ply", repr(self.data[:20]), 1)
        elements: list[_Element] = []
        form = ""
        while True:
            end = self.data.find(b"\n", self.offset)
            if end < 0:
                self.fail("the header does not end", "end_header", "end of file", self.line)
            text = self.data[self.offset : end].decode("latin-1")
            words = text.split()
            self.offset = end + 1
            match words:
                case ["end_header"]:
                    break
                case ["format", name, "1.0"] if name in _BYTE_ORDERS and not form:
                    form, self.byte_order = name, _BYTE_ORDERS[name]
                case ["comment", "TextureFile", *_]:
                    self.texture_name = text.split(None, 2)[2].strip() if len(words) > 2 else None
                case ["element", name, count] if count.isdecimal() and len(count) < 16:
                    elements.append(_Element(name, int(count), ()))
                case ["property", *rest] if elements:
                    elements[-1] = self._with_property(elements[-1], rest, text)
                case ["ply"] if self.line == 1:
                    pass
                case [] | ["comment" | "obj_info", *_]:
                    pass
                case _:
                    self.fail("header line not understood", "a PLY header", repr(text), self.line)
            self.line += 1
        self.line += 1
        names = [e.name for e in elements]
        for element in elements:
            if names.count(element.name) > 1 or (element.count and not element.properties):
                self.fail("bad element", "one of each name, with properties", element.name)
        if not form:
            known = " or ".join(_BYTE_ORDERS)
            self.fail("no format line", f"format {known} 1.0", "none")
        return elements

    def _with_property(self, element: _Element, words: list[str], text: str) -> _Element:
        match words:
            case ["list", count, kind, name] if count in _NAMED_TYPES and kind in _NAMED_TYPES:
                new = _Property(name, _NAMED_TYPES[kind], _NAMED_TYPES[count])
            case [kind, name] if kind in _NAMED_TYPES:
                new = _Property(name, _NAMED_TYPES[kind])
            case _:
                self.fail("unknown property", "property TYPE NAME", repr(text), self.line)
        if new.count_dtype.startswith("f") or new.name in (p.name for p in element.properties):
            self.fail("bad property", "an integer list length, a new name", repr(text), self.line)
        return _Element(element.name, element.count, (*element.properties, new))

    # -- elements --------------------------------------------------------------------------

    def _plain(self, element: _Element, only: tuple[str, ...]) -> Columns:
        """Columns of an element; those of list properties are left out."""
        if element.has_lists:
            rows = self._records(element)
            keep = [p.name for p in element.properties if not p.count_dtype]
            return {name: np.array([row[name][0] for row in rows], np.float64) for name in keep}
        names = [p.name for p in element.properties]
        kept = [i for i, name in enumerate(names) if not only or name in only]
        if self.byte_order:
            table = self._binary_table(element, [(p.name, p.dtype, 1) for p in element.properties])
            return {names[i]: table[names[i]][:, 0].copy() for i in kept}
        lines = self._lines(element)
        if not kept or not lines:
            self.line += element.count
            return {names[i]: np.zeros(element.count) for i in kept}
        values = self._ascii_table(lines, tuple(kept) if only else None)
        if values is None or values.shape[1] != len(kept):
            self._blame_a_line(element, lines)
        self.line += element.count
        return {names[i]: values[:, column] for column, i in enumerate(kept)}

    def _faces(self, element: _Element) -> tuple[NDArray[np.int64], NDArray[np.float64] | None]:
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

    def _all_triangles(self, element: _Element) -> Columns | None:
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
        for name, length in _TRIANGLE_LISTS.items():
            if f"{name} count" in columns and (columns[f"{name} count"] != length).any():
                return None
        return {
            name: columns[name].astype(np.float64 if name == "texcoord" else np.int64)
            for name in _TRIANGLE_LISTS
            if name in columns
        }

    def _fans(self, element: _Element, index_name: str) -> Columns:
        """Faces one by one: triangles and larger polygons, cut into fans."""
        indices: list[tuple[float, ...]] = []
        uvs: list[tuple[float, ...]] = []
        first_line = self.line
        for i, row in enumerate(self._records(element)):
            corners, uv = row[index_name], row.get("texcoord", ())
            line = None if self.byte_order else first_line + i
            if len(corners) < 3 or not all(
                0 <= c < 2**53 and float(c).is_integer() for c in corners
            ):
                self.fail("not a face", "3 vertex indices or more", str(corners), line)
            if "texcoord" in row and len(uv) != 2 * len(corners):
                self.fail("texcoord does not fit", f"{2 * len(corners)} values", str(uv), line)
            for k in range(1, len(corners) - 1):
                indices.append((corners[0], corners[k], corners[k + 1]))
                uvs.append((*uv[:2], *uv[2 * k : 2 * k + 4]))
        columns: Columns = {index_name: np.array(indices, np.float64).astype(np.int64)}
        if uvs[0]:
            columns["texcoord"] = np.array(uvs, np.float64)
        return columns

    # -- raw data --------------------------------------------------------------------------

    def _binary_table(self, element: _Element, layout: list[tuple[str, str, int]]) -> NDArray[Any]:
        dtype = np.dtype([(name, self.byte_order + kind, (n,)) for name, kind, n in layout])
        size = dtype.itemsize * element.count
        if len(self.data) - self.offset < size:
            self._truncated(element, f"{size} bytes", f"{len(self.data) - self.offset} bytes")
        table = np.frombuffer(self.data, dtype, element.count, self.offset)
        self.offset += size
        return table

    def _lines(self, element: _Element) -> list[str]:
        """The element's lines; the offset moves behind them."""
        # A record is a character and a line end at least: no absurd count gets past here.
        if 2 * element.count > len(self.data) - self.offset + 1:
            self._truncated(element, f"{element.count} lines", "fewer")
        lines = self.data[self.offset :].split(b"\n", element.count)
        if len(lines) < element.count or (len(lines) == element.count and not lines[-1].strip()):
            self._truncated(element, f"{element.count} lines", f"{len(lines)} lines")
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
            table = np.loadtxt(lines, dtype, comments=None, usecols=columns, ndmin=2)
        except (ValueError, OverflowError):
            return None
        return table if len(table) == len(lines) else None

    def _blame_a_line(self, element: _Element, lines: list[str]) -> NoReturn:
        width = len(element.properties)
        for i, text in enumerate(lines):
            with contextlib.suppress(ValueError, OverflowError):
                if len([float(word) for word in text.split()]) == width:
                    continue
            expected = f"{width} numbers: " + " ".join(p.name for p in element.properties)
            self.fail(f"bad {element.name}", expected, repr(text), self.line + i)
        self.fail(f"bad {element.name} table", f"{len(lines)} lines of numbers", "other text")

    def _records(self, element: _Element) -> list[dict[str, tuple[float, ...]]]:
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
                self.fail(f"bad {element.name}", _described(element), repr(text), self.line)
            records.append(record)
            self.line += 1
        return records

    def _binary_record(self, element: _Element) -> dict[str, tuple[float, ...]]:
        record = {}
        for p in element.properties:
            length = 1
            if p.count_dtype:
                length = int(self._take(element, p.count_dtype, 1)[0])
            record[p.name] = tuple(self._take(element, p.dtype, length).tolist())
        return record

    def _take(self, element: _Element, kind: str, count: int) -> NDArray[Any]:
        dtype = np.dtype(self.byte_order + kind)
        if count < 0 or len(self.data) - self.offset < count * dtype.itemsize:
            left = len(self.data) - self.offset
            self._truncated(element, f"{count} more values of a list", f"{left} bytes")
        values = np.frombuffer(self.data, dtype, count, self.offset)
        self.offset += count * dtype.itemsize
        return values

    def _truncated(self, element: _Element, expected: str, got: str) -> NoReturn:
        what = f"the file ends within its {element.count} records of {element.name}"
        self.fail(what, expected, got)


def _split_record(
    element: _Element, values: list[float]
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


def _described(element: _Element) -> str:
    return " ".join(f"n {p.name}..." if p.count_dtype else p.name for p in element.properties)


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
    _write_atomically(path, "\n".join(header).encode("latin-1") + body)


def _binary_rows(columns: Mapping[str, NDArray[Any]], count: int) -> bytes:
    dtype = np.dtype([(n, c.dtype.newbyteorder("<"), c.shape[1:]) for n, c in columns.items()])
    table = np.zeros(count, dtype)
    for name, column in columns.items():
        table[name] = column
    return table.tobytes()


def _ascii_rows(columns: Mapping[str, NDArray[Any]], count: int) -> bytes:
    # tolist of a float32 would print its float64 digits; str of the float32 is the short form.
    parts = [
        np.array([str(x) for x in column.ravel()], object).reshape(count, -1)
        for column in columns.values()
    ]
    rows = np.concatenate(parts, axis=1).tolist() if count else []
    return "".join(" ".join(row) + "\n" for row in rows).encode("ascii")


def _write_atomically(path: Path, data: bytes) -> None:
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.write_bytes(data)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
