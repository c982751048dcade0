from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import sixd.results
from sixd.datasets.dataset import Dataset
from sixd.results import (
    CheckReport,
    Detections,
    Limits,
    PoseEstimates,
    check_file,
    check_table,
)
from sixd.results.lint_poses import determinant, orthogonality_error
from tests.results.lint_cases import (
    ALL_TARGETS,
    CASES,
    DETECTION,
    LOCALIZATION,
    ROTATED_2,
    Case,
    rle,
)
from tests.results.makers import ROW, csv_file, random_rotations, row_with


def written(path: Path, text: str | bytes | list[Any]) -> Path:
    if isinstance(text, list):
        text = json.dumps(text)
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.code)
def test_every_problem_is_told_with_its_place_and_remedy(
    tmp_path: Path, toy: Dataset, case: Case
) -> None:
    report = check_file(
        written(tmp_path / "x", case.text), toy if case.dataset else None, case.rules
    )
    (problem,) = [p for p in report.problems if p.code == case.code]
    assert (problem.line, problem.field) == (case.line, case.field)
    assert case.expected in problem.expected
    assert case.got in problem.got
    assert case.fix in problem.fix
    assert problem.severity == case.severity
    assert problem.expected
    assert problem.got
    assert problem.fix
    assert problem.file == str(tmp_path / "x")
    assert report.ok == (case.severity == "warning" and not report.counts["error"])
    others = {p.code for p in report.problems if p.severity == "error"} - {case.code}
    assert not others, "one mistake, one error"
    assert not check_file(tmp_path / "x", toy if case.dataset else None, case.rules, strict=True).ok


def test_every_problem_the_room_knows_has_a_test() -> None:
    folder = Path(sixd.results.__file__).parent
    source = "\n".join(path.read_text() for path in folder.glob("*.py"))
    codes = set(re.findall(r'"([a-z]+(?:-[a-z0-9]+)+)"', source)) | {"bom", "crlf", "duplicate"}
    codes -= {"pose-csv", "coco-json"}
    tests = "\n".join(path.read_text() for path in Path(__file__).parent.glob("*.py"))
    assert {code for code in codes if f'"{code}"' not in tests} == set()
    assert len(codes) > 45


def test_a_good_file_has_no_problems(tmp_path: Path, toy: Dataset) -> None:
    path = csv_file(tmp_path / "x.csv", *ALL_TARGETS)
    for rules in (LOCALIZATION, DETECTION):
        report = check_file(path, toy, rules, strict=True)
        assert report.problems == ()
        assert report.ok
        assert (report.kind, report.n_rows, report.n_images) == ("pose-csv", 3, 2)
        assert isinstance(report.table, PoseEstimates)


def test_all_problems_of_a_file_are_found_at_once(tmp_path: Path) -> None:
    bad = [
        row_with(score="nan", R=ROTATED_2, t="0 0 -9e2"),
        row_with(obj_id="x", t="1 2"),
        row_with(im_id="-1"),
    ]
    report = check_file(csv_file(tmp_path / "x.csv", *bad))
    assert [(p.line, p.code) for p in report.problems] == [
        (2, "not-finite"),
        (2, "not-a-rotation"),
        (2, "behind-camera"),
        (3, "not-an-integer"),
        (3, "number-count"),
        (4, "negative-id"),
    ]
    assert report.table is None


def test_what_is_over_the_bound_is_counted(tmp_path: Path) -> None:
    path = csv_file(tmp_path / "x.csv", *[row_with(im_id=f"-{i + 1}") for i in range(50)])
    report = check_file(path, limits=Limits(problems=7))
    assert len(report.problems) == 7
    assert report.omitted == {"negative-id": 43}
    assert report.counts["error"] == 50


def test_missing_targets_are_not_told_of_a_file_that_was_not_read_to_its_end(
    tmp_path: Path, toy: Dataset
) -> None:
    path = csv_file(tmp_path / "x.csv", *[ROW] * 20)
    report = check_file(path, toy, LOCALIZATION, limits=Limits(rows=10))
    assert "too-many-rows" in [p.code for p in report.problems]
    assert "missing-targets" not in [p.code for p in report.problems]


def test_a_row_with_readable_ids_is_not_a_missing_target(tmp_path: Path, toy: Dataset) -> None:
    path = csv_file(tmp_path / "x.csv", row_with(score="nan"), *ALL_TARGETS[1:])
    assert [p.code for p in check_file(path, toy, LOCALIZATION).problems] == ["not-finite"]


def test_ties_at_the_cap_are_told(tmp_path: Path, toy: Dataset) -> None:
    path = csv_file(tmp_path / "x.csv", *[row_with(t=f"0 0 {900 - i}") for i in range(4)])
    report = check_file(path, toy, DETECTION)
    (problem,) = [p for p in report.problems if p.code == "over-cap"]
    assert "order in the file" in problem.got
    assert "at most 3" in problem.expected  # the dataset's own cap


def test_of_two_boxes_that_differ_in_their_mask_none_is_a_duplicate(tmp_path: Path) -> None:
    entries = [rle([3072]) | {"bbox": [0, 0, 9, 9]}, rle([0, 3072]) | {"bbox": [0, 0, 9, 9]}]
    assert check_file(written(tmp_path / "x", entries)).problems == ()


def test_results_in_memory_name_rows(toy: Dataset) -> None:
    R = random_rotations(3)
    R[1] *= 1.5
    table = PoseEstimates.from_arrays(
        scene_id=2, im_id=3, obj_id=[5, 6, 9], score=1, R=R, t_mm=[[0, 0, 500]] * 3, time_s=1
    )
    report = check_table(table, toy)
    assert [(p.field, p.line) for p in report.problems] == [
        ("R (row 1, counted from 0)", None),
        ("obj_id (row 2, counted from 0)", None),
    ]
    boxes = Detections.from_arrays(scene_id=2, im_id=3, obj_id=[-1], score=1, time_s=1)
    assert {p.field for p in check_table(boxes).problems} == {
        "category_id (row 0, counted from 0)",
        "bbox or segmentation (row 0, counted from 0)",
    }


# --- laws ---


@given(st.integers(0, 2**32 - 1), st.floats(-0.2, 0.2), st.integers(0, 8))
def test_the_errors_of_a_matrix_are_those_of_numpy(seed: int, noise: float, place: int) -> None:
    R = random_rotations(4, seed)
    R.reshape(4, 9)[:, place] += noise
    np.testing.assert_allclose(determinant(R), np.linalg.det(R), atol=1e-12)
    gap = np.abs(np.einsum("nij,nkj->nik", R, R) - np.eye(3)).reshape(4, 9).max(axis=1)
    np.testing.assert_allclose(orthogonality_error(R), gap, atol=1e-12)


@given(st.integers(0, 2**32 - 1), st.sampled_from(["float32", "4 digits", "float16"]))
def test_a_rounded_rotation_is_still_one(seed: int, rounding: str) -> None:
    R = random_rotations(20, seed)
    rounded = R.round(4) if rounding == "4 digits" else R.astype(rounding.replace("4 digits", "f8"))
    table = PoseEstimates.from_arrays(
        scene_id=1,
        im_id=1,
        obj_id=np.arange(20),
        score=1,
        R=rounded,
        t_mm=[[0, 0, 500]] * 20,
        time_s=1,
    )
    is_flagged = any("rotation" in p.code for p in check_table(table).problems)
    assert not is_flagged or rounding == "float16"


@given(st.permutations(range(12)))
def test_the_order_of_rows_changes_no_counts(order: list[int]) -> None:
    lines = [row_with(im_id=str(i % 4), obj_id=str(5 + i % 3), time="0.5") for i in range(12)]
    lines[3] = row_with(im_id="-2", R=ROTATED_2)
    lines[7] = row_with(t="0 0 -5e2", score="0.1")

    def codes(report: CheckReport) -> list[str]:
        return sorted(p.code for p in report.problems)

    from sixd.results.findings import Findings
    from sixd.results.lines import LineBlock
    from sixd.results.pose_csv import _table
    from sixd.results.pose_csv_rows import read_rows_slowly

    def table_of(some: list[str]) -> PoseEstimates:
        block = LineBlock(("\n".join(some) + "\n").encode(), 1, 0)
        return _table(read_rows_slowly(block, Findings("", 9), 1 << 16))

    assert codes(check_table(table_of(lines))) == codes(
        check_table(table_of([lines[i] for i in order]))
    )


def test_a_problem_reads_well(tmp_path: Path) -> None:
    report = check_file(csv_file(tmp_path / "x.csv", row_with(R=ROTATED_2)))
    text = str(report.problems[0])
    assert text.startswith(f"{tmp_path / 'x.csv'}:2: R")
    assert "expected: det 1 and max|R R^T - I| near 0\n" in text
    assert "got: det 1.02, max|R R^T - I| 0.0404\n" in text
    assert "fix: sixd check --fix OUT puts the nearest rotation in its place" in text
