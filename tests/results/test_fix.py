from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sixd.errors import MissingDataError, UsageError
from sixd.results import check_file, fix_file, read_coco_json, read_pose_csv
from sixd.results.fix import nearest_rotations
from sixd.results.lint_poses import determinant, orthogonality_error
from tests.results.makers import HEADER, ROW, csv_file, random_rotations, row_with


def text_of(R: np.ndarray) -> str:
    return " ".join(map(repr, R.reshape(9).tolist()))


@given(st.integers(0, 2**32 - 1))
def test_a_slightly_wrong_matrix_becomes_the_nearest_rotation(
    tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    folder = tmp_path_factory.mktemp("fix")
    R = random_rotations(1, seed)[0]
    noisy = R + np.random.default_rng(seed).uniform(-0.004, 0.004, (3, 3))
    path = csv_file(folder / "x.csv", row_with(R=text_of(noisy)))
    fixed = fix_file(path, folder / "out.csv")
    mended = read_pose_csv(folder / "out.csv").R
    assert orthogonality_error(mended)[0] < 1e-3
    if fixed.changes:
        (change,) = fixed.changes
        assert (change.line, change.field, change.before) == (2, "R", text_of(noisy))
        assert orthogonality_error(mended)[0] < 1e-14
        assert determinant(mended)[0] > 0
        # Nearest: no nearer than the truth it came from.
        assert np.linalg.norm(mended[0] - noisy) <= np.linalg.norm(R - noisy) + 1e-12
    assert check_file(folder / "out.csv", strict=True).ok


@given(st.integers(0, 2**32 - 1))
def test_the_nearest_rotation_to_a_rotation_is_itself(seed: int) -> None:
    R = random_rotations(5, seed)
    np.testing.assert_allclose(nearest_rotations(R), R, atol=1e-14)


@pytest.mark.parametrize(
    "R", ["1 0 0 0 1 0 0 0 -1", "1.2 0 0 0 1 0 0 0 1", "0 0 0 0 0 0 0 0 0", "1 0 0 0 1 0 0 0 -1.01"]
)
def test_a_matrix_that_is_far_from_every_rotation_is_left_and_told(tmp_path: Path, R: str) -> None:
    path = csv_file(tmp_path / "x.csv", row_with(R=R))
    fixed = fix_file(path, tmp_path / "out.csv")
    assert fixed.written
    assert fixed.changes == ()
    assert {p.code for p in fixed.left} <= {"reflection", "not-a-rotation"}
    assert fixed.left
    assert (tmp_path / "out.csv").read_bytes() == path.read_bytes()


def test_times_of_an_image_become_its_first(tmp_path: Path) -> None:
    rows = [ROW, row_with(obj_id="6", time="0.3"), row_with(im_id="4", time="0.9")]
    fixed = fix_file(csv_file(tmp_path / "x.csv", *rows), tmp_path / "out.csv")
    (change,) = fixed.changes
    assert (change.line, change.field, change.before, change.after) == (3, "time", "0.3", "0.25")
    assert fixed.left == ()
    assert read_pose_csv(tmp_path / "out.csv").time_s.tolist() == [0.25, 0.25, 0.9]


def test_missing_times_are_not_invented(tmp_path: Path) -> None:
    rows = [ROW, row_with(obj_id="6", time="-1"), row_with(obj_id="7", time="0.2505")]
    fixed = fix_file(csv_file(tmp_path / "x.csv", *rows), tmp_path / "out.csv")
    assert fixed.changes == ()
    assert [p.code for p in fixed.left] == ["missing-time"]


def test_rows_that_are_not_touched_keep_their_bytes(tmp_path: Path) -> None:
    odd = row_with(score="+0.500", R="1.000 0 0  0 1 0 0 0 1", obj_id="007", time="2.50e-1")
    bad = row_with(time="0.9")
    path = tmp_path / "x.csv"
    path.write_bytes(b"\xef\xbb\xbf" + f"{HEADER}\r\n{odd}\r\n\r\n{bad}\r\n".encode())
    fixed = fix_file(path, tmp_path / "out.csv")
    assert (tmp_path / "out.csv").read_text() == f"{HEADER}\n{odd}\n{ROW}\n".replace(
        ",0.25\n", ",0.25\n"
    )
    told = {(change.what, change.line) for change in fixed.changes}
    assert told == {
        ("byte order mark removed", 1),
        ("line ends changed", 1),
        ("blank line removed", 3),
        ("time made that of its image", 4),
    }
    assert fixed.left == ()


@pytest.mark.parametrize("bad", [row_with(score="nan"), "1,2,3", row_with(t="1 2")])
def test_nothing_is_written_while_rows_are_unreadable(tmp_path: Path, bad: str) -> None:
    path = csv_file(tmp_path / "x.csv", row_with(time="0.5"), bad, ROW)
    out = tmp_path / "out.csv"
    out.write_text("what was there")
    fixed = fix_file(path, out)
    assert not fixed.written
    assert fixed.left[0].line == 3
    assert out.read_text() == "what was there"


def test_metres_are_left_and_told(tmp_path: Path) -> None:
    path = csv_file(tmp_path / "x.csv", row_with(t="0.1 0.2 0.9"))
    fixed = fix_file(path, tmp_path / "out.csv")
    assert [p.code for p in fixed.left] == ["metres"]
    assert read_pose_csv(tmp_path / "out.csv").t_mm.tolist() == [[0.1, 0.2, 0.9]]


def test_a_file_is_never_mended_in_place(tmp_path: Path) -> None:
    path = csv_file(tmp_path / "x.csv", ROW)
    link = tmp_path / "link.csv"
    link.symlink_to(path)
    for out in (path, link):
        with pytest.raises(UsageError, match="in place"):
            fix_file(path, out)
    assert path.read_text() == f"{HEADER}\n{ROW}\n"


def test_a_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(MissingDataError):
        fix_file(tmp_path / "none.csv", tmp_path / "out.csv")
    assert not list(tmp_path.iterdir())


def test_a_gzipped_file_is_mended_into_whichever_form_the_name_says(tmp_path: Path) -> None:
    text = f"{HEADER}\n{ROW}\n{row_with(obj_id='6', time='9')}\n"
    (tmp_path / "x").write_bytes(gzip.compress(text.encode()))
    for name in ("out.csv", "out.csv.gz"):
        assert len(fix_file(tmp_path / "x", tmp_path / name).changes) == 1
        assert check_file(tmp_path / name, strict=True).ok
    assert (tmp_path / "out.csv.gz").read_bytes()[:2] == b"\x1f\x8b"


def test_detections_keep_what_sixd_does_not_know(tmp_path: Path) -> None:
    entry: dict[str, Any] = {"scene_id": 1, "image_id": 2, "category_id": 3, "score": 0.5}
    entry |= {"bbox": [1, 2, 3, 4], "note": "mine", "time": 0.5}
    path = tmp_path / "x.json"
    path.write_text(json.dumps([entry, entry | {"score": 0.25, "time": 0.75}]))
    fixed = fix_file(path, tmp_path / "out.json")
    (change,) = fixed.changes
    assert (change.field, change.before, change.after) == ("[1].time", "0.75", "0.5")
    assert json.loads((tmp_path / "out.json").read_text()) == [entry, entry | {"score": 0.25}]
    assert len(read_coco_json(tmp_path / "out.json")) == 2
