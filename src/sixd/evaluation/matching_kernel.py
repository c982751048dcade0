"""The compiled loop of `sixd.evaluation.matching`; apart, since numba costs half a second."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


@njit(nogil=True, cache=True)
def match_greedily(
    first_pair: Ints,
    pair_truth: Ints,
    matchable: NDArray[np.bool_],
    errors: Floats,
    thresholds: Floats,
    taken_at: Ints,
    matched: Ints,
) -> None:
    """Fill ``matched (E, C, L)``, -1 to begin with; see `sixd.evaluation.matching.match`."""
    # A truth belongs to one group, so one pass over all estimates in order serves every group.
    # taken_at holds the number of the pass that took a truth, so it is never cleared.
    n_columns, n_thresholds = errors.shape[1], len(thresholds)
    for column in range(n_columns):
        for level in range(n_thresholds):
            this_pass = column * n_thresholds + level
            for estimate in range(len(first_pair) - 1):
                best, best_error = -1, thresholds[level]
                for pair in range(first_pair[estimate], first_pair[estimate + 1]):
                    truth = pair_truth[pair]
                    is_free = matchable[truth] and taken_at[truth] != this_pass
                    if is_free and errors[pair, column] < best_error:
                        best, best_error = truth, errors[pair, column]
                if best >= 0:
                    taken_at[best] = this_pass
                    matched[estimate, column, level] = best
