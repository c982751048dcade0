"""Rows of one table looked up by the ids they share with rows of another."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]


def row_codes(*tables: tuple[Ints, ...]) -> tuple[Ints, ...]:
    """Number rows so that equal rows, in any of the tables, get equal numbers.

    Args:
        tables: each a tuple of id columns ``(N_i,)``; all tables have the same columns.

    Returns:
        One ``(N_i,)`` array per table.
    """
    lengths = [len(t[0]) for t in tables]
    codes = np.zeros(sum(lengths), np.int64)
    for column in zip(*tables, strict=True):
        values, inverse = np.unique(np.concatenate(column), return_inverse=True)
        # Renumbering after each column keeps the product below N * N, far from overflow.
        _, codes = np.unique(codes * len(values) + inverse, return_inverse=True)
    return tuple(np.split(codes.astype(np.int64), np.cumsum(lengths)[:-1]))


def find_rows(wanted: tuple[Ints, ...], table: tuple[Ints, ...]) -> Ints:
    """Index of the first row of ``table`` equal to each row of ``wanted``, -1 where there is none.

    Returns:
        ``(len(wanted),)``.
    """
    wanted_codes, codes = row_codes(wanted, table)
    first = np.full(len(codes) + len(wanted_codes) + 1, -1, np.int64)
    first[codes[::-1]] = np.arange(len(codes))[::-1]
    return first[wanted_codes]


def first_of_each(table: tuple[Ints, ...]) -> Ints:
    """Indices of the rows that are not repeats of an earlier row, in order."""
    (codes,) = row_codes(table)
    _, first = np.unique(codes, return_index=True)
    return np.sort(first).astype(np.int64)


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
