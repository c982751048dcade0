from __future__ import annotations

import gzip
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sixd.errors import FormatError, MissingDataError, UsageError
from sixd.results import Limits, PoseEstimates, read_pose_csv, write_pose_csv
from sixd.results.findings import Findings
from sixd.results.lines import LineBlock
from sixd.results.pose_csv import _read_rows_fast
from sixd.results.pose_csv_rows import read_rows_slowly
from tests.results.makers import (
    HEADER,
    ROW,
    bits,
    csv_file,
    pose_tables,
    random_rotations,
    row_with,
)


@given(pose_tables())
def test_what_is_written_is_read_bit_for_bit(
    tmp_path_factory: pytest.TempPathFactory, table: PoseEstimates
) -> None:
    path = tmp_path_factory.mktemp("csv") / "any name at all"
    write_pose_csv(path, table)
    assert bits(read_pose_csv(path)) == bits(table)


def test_a_name_that_ends_in_gz_is_compressed_and_read_under_any_other(tmp_path: Path) -> None:
    table = _some_estimates(50)
    write_pose_csv(tmp_path / "x.csv.gz", table)
    packed = (tmp_path / "x.csv.gz").read_bytes()
    assert packed[:2] == b"\x1f\x8b"
    other = tmp_path / "renamed.txt"
    other.write_bytes(packed)
    assert bits(read_pose_csv(other)) == bits(table)


def test_equal_results_are_equal_bytes(tmp_path: Path) -> None:
    for name in ("a.csv.gz", "b.csv.gz"):
        write_pose_csv(tmp_path / name, _some_estimates(5))
    assert (tmp_path / "a.csv.gz").read_bytes() == (tmp_path / "b.csv.gz").read_bytes()


def test_numbers_are_written_with_the_fewest_digits(tmp_path: Path) -> None:
    table = read_pose_csv(csv_file(tmp_path / "x.csv", row_with(score="0.100000000000000005551")))
    write_pose_csv(tmp_path / "y.csv", table)
    assert (tmp_path / "y.csv").read_text().splitlines()[1].split(",")[3] == "0.1"


@pytest.mark.parametrize(
    ("name", "value"),
    [("score", math.nan), ("R", math.inf), ("t_mm", math.nan), ("time_s", math.inf)],
)
def test_a_file_that_cannot_be_written_whole_is_not_written(
    tmp_path: Path, name: str, value: float
) -> None:
    table = _some_estimates(3)
    getattr(table, name)[1] = value
    (tmp_path / "x.csv").write_text("what was there")
    with pytest.raises(UsageError, match=f"{name} is not finite in 1 rows, first in row 1"):
        write_pose_csv(tmp_path / "x.csv", table)
    assert [p.name for p in tmp_path.iterdir()] == ["x.csv"]
    assert (tmp_path / "x.csv").read_text() == "what was there"


def test_line_numbers_are_those_of_the_file(tmp_path: Path) -> None:
    path = csv_file(tmp_path / "x.csv", ROW, "", ROW, header="")
    assert read_pose_csv(path).line.tolist() == [2, 4]  # type: ignore[union-attr]


def test_a_header_is_optional(tmp_path: Path) -> None:
    bare = tmp_path / "bare.csv"
    bare.write_text(ROW)  # no newline at the end either
    with_header = csv_file(tmp_path / "x.csv", ROW)
    assert bits(read_pose_csv(bare)) == bits(read_pose_csv(with_header))


def test_there_is_one_header_at_most(tmp_path: Path) -> None:
    path = csv_file(tmp_path / "x.csv", HEADER, ROW)
    with pytest.raises(FormatError) as caught:
        read_pose_csv(path)
    assert [(p.line, p.code) for p in caught.value.problems] == [(2, "repeated-header")]


def test_missing_times_are_nan(tmp_path: Path) -> None:
    rows = [row_with(time=time) for time in ("-1", "-1.0", "-0.5", "0", "-0.0")]
    table = read_pose_csv(csv_file(tmp_path / "x.csv", *rows))
    assert np.isnan(table.time_s).tolist() == [True, True, True, False, False]


@pytest.mark.parametrize("big", [2**53 + 1, 2**63 - 1])
def test_large_ids_are_not_rounded(tmp_path: Path, big: int) -> None:
    assert read_pose_csv(csv_file(tmp_path / "x", row_with(im_id=str(big)))).im_id[0] == big


def test_all_problems_are_raised_at_once(tmp_path: Path) -> None:
    path = csv_file(
        tmp_path / "x.csv", "1,2", row_with(score="nan", im_id="x"), ROW, row_with(t="1 2")
    )
    with pytest.raises(FormatError) as caught:
        read_pose_csv(path)
    found = [(p.line, p.field, p.code) for p in caught.value.problems]
    assert found == [
        (2, "", "column-count"),
        (3, "im_id", "not-an-integer"),
        (3, "score", "not-finite"),
        (5, "t", "number-count"),
    ]
    assert all(p.file == str(path) for p in caught.value.problems)


def test_of_very_many_problems_the_number_is_raised_too(tmp_path: Path) -> None:
    path = csv_file(tmp_path / "x.csv", *["1,2"] * 30)
    with pytest.raises(FormatError) as caught:
        read_pose_csv(path, limits=Limits(problems=10))
    assert len(caught.value.problems) == 11
    assert caught.value.problems[-1].code == "more-problems"
    assert "20 more" in caught.value.problems[-1].what


def test_a_missing_file_is_told_by_its_path(tmp_path: Path) -> None:
    with pytest.raises(MissingDataError, match=r"none\.csv"):
        read_pose_csv(tmp_path / "none.csv")
    with pytest.raises(MissingDataError, match="directory"):
        read_pose_csv(tmp_path)


def test_json_is_not_taken_for_a_csv(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text("[]")
    with pytest.raises(FormatError, match="read_results"):
        read_pose_csv(path)


# --- fast accepts, slow explains: both must mean the same format ---

numbers = st.one_of(
    st.sampled_from(
        [
            *("0", "-0", "-0.0", "-0e0", "+1", ".5", "5.", "1e400", "-1e400", "1e-400", "1_0"),
            *("nan", "inf", "-Infinity", "", " ", "1 2", "1e5", "1E+05", "1e", "--1", "1-", "007"),
            *("9007199254740993", "9223372036854775807", "9223372036854775808", "1.0", "\u0661"),
            *("1\r", "\t1", "1\x0b", "1\x00", "[1]", "true", "null", "'1'", "0x10"),
            *("1" * 401, "0." + "3" * 398),
        ]
    ),
    st.integers(-(2**64), 2**64).map(str),
    st.floats().map(repr),
    st.decimals(allow_nan=False, allow_infinity=False).map(str),
    st.text("0123456789.eE+-", max_size=8),
)


@st.composite
def csv_texts(draw: st.DrawFn) -> str:
    """Rows that are nearly right, in which one or two tokens are anything."""
    lines = []
    for _ in range(draw(st.integers(0, 3))):
        tokens = ROW.replace(",", " ").split()
        for _ in range(draw(st.integers(0, 2))):
            tokens[draw(st.integers(0, 16))] = draw(numbers)
        separators = [*",,,,        ,  ,", ""]
        if draw(st.integers(0, 9)) == 0:
            separators[draw(st.integers(0, 15))] = draw(
                st.sampled_from([",", " ", "  ", ";", "\t"])
            )
        lines.append("".join(map("".join, zip(tokens, separators, strict=True))))
    end = draw(st.sampled_from(["\n", "\n", "\r\n", "\n\n", "\r"]))
    return end.join(lines).rstrip("\n") + end.rstrip("\n") + "\n"


@given(csv_texts())
@example(ROW.replace("700", "-0") + "\n")
@example(ROW.replace("0.25", "-0") + "\n")
@example(row_with(im_id="1e2") + "\n")
@example(row_with(im_id="1.0") + "\n")
@example(row_with(R="1\t0 0 0 1 0 0 0 1") + "\n")
def test_what_the_fast_reader_takes_the_slow_one_takes_with_the_same_bits(text: str) -> None:
    block = LineBlock(text.encode(), 2, 0)
    fast = _read_rows_fast(block)
    found = Findings("x", 100)
    slow = read_rows_slowly(block, found, 1 << 16)
    if fast is None:
        return
    assert found.problems() == ()
    assert fast.ids.tobytes() == slow.ids.tobytes()
    assert fast.numbers.tobytes() == slow.numbers.tobytes()
    assert fast.line.tobytes() == slow.line.tobytes()


@given(csv_texts())
def test_a_row_is_lost_only_if_a_problem_says_so(text: str) -> None:
    found = Findings("x", 1000)
    rows = read_rows_slowly(LineBlock(text.encode(), 2, 0), found, 1 << 16)
    n_lines = sum(bool(line.strip()) for line in text.split("\n"))
    told = {p.line for p in found.problems() if p.severity == "error"}
    assert len(rows.line) >= n_lines - len(told)
    assert np.isfinite(rows.numbers[~np.isin(rows.line, list(told))]).all()


@pytest.mark.parametrize(
    "token",
    ["+1", ".5", "5.", "007", "1E+05", "1e-400", "  1", "1  ", "-0", "\t1", "0." + "3" * 398],
)
def test_unusual_but_clear_numbers_are_taken(tmp_path: Path, token: str) -> None:
    table = read_pose_csv(csv_file(tmp_path / "x.csv", row_with(score=token)))
    assert table.score.tobytes() == np.float64(float(token)).tobytes()


@pytest.mark.parametrize(
    "token",
    [
        "1_0",
        "0x10",
        "1e400",
        "nan",
        "inf",
        "-Infinity",
        "\u0661",
        "1 2",
        "",
        '"1"',
        "1e",
        "1" * 401,
    ],
)
def test_what_is_no_plain_finite_decimal_is_refused(tmp_path: Path, token: str) -> None:
    with pytest.raises(FormatError) as caught:
        read_pose_csv(csv_file(tmp_path / "x.csv", row_with(score=token)))
    (problem,) = caught.value.problems
    assert (problem.line, problem.field) == (2, "score")
    assert problem.expected
    assert problem.got
    assert problem.fix


def test_one_bad_row_among_many_is_found_and_the_others_are_read(tmp_path: Path) -> None:
    rows = [row_with(im_id=str(i)) for i in range(5000)]
    rows[3210] = row_with(im_id="3210", t="1 2 nan")
    path = csv_file(tmp_path / "x.csv", *rows)
    with pytest.raises(FormatError) as caught:
        read_pose_csv(path)
    (problem,) = caught.value.problems
    assert (problem.line, problem.got) == (3212, "nan")


@pytest.mark.parametrize("block_bytes", [7, 100, 1000])
def test_where_blocks_are_cut_does_not_matter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block_bytes: int
) -> None:
    table = _some_estimates(40)
    write_pose_csv(tmp_path / "x.csv", table)
    text = (tmp_path / "x.csv").read_bytes().replace(b"\n", b"\r\n")
    (tmp_path / "x.csv").write_bytes(gzip.compress(text))
    monkeypatch.setattr("sixd.results.results_text.BLOCK_BYTES", block_bytes)
    read = read_pose_csv(tmp_path / "x.csv")
    assert bits(read) == bits(table)
    assert read.line.tolist() == list(range(2, 42))  # type: ignore[union-attr]


def test_the_header_is_no_row() -> None:
    block = LineBlock(f"{HEADER}\n{ROW}\n".encode(), 1, 0)
    fast = _read_rows_fast(block)
    assert fast is not None
    assert fast.line.tolist() == [2]


def _some_estimates(n: int) -> PoseEstimates:
    rng = np.random.default_rng(1)
    return PoseEstimates.from_arrays(
        scene_id=1,
        im_id=np.arange(n) // 3,
        obj_id=rng.integers(1, 9, n),
        score=rng.random(n),
        R=random_rotations(n),
        t_mm=rng.normal(size=(n, 3)) * 100 + [0, 0, 900],
        time_s=0.125,
    )
