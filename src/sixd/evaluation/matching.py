"""Greedy matching of estimates to instances (BOP rules 7).

Within a group, estimates are visited best score first; each takes the instance with the smallest
error among those that are still free, matchable and strictly below the threshold. Equal errors
go to the lowest gt_id. Every threshold (and every VSD tau) is matched on its own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sixd.evaluation.errors_table import ErrorTable

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

FREE = -1


def match(table: ErrorTable, errors: Floats, thresholds: Floats) -> Ints:
    """Match at every threshold.

    Args:
        table: groups, estimates, truths and pairs.
        errors: ``(P, C)`` errors of the pairs, C independent columns (taus).
        thresholds: ``(L,)`` in the unit of the errors.

    Returns:
        ``(E, C, L)`` row of the matched truth, or -1. NaN and infinity never match.
    """
    from sixd.evaluation.matching_kernel import match_greedily

    n_estimates, n_truths = len(table.estimates.group), len(table.truths.group)
    n_pairs = np.bincount(table.pairs.estimate, minlength=n_estimates)
    first_pair = np.concatenate([[0], np.cumsum(n_pairs)]).astype(np.int64)
    matched = np.full((n_estimates, errors.shape[1], len(thresholds)), FREE, np.int64)
    match_greedily(
        first_pair,
        table.pairs.truth,
        table.truths.matchable,
        np.ascontiguousarray(errors),
        np.ascontiguousarray(thresholds),
        np.full(n_truths, FREE, np.int64),
        matched,
    )
    return matched
