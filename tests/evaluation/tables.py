"""Random tables of errors, as small as the laws allow."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from sixd.evaluation.errors_table import ErrorTable, EstimateRows, Groups, TruthRows, all_pairs

# Few distinct values, so that ties of score and of error, and errors on a threshold, are common.
ERRORS_MM = st.sampled_from([0.0, 1.0, 2.0, 5.0, 10.0, 19.0, 20.0, 55.0, np.inf, np.nan])
SCORES = st.sampled_from([0.1, 0.5, 0.5, 0.9])


@st.composite
def error_tables(draw: st.DrawFn, max_groups: int = 5) -> ErrorTable:
    """Groups over two objects and two scenes, with up to four estimates and three truths each."""
    n_groups = draw(st.integers(1, max_groups))
    n_estimates = [draw(st.integers(0, 4)) for _ in range(n_groups)]
    n_truths = [draw(st.integers(0, 3)) for _ in range(n_groups)]
    estimate_group = np.repeat(np.arange(n_groups), n_estimates)
    truth_group = np.repeat(np.arange(n_groups), n_truths)
    score = np.array([draw(SCORES) for _ in estimate_group])
    score = score[np.lexsort((-score, estimate_group))]
    visib = np.array([draw(st.sampled_from([0.05, 0.1, 0.6, 1.0])) for _ in truth_group], float)
    pairs = all_pairs(estimate_group, truth_group, n_groups)
    errors = np.array([draw(ERRORS_MM) for _ in pairs.truth], float)
    counted = visib >= 0.1
    groups = Groups(
        scene_id=np.sort(np.array([draw(st.integers(1, 2)) for _ in range(n_groups)])),
        im_id=np.arange(n_groups),
        obj_id=np.array([draw(st.integers(1, 2)) for _ in range(n_groups)]),
        n_wanted=np.bincount(truth_group[counted], minlength=n_groups),
        diameter_mm=np.full(n_groups, 100.0),
        px_scale=np.ones(n_groups),
    )
    gt_id = np.concatenate([np.arange(n) for n in n_truths]).astype(np.int64)
    return ErrorTable(
        groups,
        EstimateRows(estimate_group, np.arange(len(score)), score),
        TruthRows(truth_group, gt_id, visib, np.ones(len(visib), bool), counted),
        pairs,
        {"mssd_mm": errors, "mspd_px": errors},
    )
