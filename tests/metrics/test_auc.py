import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from sixd.errors import UsageError
from sixd.metrics.reference import auc

errors = hnp.arrays(float, st.integers(1, 30), elements=st.floats(0, 200) | st.just(np.inf))


@given(n=st.integers(1, 50), max_mm=st.floats(1e-3, 1e6))
def test_no_error_at_all_is_one_and_no_estimate_at_all_is_zero(n, max_mm):
    assert auc(np.zeros(n), max_mm) == pytest.approx(1, abs=1e-12)
    assert auc(np.full(n, np.inf), max_mm) == 0


@given(e=errors)
def test_it_lies_between_zero_and_one_and_order_does_not_matter(e):
    assert 0 <= auc(e) <= 1 + 1e-12
    assert auc(e[::-1]) == auc(e)


@given(e=errors, scale=st.floats(0.01, 100))
def test_the_unit_does_not_matter(e, scale):
    # Errors on the largest threshold may round to either side of it.
    e = e[np.abs(e - 100) > 1e-6]
    if len(e):
        assert auc(e * scale, 100 * scale) == pytest.approx(auc(e), abs=1e-9)


@given(e=errors, at=st.integers(0, 29), less=st.floats(0, 200))
def test_a_smaller_error_never_lowers_it(e, at, less):
    better = e.copy()
    better[at % len(e)] = max(0.0, better[at % len(e)] - less) if np.isfinite(e).all() else less
    if better[at % len(e)] <= e[at % len(e)]:
        assert auc(better) >= auc(e) - 1e-12


@given(e=errors)
def test_it_is_the_area_under_the_curve_but_for_one_error(e):
    """The toolbox counts each interval with the accuracy at its end: at most 1 / N too much."""
    at = np.linspace(0, 100, 20_001)
    share = np.searchsorted(np.sort(e), at, side="right") / len(e)
    area = np.trapezoid(share, at) / 100
    assert area - 1e-3 <= auc(e) <= area + 1 / len(e) + 1e-3


def test_a_hand_worked_example():
    """2 of 4 below 100 mm: (0, 20] at 1/4, (20, 60] at 2/4, (60, 100] at 2/4."""
    assert auc(np.array([60, np.inf, 20, 150.0])) == pytest.approx(0.2 / 4 + 0.4 / 2 + 0.4 / 2)


def test_equal_errors_count_with_the_accuracy_of_the_first_as_in_the_toolbox():
    assert auc(np.array([50.0, 50])) == pytest.approx(0.5 / 2 + 0.5)


def test_the_largest_threshold_itself_still_counts():
    assert auc(np.array([100.0])) == 1
    assert auc(np.array([np.nextafter(100, 101)])) == 0


def test_without_targets_there_is_no_number():
    assert np.isnan(auc(np.zeros(0)))


def test_nan_errors_are_misses():
    assert auc(np.array([0, np.nan])) == auc(np.array([0, np.inf]))


@pytest.mark.parametrize("max_mm", [0.0, -1.0, np.nan])
def test_a_senseless_threshold_is_refused(max_mm):
    with pytest.raises(UsageError):
        auc(np.zeros(1), max_mm)
