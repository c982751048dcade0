from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given

from sixd.evaluation.errors_table import ErrorTable, TruthRows
from sixd.evaluation.matching import match
from tests.evaluation.tables import error_tables

THRESHOLDS = np.array([2.0, 20.0, np.inf])


def match_by_hand(table: ErrorTable, errors: np.ndarray, threshold: float) -> list[int]:
    """The rule in the words of the benchmark, one estimate at a time."""
    taken: set[int] = set()
    matched = []
    for estimate in range(len(table.estimates.group)):
        pairs = np.flatnonzero(table.pairs.estimate == estimate)
        free = [
            (errors[p], table.truths.gt_id[table.pairs.truth[p]], table.pairs.truth[p])
            for p in pairs
            if table.truths.matchable[table.pairs.truth[p]]
            and table.pairs.truth[p] not in taken
            and errors[p] < threshold
        ]
        best = min(free)[2] if free else -1
        taken.add(int(best))
        matched.append(int(best))
    return matched


@given(table=error_tables())
def test_matching_is_the_rule_done_by_hand(table: ErrorTable) -> None:
    errors = table.errors["mssd_mm"]
    got = match(table, errors[:, None], THRESHOLDS)
    for level, threshold in enumerate(THRESHOLDS):
        assert got[:, 0, level].tolist() == match_by_hand(table, errors, threshold)


@given(table=error_tables())
def test_no_instance_is_found_twice_and_only_below_the_threshold(table: ErrorTable) -> None:
    errors = table.errors["mssd_mm"]
    got = match(table, errors[:, None], THRESHOLDS)
    for level, threshold in enumerate(THRESHOLDS):
        found = got[:, 0, level]
        assert len(np.unique(found[found >= 0])) == (found >= 0).sum()
        for estimate in np.flatnonzero(found >= 0):
            chosen = (table.pairs.estimate == estimate) & (table.pairs.truth == found[estimate])
            assert errors[chosen] < threshold


@given(table=error_tables())
def test_an_unmatchable_instance_is_never_found(table: ErrorTable) -> None:
    none = np.zeros(len(table.truths.group), bool)
    closed: TruthRows = replace(table.truths, matchable=none)
    got = match(replace(table, truths=closed), table.errors["mssd_mm"][:, None], THRESHOLDS)
    assert (got == -1).all()


@given(table=error_tables())
def test_columns_do_not_disturb_each_other(table: ErrorTable) -> None:
    errors = table.errors["mssd_mm"]
    both = match(table, np.stack([errors, errors[::-1]], axis=1), THRESHOLDS)
    alone = match(table, errors[:, None], THRESHOLDS)
    np.testing.assert_array_equal(both[:, :1], alone)
