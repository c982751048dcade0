"""Cuts a stream of bytes into blocks of whole lines that know their place in the file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class LineBlock:
    """Some lines of a file; each ends with a newline, also the last of the file."""

    text: bytes
    first_line: int
    """Counted from 1."""
    first_byte: int
    """Place in the (inflated) file, counted from 0."""

    def split(self) -> Iterator[tuple[int, int, bytes]]:
        """``(line, byte, text)`` of every line, without its line end."""
        byte = self.first_byte
        for line, text in enumerate(self.text[:-1].split(b"\n"), start=self.first_line):
            yield line, byte, text.removesuffix(b"\r")
            byte += len(text) + 1

    def after(self, n_bytes: int) -> LineBlock:
        """The lines that begin ``n_bytes`` into the block."""
        n_lines = self.text.count(b"\n", 0, n_bytes)
        return LineBlock(self.text[n_bytes:], self.first_line + n_lines, self.first_byte + n_bytes)


def line_blocks(pieces: Iterable[bytes], first_byte: int, longest: int) -> Iterator[LineBlock]:
    """Cut behind newlines.

    A line longer than ``longest`` bytes is never held in memory: its first ``longest + 1`` bytes
    come as a line of their own, so that the reader can tell, and the rest is passed over.
    """
    line, byte, begun, overlong = 1, first_byte, b"", False
    for piece in pieces:
        if overlong:
            end = piece.find(b"\n") + 1
            byte += end or len(piece)
            if not end:
                continue
            piece, overlong = piece[end:], False
        begun += piece
        end = begun.rfind(b"\n") + 1
        if end:
            yield LineBlock(begun[:end], line, byte)
            line += begun.count(b"\n")
            byte += end
            begun = begun[end:]
        if len(begun) > longest:
            yield LineBlock(begun[: longest + 1] + b"\n", line, byte)
            line += 1
            byte += len(begun)
            begun, overlong = b"", True
    if begun:
        yield LineBlock(begun + b"\n", line, byte)
