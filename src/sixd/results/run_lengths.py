"""Run-length coded masks of COCO: are they masks at all? Many at once, nothing is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sixd.results.tables import Rle

_CHARS_AT_ONCE = 1 << 16
_LONGEST_NUMBER = 6
"""Characters of one compressed number: 30 bits, more than any image has pixels."""


@dataclass(frozen=True)
class RunLengths:
    """What the run lengths of each mask add up to; columns ``(N,)``."""

    total: NDArray[np.float64]
    """Sum of the runs: height times width, if the mask is one. NaN: cannot be decoded."""
    shortest: NDArray[np.float64]
    """The smallest run; negative in no mask."""
    area: NDArray[np.float64]
    """Pixels of the mask: every second run."""


def measure_runs(masks: Sequence[Rle]) -> RunLengths:
    """Add up the runs of masks whose counts are strings or lists."""
    measured = np.full((3, len(masks)), np.nan)
    coded = [i for i, mask in enumerate(masks) if isinstance(mask.counts, str)]
    for rows in _batches(coded, masks):
        texts = [str(masks[i].counts) for i in rows]
        measured[:, rows] = _measure_strings(texts)
    for i, mask in enumerate(masks):
        if isinstance(mask.counts, list):
            runs = mask.counts
            measured[:, i] = sum(runs), min(runs, default=0), sum(runs[1::2])
    return RunLengths(*measured)


def _batches(rows: list[int], masks: Sequence[Rle]) -> list[list[int]]:
    """Rows in groups of some 65,000 characters, so that the arrays stay in the cache."""
    batches: list[list[int]] = []
    n_chars = _CHARS_AT_ONCE
    for i in rows:
        if n_chars >= _CHARS_AT_ONCE:
            batches.append([])
            n_chars = 0
        batches[-1].append(i)
        n_chars += len(masks[i].counts)
    return batches


def _measure_strings(texts: list[str]) -> NDArray[np.float64]:
    """``(3, N)``: total, shortest, area of compressed counts.

    COCO's coding (maskApi.c, ``rleToString``): each number is cut into groups of five bits, the
    lowest first, one character (code 48 + value) each; bit 32 says that another follows, bit 16 of
    the last one is the sign. From the fourth number on, the difference to the number two before
    is stored.
    """
    length = np.array([len(text) for text in texts])
    end = np.cumsum(length)
    chars = np.frombuffer("".join(texts).encode("ascii", "replace"), np.uint8) - np.uint8(48)
    bad = np.array([not text.isascii() for text in texts])
    bad[np.searchsorted(end, np.flatnonzero(chars > 63), side="right")] = True

    is_last = (chars & 32) == 0
    ends = end[length > 0] - 1
    bad[length > 0] |= ~is_last[ends]  # ends within a number
    is_last[ends] = True
    last = np.flatnonzero(is_last)
    stored, too_long = _stored_numbers(chars, last)
    bad[np.searchsorted(end, last[too_long], side="right")] = True

    n_numbers = np.diff(np.searchsorted(last, end), prepend=0)
    measured = _sum_up(stored, n_numbers)
    measured[:, bad] = np.nan
    return measured


def _stored_numbers(
    chars: NDArray[np.uint8], last: NDArray[np.intp]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Numbers from their groups of bits, and which have too many; ``last``: where each ends."""
    first = np.concatenate([[0], last[:-1] + 1])[: len(last)]
    n_groups = last - first + 1
    stored = (chars[first] & 31).astype(np.int64)
    longer = np.arange(len(first))
    for place in range(1, _LONGEST_NUMBER):
        longer = longer[n_groups[longer] > place]
        stored[longer] += (chars[first[longer] + place] & 31).astype(np.int64) << (5 * place)
    negative = np.flatnonzero(chars[last] & 16)
    stored[negative] -= 1 << (5 * np.minimum(n_groups[negative], _LONGEST_NUMBER))
    return stored, n_groups > _LONGEST_NUMBER


def _sum_up(stored: NDArray[np.int64], n_numbers: NDArray[np.intp]) -> NDArray[np.float64]:
    """``(3, N)``: total, shortest, area, when the differences are undone."""
    n_pairs = (n_numbers + 1) // 2
    pair_end = np.cumsum(n_pairs)
    odd_end = pair_end[n_numbers % 2 == 1] * 2 - 1  # a mask with an odd count is filled with 0
    pairs = np.zeros(2 * n_pairs.sum(), np.int64)
    is_real = np.ones(len(pairs), bool)
    is_real[odd_end] = False
    pairs[is_real] = stored
    pairs = pairs.reshape(-1, 2)  # background, mask
    some = n_pairs > 0
    begin = (pair_end - n_pairs)[some]

    summed = np.cumsum(pairs, axis=0)
    before = summed[begin] - pairs[begin]
    before[:, 0] = summed[begin, 0]  # the first number starts no chain of differences
    runs = summed - np.repeat(before, n_pairs[some], axis=0)
    runs[begin, 0] = pairs[begin, 0]
    runs = np.where(is_real.reshape(-1, 2), runs, 0).astype(np.float64)
    measured = np.zeros((3, len(n_numbers)))
    if len(begin):
        background, mask = np.add.reduceat(runs, begin, axis=0).T
        shortest = np.minimum.reduceat(runs, begin, axis=0).min(axis=1)
        measured[:, some] = background + mask, shortest, mask
    return measured
