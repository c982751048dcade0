from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from sixd.cli.check import check_command
from sixd.errors import MissingDataError, SixdError, UsageError
from tests.results.makers import ROW, csv_file, row_with

NOISY = "1.02 0 0 0 1 0 0 0 1"


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(check_command, [str(argument) for argument in arguments])


@pytest.fixture
def good(tmp_path: Path) -> Path:
    return csv_file(tmp_path / "good.csv", ROW)


@pytest.fixture
def warned(tmp_path: Path) -> Path:
    return csv_file(tmp_path / "warned.csv", row_with(time="-1"))


@pytest.fixture
def bad(tmp_path: Path) -> Path:
    return csv_file(tmp_path / "bad.csv", *[row_with(R=NOISY, im_id=str(i)) for i in range(8)])


def test_exit_codes_are_0_fine_1_problems(good: Path, warned: Path, bad: Path) -> None:
    assert run(good).exit_code == 0
    assert run(warned).exit_code == 0
    assert run(warned, "--strict").exit_code == 1
    assert run(bad).exit_code == 1
    assert run(good, bad).exit_code == 1


def test_wrong_use_is_2_and_names_every_missing_file(good: Path, tmp_path: Path) -> None:
    result = run(good, tmp_path / "a.csv", tmp_path / "b.csv", tmp_path)
    assert isinstance(result.exception, MissingDataError)
    assert result.exception.exit_code == 2
    assert "a.csv" in str(result.exception)
    assert "b.csv" in str(result.exception)
    assert f"{tmp_path} is a folder" in str(result.exception)
    assert result.output == ""
    assert run().exit_code == 2
    assert run(good, "--max-problems", "0").exit_code == 2


@pytest.mark.parametrize(
    "wrong",
    [
        ["--protocol", "bop19-localisation"],
        ["--dataset", "no-such-dataset"],
        ["--fix", "out.csv", "second.csv"],
    ],
)
def test_wrong_use_is_told_before_anything_is_read(
    good: Path, wrong: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(good.parent)
    csv_file(good.parent / "second.csv", ROW)
    result = run(good, *wrong)
    assert isinstance(result.exception, UsageError)
    assert result.exception.exit_code == 2
    assert result.output == ""


def test_each_file_has_a_line_and_each_kind_of_problem_a_remedy(good: Path, bad: Path) -> None:
    lines = run(good, bad).output.splitlines()
    assert lines[0] == f"{good}: pose-csv, 1 estimate in 1 image: fine"
    assert lines[1] == f"{bad}: pose-csv, 8 estimates in 8 images: not fine, 8 errors"
    assert lines[2] == "  error not-a-rotation: R is not a rotation matrix (8 times)"
    assert lines[3] == "    line 2, R: got det 1.02, max|R R^T - I| 0.0404"
    assert lines[8] == "    and 3 more like this"
    assert lines[9] == "    expected: det 1 and max|R R^T - I| near 0"
    assert lines[10].startswith("    fix: sixd check --fix")
    assert len(lines) == 11
    assert "    and 7 more like this" in run(bad, "--max-problems", "1").output


def test_a_pipe_gets_no_colours(bad: Path) -> None:
    assert "\x1b" not in run(bad).output


def test_json_is_one_object_or_a_list(good: Path, bad: Path) -> None:
    one = json.loads(run(bad, "--json").output)
    assert one["file"] == str(bad)
    assert (one["ok"], one["kind"], one["n_rows"], one["n_errors"]) == (False, "pose-csv", 8, 8)
    assert [p["line"] for p in one["problems"]] == list(range(2, 10))
    keys = {"code", "what", "file", "line", "field", "expected", "got", "fix", "severity"}
    assert set(one["problems"][0]) == keys
    two = json.loads(run(good, bad, "--json").output)
    assert [report["ok"] for report in two] == [True, False]
    bounded = json.loads(run(bad, "--json", "--max-problems", "3").output)
    assert len(bounded["problems"]) == 3
    assert bounded["omitted"] == {"not-a-rotation": 5}
    assert bounded["n_errors"] == 8


def test_fix_writes_tells_and_judges_what_it_wrote(bad: Path, tmp_path: Path) -> None:
    result = run(bad, "--fix", tmp_path / "out.csv")
    assert result.exit_code == 0
    lines = result.output.splitlines()
    assert lines[0] == f"{tmp_path / 'out.csv'} was written: 8 changes"
    assert lines[1] == "  R made a rotation (8 times)"
    assert lines[2].startswith(f"    line 2: {NOISY} -> 1.0 0.0")
    assert lines[-1] == f"{tmp_path / 'out.csv'}: pose-csv, 8 estimates in 8 images: fine"
    as_json = json.loads(run(bad, "--fix", tmp_path / "out2.csv", "--json").output)
    assert as_json["ok"]
    assert as_json["fix"]["written"]
    assert len(as_json["fix"]["changes"]) == 8


def test_fix_refuses_what_it_cannot_read(tmp_path: Path) -> None:
    path = csv_file(tmp_path / "x.csv", "1,2,3")
    result = run(path, "--fix", tmp_path / "out.csv")
    assert result.exit_code == 1
    assert "was not written" in result.output
    assert "column-count" in result.output
    assert not (tmp_path / "out.csv").exists()


def test_a_protocol_brings_its_rules(toy_folder: Path, tmp_path: Path) -> None:
    path = csv_file(tmp_path / "x.csv", *[row_with(t=f"0 0 {900 - i}") for i in range(5)])
    localization = run(path, "--dataset", toy_folder, "--protocol", "bop19-localization").output
    assert "missing-targets" in localization
    assert "over-cap" not in localization
    detection = run(path, "--dataset", toy_folder, "--protocol", "bop24-detection").output
    assert "at most 3 estimates" in detection
    boxes = run(path, "--protocol", "bop22-detection2d")
    assert boxes.exit_code == 1
    assert "wrong-kind" in boxes.output


def test_a_dataset_is_found_by_name_in_bop_path(
    toy_folder: Path, good: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BOP_PATH", str(toy_folder.parent))
    assert run(good, "--dataset", toy_folder.name).exit_code == 0


def test_a_dataset_without_the_list_of_targets_is_told(toy_folder: Path, good: Path) -> None:
    result = run(good, "--dataset", toy_folder, "--protocol", "bop18-siso")
    assert isinstance(result.exception, SixdError)
    assert "test_targets_bop18.json" in str(result.exception)
