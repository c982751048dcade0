"""Opens a results file by what it contains, gzip or not, CSV or JSON, and only so much of it."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Literal, TypeVar

from sixd.errors import FormatError, MissingDataError, Problem
from sixd.results.findings import Findings
from sixd.results.limits import Limits

T = TypeVar("T")
Kind = Literal["pose-csv", "coco-json"]
BLOCK_BYTES = 2 << 20
UTF8_BOM = b"\xef\xbb\xbf"
_GZIP_MAGIC = b"\x1f\x8b"
_BLANK = b" \t\r\n"
_MOST_BLANKS = 1 << 20
_FOREIGN = {
    b"PK\x03\x04": "a zip archive",
    b"\xfd7zXZ\x00": "an xz archive",
    b"BZh": "a bzip2 archive",
    b"\x28\xb5\x2f\xfd": "a zstandard archive",
    _GZIP_MAGIC: "gzip inside gzip",
}
_WIDE_BOMS = (b"\xff\xfe", b"\xfe\xff")


@dataclass(frozen=True)
class ResultsText:
    """The text of a results file, not yet parsed."""

    kind: Kind
    has_bom: bool
    first_byte: int
    """Where the text begins in the inflated file: behind the BOM."""
    blocks: Iterator[bytes]
    """The text without its BOM; raises `FormatError` where the file is truncated or too large."""


def open_results_text(path: str | Path, limits: Limits) -> ResultsText:
    """Look at the beginning of a file and say what it is; its name plays no part.

    Raises:
        MissingDataError: there is no such file, or it may not be read.
        FormatError: it is empty, binary, not UTF-8, truncated or too large.
    """
    blocks = _inflated_blocks(Path(path), limits)
    head = b""
    for block in blocks:
        head += block
        if head.lstrip(_BLANK) and len(head) > len(UTF8_BOM):
            break
        if len(head) > _MOST_BLANKS:
            raise FormatError([_not_text(f"{len(head):,} blank characters at its beginning")])
    _refuse_foreign(head)
    has_bom = head.startswith(UTF8_BOM)
    head = head.removeprefix(UTF8_BOM)
    start = head.lstrip(_BLANK)[:1]
    if not start:
        raise FormatError([_empty_file()])
    kind: Kind = "coco-json" if start in b"[{" else "pose-csv"
    return ResultsText(kind, has_bom, len(UTF8_BOM) * has_bom, chain([head], blocks))


def read_table(
    path: str | Path, limits: Limits | None, parse: Callable[[ResultsText, Findings, Limits], T]
) -> T:
    """Open a file, parse it, and raise all problems at once.

    Raises:
        FormatError: carries every error that was found.
        MissingDataError: there is no such file, or it may not be read.
    """
    limits = limits or Limits()
    found = Findings(str(path), limits.problems)
    try:
        table = parse(open_results_text(path, limits), found, limits)
    except FormatError as error:
        found.stop(error)
        found.raise_errors()
        raise
    found.raise_errors()
    return table


def _refuse_foreign(head: bytes) -> None:
    for magic, name in _FOREIGN.items():
        if head.startswith(magic):
            raise FormatError([_not_text(name)])
    if head.startswith(_WIDE_BOMS):
        raise FormatError(
            [
                Problem(
                    code="encoding",
                    what="the file is UTF-16 or UTF-32",
                    expected="UTF-8",
                    got=f"byte order mark {head[:2].hex(' ')} at byte 0",
                    fix="save the file as UTF-8",
                )
            ]
        )
    if b"\0" in head[:4096]:
        raise FormatError([_not_text(f"binary: byte {head.index(0)} is zero")])


def _inflated_blocks(path: Path, limits: Limits) -> Iterator[bytes]:
    try:
        file = path.open("rb")
    except FileNotFoundError as error:
        raise MissingDataError(f"{path}: there is no such file") from error
    except OSError as error:
        raise MissingDataError(f"{path}: cannot be read: {error.strerror}") from error
    with closing(file):
        first = file.read(BLOCK_BYTES)
        raw = chain([first], iter(lambda: file.read(BLOCK_BYTES), b""))
        blocks = _gunzip(raw, limits) if first.startswith(_GZIP_MAGIC) else raw
        n_bytes = 0
        for block in blocks:
            n_bytes += len(block)
            if n_bytes > limits.inflated_bytes:
                raise FormatError([_too_large(limits)])
            yield block


def _gunzip(compressed: Iterator[bytes], limits: Limits) -> Iterator[bytes]:
    """Inflate block by block; a bomb is refused before its next block is made."""
    n_in = n_out = 0
    inflater = zlib.decompressobj(wbits=31)
    for block in compressed:
        n_in += len(block)
        rest = block
        while rest or not inflater.eof:
            if inflater.eof:  # gzip files may be concatenated, and padded with zeros
                rest = rest.lstrip(b"\0")
                if not rest:
                    break
                inflater = zlib.decompressobj(wbits=31)
            try:
                text = inflater.decompress(rest, BLOCK_BYTES)
            except zlib.error as error:
                raise FormatError([_corrupt_gzip(n_in - len(rest), str(error))]) from error
            rest = inflater.unused_data if inflater.eof else inflater.unconsumed_tail
            n_out += len(text)
            if n_out > max(limits.ratio_floor_bytes, limits.ratio * (n_in - len(rest))):
                raise FormatError([_bomb(limits, n_in, n_out)])
            if text:
                yield text
            elif not rest:
                break
    if not inflater.eof:
        raise FormatError([_truncated_gzip(n_in)])


def _empty_file() -> Problem:
    return Problem(
        code="empty-file",
        what="the file is empty",
        expected="a BOP pose CSV or a COCO results JSON",
        got="no text",
        fix="write the results again; was the writer stopped?",
    )


def _not_text(got: str) -> Problem:
    return Problem(
        code="not-text",
        what="the file is neither text nor gzipped text",
        expected="a BOP pose CSV or a COCO results JSON, plain or gzipped once",
        got=got,
        fix="unpack it, or name the results file itself",
    )


def _too_large(limits: Limits) -> Problem:
    return Problem(
        code="too-large",
        what="the text is longer than a results file may be",
        expected=f"at most {limits.inflated_bytes:,} bytes after inflating",
        got="more",
        fix="split the file, or raise Limits.inflated_bytes",
    )


def _bomb(limits: Limits, n_in: int, n_out: int) -> Problem:
    return Problem(
        code="gzip-ratio",
        what="the gzip inflates like a bomb; it was not read further",
        expected=f"at most {limits.ratio} times its compressed length",
        got=f"{n_out:,} bytes out of at most {n_in:,}",
        fix="write the results again, or raise Limits.ratio",
    )


def _corrupt_gzip(offset: int, reason: str) -> Problem:
    return Problem(
        code="corrupt-gzip",
        what="the gzip is damaged",
        expected="valid gzip data to the end of the file",
        got=f"{reason} (at or after compressed byte {offset})",
        fix="copy or write the file again",
    )


def _truncated_gzip(n_in: int) -> Problem:
    return Problem(
        code="truncated-gzip",
        what="the gzip ends too early",
        expected="an end marker with a checksum",
        got=f"the end of the file after {n_in:,} compressed bytes",
        fix="copy the file again; was the upload or the writer stopped?",
    )
