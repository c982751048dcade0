from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from numpy.typing import NDArray

from sixd.results import Rle
from sixd.results.run_lengths import measure_runs

masks = arrays(
    np.uint8, array_shapes(min_dims=2, max_dims=2, max_side=40), elements=st.integers(0, 1)
)


def runs_of(mask: NDArray[np.uint8]) -> list[int]:
    flat = np.concatenate([[0], mask.ravel(order="F"), [2]])
    edges = np.flatnonzero(np.diff(flat.astype(int)))
    return np.diff([0, *edges.tolist()]).tolist()


def compressed(mask: NDArray[np.uint8]) -> str:
    hotcoco = pytest.importorskip("hotcoco")
    coded = hotcoco.mask.encode(np.asfortranarray(mask))["counts"]
    return coded if isinstance(coded, str) else coded.decode()


@given(st.lists(masks, max_size=5))
def test_strings_and_lists_of_one_mask_measure_the_same(drawn: list[NDArray[np.uint8]]) -> None:
    coded = [Rle(m.shape, compressed(m)) for m in drawn]
    plain = [Rle(m.shape, runs_of(m)) for m in drawn]
    for measured in (measure_runs(coded), measure_runs(plain)):
        assert measured.area.tolist() == [m.sum() for m in drawn]
        assert measured.total.tolist() == [m.size for m in drawn]
        assert (measured.shortest >= 0).all()


@pytest.mark.parametrize(
    "counts",
    ["é", "o", "0~", "  ", "0123o", "PPPPPPPP0", "\x00", "b'04'"],
    ids=[
        "not ascii",
        "ends in a number",
        "above 111",
        "below 48",
        "cut off",
        "too long",
        "zero",
        "repr",
    ],
)
def test_what_is_no_code_is_not_decoded(counts: str) -> None:
    good = Rle((2, 2), "04")
    measured = measure_runs([good, Rle((2, 2), counts), good])
    assert np.isnan(measured.total).tolist() == [False, True, False]
    assert measured.total[[0, 2]].tolist() == [4, 4]


@given(st.lists(st.text(max_size=30) | st.text("0123456789PQo@?Z", max_size=200), max_size=20))
def test_any_string_is_measured_or_refused_alone_as_among_others(texts: list[str]) -> None:
    together = measure_runs([Rle((1, 1), text) for text in texts])
    alone = [measure_runs([Rle((1, 1), text)]) for text in texts]
    for name in ("total", "shortest", "area"):
        one_by_one = [getattr(a, name)[0] for a in alone]
        np.testing.assert_array_equal(getattr(together, name), one_by_one)


def test_negative_runs_are_seen_in_both_forms() -> None:
    # "1N" is 1, then -2 ("N" = 78 - 48 = 30: sign bit and 14, so 30 - 32).
    measured = measure_runs([Rle((1, 1), "1N"), Rle((1, 1), [3, -2])])
    assert (measured.shortest < 0).all()


def test_no_masks_and_empty_masks_measure_nothing() -> None:
    assert measure_runs([]).total.shape == (0,)
    assert measure_runs([Rle((2, 2), ""), Rle((2, 2), [])]).total.tolist() == [0, 0]
