"""Uncompressed COCO run lengths: column by column, the first run counts background."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from sixd.errors import FormatError, Problem

MAX_PIXELS = 2**28
"""More than any camera has: what claims to be larger is not allocated."""


class Rle(TypedDict):
    """A mask in COCO's JSON form."""

    counts: list[int]
    size: list[int]
    """Height, width."""


def encode_rle(mask: NDArray[np.bool_]) -> Rle:
    """Run lengths of a mask ``(H, W)``; a mask that holds pixel (0, 0) begins with a run of 0."""
    flat = np.asarray(mask, dtype=bool).reshape(-1, order="F")
    borders = np.flatnonzero(np.diff(flat)) + 1
    starts = np.concatenate([[0], borders, [flat.size]])
    runs = np.diff(starts).tolist()
    if flat.size and flat[0]:
        runs.insert(0, 0)
    return {"counts": runs, "size": [int(mask.shape[0]), int(mask.shape[1])]}


def decode_rle(rle: Mapping[str, object]) -> NDArray[np.bool_]:
    """The mask ``(H, W)`` of uncompressed run lengths.

    Raises:
        FormatError: negative or missing numbers, or runs that do not fill the image.
    """
    size, counts = rle.get("size"), rle.get("counts")
    if not _naturals(size) or len(size) != 2:  # type: ignore[arg-type]
        raise _bad("size", "[height, width]", size)
    if not _naturals(counts):
        raise _bad("counts", "a list of run lengths of at least 0", counts)
    runs = np.asarray(counts, dtype=np.int64)
    height, width = np.asarray(size).tolist()
    if height * width > MAX_PIXELS:
        raise _bad("size", f"an image of at most {MAX_PIXELS} pixels", size)
    if runs.sum() != height * width:
        raise _bad("counts", f"runs that sum to {height} x {width}", int(runs.sum()))
    values = np.arange(len(runs)) % 2 == 1
    return np.repeat(values, runs).reshape(height, width, order="F")


def _naturals(values: object) -> bool:
    return isinstance(values, list) and all(type(v) is int and 0 <= v < 2**40 for v in values)


def _bad(field: str, expected: str, got: object) -> FormatError:
    return FormatError(
        [
            Problem(
                "bad-rle",
                "not a run-length encoded mask",
                field=field,
                expected=expected,
                got=repr(got)[:120],
            )
        ]
    )
