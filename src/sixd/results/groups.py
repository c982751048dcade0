"""Rows of a table that share their ids."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Column = NDArray[Any]


def group_rows(*columns: Column) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Put rows together that are equal in all columns; NaN equals nothing.

    Returns:
        ``(G,)`` first row of each group, and ``(N,)`` group of each row.
    """
    order = np.lexsort(columns[::-1])  # stable: the first of a group is the first in the file
    starts = np.zeros(len(order), bool)
    starts[:1] = True
    for column in columns:
        in_order = column[order]
        starts[1:] |= in_order[1:] != in_order[:-1]
    group = np.zeros(len(order), np.intp)
    group[order] = np.cumsum(starts) - 1
    return order[starts], group


def is_in(rows: tuple[Column, ...], table: tuple[Column, ...]) -> NDArray[np.bool_]:
    """``(N,)``: which rows occur in another table."""
    n = len(rows[0])
    first, group = group_rows(*(np.concatenate(pair) for pair in zip(rows, table, strict=True)))
    occurs = np.zeros(len(first), bool)
    occurs[group[n:]] = True
    return occurs[group[:n]]


def rows_of_groups(group: NDArray[np.intp], wanted: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Rows of each wanted group, in order."""
    order = np.argsort(group, kind="stable")
    ends = np.cumsum(np.bincount(group, minlength=wanted.max(initial=-1) + 1))
    starts = np.concatenate([[0], ends[:-1]])
    return [order[starts[g] : ends[g]] for g in wanted]
