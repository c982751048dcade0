"""Rows that share their ids: in one table, or with rows of another."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Column = NDArray[Any]


def row_codes(*tables: tuple[Column, ...]) -> tuple[Ints, ...]:
    """Number rows so that equal rows, in any of the tables, get equal numbers.

    Args:
        tables: each a tuple of columns ``(N_i,)``; all tables have the same columns. NaN equals
            nothing.

    Returns:
        One ``(N_i,)`` array per table. Numbers go from 0 without gaps, in the order of the first
        column, then the second, and so on.
    """
    columns = [np.concatenate(column) for column in zip(*tables, strict=True)]
    order = np.lexsort(columns[::-1])
    is_new = np.zeros(len(order), bool)
    for column in columns:
        in_order = column[order]
        is_new[1:] |= in_order[1:] != in_order[:-1]
    codes = np.zeros(len(order), np.int64)
    codes[order] = np.cumsum(is_new)
    return tuple(np.split(codes, np.cumsum([len(t[0]) for t in tables])[:-1]))


def first_with_code(codes: Ints, n_codes: int | None = None) -> Ints:
    """``(n_codes,)``: the first row with each of the codes of `row_codes`, -1 where none has it."""
    first = np.full(int(codes.max(initial=-1)) + 1 if n_codes is None else n_codes, -1, np.int64)
    first[codes[::-1]] = np.arange(len(codes))[::-1]
    return first


def find_rows(wanted: tuple[Column, ...], table: tuple[Column, ...]) -> Ints:
    """Index of the first row of ``table`` equal to each row of ``wanted``, -1 where there is none.

    Returns:
        ``(len(wanted),)``.
    """
    wanted_codes, codes = row_codes(wanted, table)
    return first_with_code(codes, len(wanted_codes) + len(codes))[wanted_codes]


def first_of_each(table: tuple[Column, ...]) -> Ints:
    """Indices of the rows that are not repeats of an earlier row, in order."""
    (codes,) = row_codes(table)
    return np.sort(first_with_code(codes))


def rank_in_group(group: Ints, order: Ints) -> Ints:
    """Position of each row among the rows of its group, when rows are visited in ``order``.

    Args:
        group: ``(N,)`` group numbers.
        order: ``(N,)`` a permutation of rows.

    Returns:
        ``(N,)`` ranks from 0.
    """
    by_group = order[np.argsort(group[order], kind="stable")]
    sorted_group = group[by_group]
    is_start = np.ones(len(by_group), bool)
    is_start[1:] = sorted_group[1:] != sorted_group[:-1]
    position = np.arange(len(by_group))
    start = np.maximum.accumulate(np.where(is_start, position, 0))
    ranks = np.zeros(len(group), np.int64)
    ranks[by_group] = position - start
    return ranks


def best_first(score: NDArray[np.float64]) -> Ints:
    """Row order by score, highest first; ties keep their order (as BOP sorts)."""
    return np.argsort(-score, kind="stable").astype(np.int64)


def rows_of_each(key: Ints) -> Iterator[tuple[int, Ints]]:
    """Each value of ``key (N,)``, ascending, with the rows that have it, in order."""
    if not len(key):
        return
    order = np.argsort(key, kind="stable")
    values, first = np.unique(key[order], return_index=True)
    yield from zip(values.tolist(), np.split(order, first[1:]), strict=True)
