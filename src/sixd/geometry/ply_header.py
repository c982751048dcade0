"""The header of a PLY file, and the place in the file where reading goes on."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from sixd.errors import FormatError, MissingDataError, Problem

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip
_BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True)
class PlyProperty:
    """One declared property; lists have the type of their length."""

    name: str
    dtype: str
    count_dtype: str = ""


@dataclass(frozen=True)
class PlyElement:
    """One declared element: so many records of these properties."""

    name: str
    count: int
    properties: tuple[PlyProperty, ...]

    @property
    def has_lists(self) -> bool:
        """Whether records differ in length."""
        return any(p.count_dtype for p in self.properties)

    def describe(self) -> str:
        """What a record should look like, for messages."""
        return " ".join(f"n {p.name}..." if p.count_dtype else p.name for p in self.properties)


class PlyFile:
    """The bytes of a PLY file, its header read, at the start of its first element.

    Raises:
        MissingDataError: the file cannot be read.
        FormatError: its header is not that of a PLY file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self.data = path.read_bytes()
        except OSError as error:
            reason = error.strerror or type(error).__name__
            raise MissingDataError(f"mesh {path} cannot be read: {reason}") from error
        self.byte_order = ""
        """``<`` or ``>``; empty for ASCII."""
        self.texture_name: str | None = None
        self.offset = 0
        """Where the next element starts."""
        self.line = 0
        """The line last read, counted from 1; for ASCII files."""
        self._format = ""
        self.elements = self._read_header()

    def fail(self, what: str, expected: str, got: str, line: int | None = None) -> NoReturn:
        """Raise `FormatError` about this file."""
        fix = "export the mesh again as PLY (triangles, ASCII or binary)"
        problem = Problem(
            "bad-ply",
            what,
            file=str(self.path),
            line=line,
            expected=expected,
            got=got[:200],
            fix=fix,
        )
        raise FormatError([problem])

    def fail_truncated(self, element: PlyElement, expected: str, got: str) -> NoReturn:
        """Raise `FormatError`: the file ends too early."""
        what = f"the file ends within its {element.count} records of {element.name}"
        self.fail(what, expected, got)

    def _read_header(self) -> list[PlyElement]:
        if self._next_header_line().split() != ["ply"]:
            self.fail("not a PLY file", "first line: ply", repr(self.data[:20]), 1)
        elements: list[PlyElement] = []
        while (text := self._next_header_line()).split() != ["end_header"]:
            match text.split():
                case ["format", name, "1.0"] if name in _BYTE_ORDERS and not self._format:
                    self._format, self.byte_order = name, _BYTE_ORDERS[name]
                case ["comment", "TextureFile", _, *_]:
                    self.texture_name = text.split(None, 2)[2].strip()
                case ["element", name, count] if count.isdecimal() and len(count) < 16:
                    elements.append(PlyElement(name, int(count), ()))
                case ["property", *words] if elements:
                    elements[-1] = self._with_property(elements[-1], words, text)
                case [] | ["comment" | "obj_info", *_]:
                    pass
                case _:
                    self.fail("header line not understood", "a PLY header", repr(text), self.line)
        self._check_header(elements)
        return elements

    def _next_header_line(self) -> str:
        end = self.data.find(b"\n", self.offset)
        if end < 0:
            what = "the header does not end" if self.line else "not a PLY file"
            self.fail(what, "ply ... end_header", repr(self.data[:20]), self.line or None)
        text = self.data[self.offset : end].decode("latin-1")
        self.offset = end + 1
        self.line += 1
        return text

    def _with_property(self, element: PlyElement, words: list[str], text: str) -> PlyElement:
        match words:
            case ["list", count, kind, name] if count in _TYPES and kind in _TYPES:
                new = PlyProperty(name, _TYPES[kind], _TYPES[count])
            case [kind, name] if kind in _TYPES:
                new = PlyProperty(name, _TYPES[kind])
            case _:
                self.fail("unknown property", "property TYPE NAME", repr(text), self.line)
        if new.count_dtype.startswith("f") or new.name in (p.name for p in element.properties):
            self.fail("bad property", "an integer list length, a new name", repr(text), self.line)
        return PlyElement(element.name, element.count, (*element.properties, new))

    def _check_header(self, elements: list[PlyElement]) -> None:
        names = [element.name for element in elements]
        if not self._format:
            self.fail("no format line", f"format {' or '.join(_BYTE_ORDERS)} 1.0", "none")
        if "vertex" not in names:
            self.fail("no vertices", "an element named vertex", ", ".join(names) or "no elements")
        for element in elements:
            if names.count(element.name) > 1 or (element.count and not element.properties):
                self.fail("bad element", "one of each name, with properties", element.name)
