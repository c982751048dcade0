from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sixd.evaluation.errors_table import ErrorTable
from sixd.evaluation.protocol import EvalProtocol, get_protocol
from sixd.evaluation.scores import RECALL_LEVELS, average_precision, score
from tests.evaluation.tables import error_tables

LOCALIZATION = get_protocol("bop19-localization").with_errors(("mssd", "mspd"))
DETECTION = get_protocol("bop24-detection")
both = pytest.mark.parametrize("protocol", [LOCALIZATION, DETECTION], ids=lambda p: p.name)


@both
@given(table=error_tables())
def test_scores_lie_between_zero_and_one(protocol: EvalProtocol, table: ErrorTable) -> None:
    values = score(table, protocol).values
    assert values
    assert all(0 <= v <= 1 for v in values.values())


@both
@given(table=error_tables())
def test_smaller_errors_never_lower_a_score(protocol: EvalProtocol, table: ErrorTable) -> None:
    # Greedy matching is not monotone when several instances compete, so one instance per group.
    assume((np.bincount(table.truths.group, minlength=1) <= 1).all())
    better = replace(table, errors={k: v / 2 for k, v in table.errors.items()})
    before, after = score(table, protocol).values, score(better, protocol).values
    assert all(after[k] >= before[k] - 1e-12 for k in before)


@given(table=error_tables())
def test_recall_is_found_over_wanted_counted_by_hand(table: ErrorTable) -> None:
    truths = replace(table.truths, matchable=table.truths.counted)
    table = replace(table, truths=truths)
    levels = []
    for threshold in LOCALIZATION.errors[0].thresholds:
        found = set()
        for e in range(len(table.estimates.group)):
            rows = [p for p in np.flatnonzero(table.pairs.estimate == e)
                    if table.truths.counted[table.pairs.truth[p]]
                    and table.pairs.truth[p] not in found
                    and table.errors["mssd_mm"][p] / 100.0 < threshold]  # fmt: skip
            if rows:
                best = min(rows, key=lambda p: (table.errors["mssd_mm"][p], table.pairs.truth[p]))
                found.add(table.pairs.truth[best])
        levels.append(len(found) / max(table.truths.counted.sum(), 1))
    got = score(table, LOCALIZATION).values["AR_mssd"]
    assert got == pytest.approx(np.mean(levels), abs=1e-12)


@both
@given(table=error_tables())
def test_breakdowns_cover_the_whole(protocol: EvalProtocol, table: ErrorTable) -> None:
    scored = score(table, protocol)
    for by in ("object", "scene"):
        columns = scored.breakdowns[by].columns
        assert columns["n_targets"].sum() == table.groups.n_wanted.sum()
        assert columns["n_estimates"].sum() == len(table.estimates.group)
    rows = scored.breakdowns["threshold"].columns
    name = "recall" if protocol is LOCALIZATION else "AP"
    mssd = rows[name][rows["error"] == "mssd"]
    prefix = "AR" if protocol is LOCALIZATION else "AP"
    expected = 0.0 if np.isnan(mssd).all() else mssd.mean()
    assert scored.values[f"{prefix}_mssd"] == pytest.approx(expected, abs=1e-12)
    assert scored.breakdowns["visibility"].columns["n_targets"].sum() == table.truths.counted.sum()


@given(table=error_tables())
def test_recall_of_the_whole_is_the_weighted_mean_of_its_parts(table: ErrorTable) -> None:
    table = replace(table, truths=replace(table.truths, matchable=table.truths.counted))
    scored = score(table, LOCALIZATION)
    for by in ("object", "scene"):
        columns = scored.breakdowns[by].columns
        n = columns["n_targets"]
        parts = np.nan_to_num(columns["AR_mssd"]) @ n / max(n.sum(), 1)
        assert scored.values["AR_mssd"] == pytest.approx(parts, abs=1e-12)


@given(
    rows=st.lists(st.sampled_from(["true", "false", "ignored"]), max_size=12),
    misses=st.integers(0, 5),
)
def test_average_precision_is_its_definition(rows: list[str], misses: int) -> None:
    n_wanted = rows.count("true") + misses
    if not n_wanted:
        return
    kept = [r == "true" for r in rows if r != "ignored"]
    points = [
        (sum(kept[: i + 1]) / n_wanted, sum(kept[: i + 1]) / (i + 1)) for i in range(len(kept))
    ]
    expected = np.mean(
        [max((p for r, p in points if r >= level), default=0.0) for level in RECALL_LEVELS]
    )
    is_true = np.array([[r == "true"] for r in rows], bool).reshape(-1, 1)
    is_ignored = np.array([[r == "ignored"] for r in rows], bool).reshape(-1, 1)
    assert average_precision(is_true, is_ignored, n_wanted)[0] == pytest.approx(expected, abs=1e-15)


@given(table=error_tables())
def test_the_headline_is_left_out_unless_everything_was_measured(table: ErrorTable) -> None:
    whole = score(table, DETECTION).values
    assert whole["AP"] == pytest.approx((whole["AP_mssd"] + whole["AP_mspd"]) / 2)
    without_mm = score(table, DETECTION.with_errors(("mssd", "mspd"))).values
    assert without_mm == {k: v for k, v in whole.items() if k != "AP_mssd_mm"}
    assert set(score(table, DETECTION.with_errors(("mspd",))).values) == {"AP_mspd"}
