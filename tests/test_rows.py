"""Rows are looked up as Python's own tuples are."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sixd.rows import find_rows, first_of_each, rank_in_group, row_codes

ROWS = st.lists(st.tuples(st.integers(-2, 2), st.sampled_from([0, 1, 2**62, -(2**62)])), max_size=9)


def columns(rows: list[tuple[int, int]]) -> tuple[np.ndarray, np.ndarray]:
    table = np.array(rows, np.int64).reshape(-1, 2)
    return table[:, 0], table[:, 1]


@given(ROWS, ROWS)
def test_codes_are_the_ranks_of_distinct_rows(some, other):
    codes = row_codes(columns(some), columns(other))
    ranks = {row: n for n, row in enumerate(sorted({*some, *other}))}
    assert [c.tolist() for c in codes] == [[ranks[r] for r in rows] for rows in (some, other)]


@given(ROWS, ROWS)
def test_the_first_equal_row_is_found(wanted, table):
    found = find_rows(columns(wanted), columns(table))
    assert found.tolist() == [table.index(r) if r in table else -1 for r in wanted]


@given(ROWS)
def test_the_first_of_each_row_is_kept_in_order(rows):
    kept = first_of_each(columns(rows))
    assert [rows[i] for i in kept] == list(dict.fromkeys(rows))
    assert kept.tolist() == sorted(kept.tolist())


def test_nan_equals_nothing():
    (codes,) = row_codes((np.array([1, 1, 1]), np.array([np.nan, 0.0, np.nan])))
    assert len(set(codes.tolist())) == 3


@given(st.lists(st.integers(0, 3), max_size=9), st.randoms(use_true_random=False))
def test_ranks_count_the_rows_of_a_group_before(groups, random):
    order = list(range(len(groups)))
    random.shuffle(order)
    ranks = rank_in_group(np.array(groups, np.int64), np.array(order, np.int64))
    for place, row in enumerate(order):
        assert ranks[row] == sum(groups[r] == groups[row] for r in order[:place])
