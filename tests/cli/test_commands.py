"""The commands as a user runs them: another process, its output, its exit code."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import sixd
from sixd.results.pose_csv import write_pose_csv


def run(*arguments: object, **environment: str) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(
        [sys.executable, "-m", "sixd", *map(str, arguments)],
        capture_output=True, text=True, check=False, env={**os.environ, **environment},
    )  # fmt: skip
    assert "Traceback" not in done.stderr, done.stderr
    return done


@pytest.fixture(scope="module")
def results(tiny: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    table = sixd.results_from_truth(sixd.open_dataset(tiny), "localization")
    assert isinstance(table, sixd.PoseEstimates)
    path = tmp_path_factory.mktemp("results") / "any name. at_all"
    write_pose_csv(path, table)
    return path


def modules_after(statement: str) -> set[str]:
    code = f"import sys\n{statement}\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


HEAVY = {"numpy", "numba", "scipy", "cv2", "trimesh", "hotcoco", "rich", "polars"}


def test_import_and_help_load_nothing_heavy() -> None:
    assert not HEAVY & modules_after("import sixd")
    assert not HEAVY & modules_after("import sixd.cli.main")


def test_scoring_poses_loads_neither_scipy_nor_trimesh(tiny: Path, results: Path) -> None:
    code = f"import sixd; sixd.evaluate({str(results)!r}, {str(tiny)!r}, errors=['mssd', 'mspd'])"
    assert not {"trimesh", "scipy.spatial", "hotcoco", "polars"} & modules_after(code)


def test_scoring_boxes_loads_no_compiler(tiny: Path) -> None:
    code = (
        f"import sixd; d = sixd.open_dataset({str(tiny)!r});"
        "sixd.evaluate(sixd.results_from_truth(d, 'detection2d'), d, 'bop22-detection2d')"
    )
    assert not {"numba", "cv2", "scipy"} & modules_after(code)


def test_eval_prints_one_object_at_full_precision(tiny: Path, results: Path) -> None:
    done = run("eval", results, "--dataset", tiny, "--json")
    assert done.returncode == 0
    record = json.loads(done.stdout)
    assert record["scores"] == {"AR": 1.0, "AR_vsd": 1.0, "AR_mssd": 1.0, "AR_mspd": 1.0}
    assert record["protocol"] == "bop19-localization@1"
    assert record["dataset"] == "sixdemo"
    assert record["n_without_estimate"] == 0
    assert record["n_targets"] > 0
    assert record["average_time_per_image"] == -1


def test_eval_of_several_files_prints_a_list(tiny: Path, results: Path) -> None:
    done = run("eval", results, results, "--dataset", tiny, "--json", "--errors", "mssd")
    assert [r["scores"] for r in json.loads(done.stdout)] == [{"AR_mssd": 1.0}] * 2


def test_a_known_name_is_looked_up_in_bop_path(tiny: Path, results: Path) -> None:
    done = run("eval", results, "--dataset", "sixdemo", "--json", BOP_PATH=str(tiny.parent))
    assert json.loads(done.stdout)["scores"]["AR"] == 1.0


def test_show_needs_no_dataset(tiny: Path, results: Path, tmp_path: Path) -> None:
    saved = tmp_path / "a.sixd"
    assert run("eval", results, "--dataset", tiny, "--out", saved).returncode == 0
    for by in ("object", "scene", "threshold", "visibility"):
        done = run("show", saved, "--by", by, "--json")
        rows = json.loads(done.stdout)["rows"]
        assert rows
        assert f"by {by}" in run("show", saved, "--by", by).stdout
    done = run("show", saved, "--export", tmp_path / "errors.csv")
    assert done.returncode == 0
    assert (tmp_path / "errors.csv").read_text().startswith("scene_id,im_id,obj_id,")


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        (
            ["eval", "{results}", "--dataset", "{tiny}", "--protocol", "bop19"],
            2,
            "bop19-localization",
        ),
        (["eval", "{results}", "--dataset", "nowhere"], 2, "nowhere"),
        (["eval", "missing.csv", "--dataset", "{tiny}"], 2, "missing.csv"),
        (["eval", "{results}", "--dataset", "{tiny}", "--errors", "vsx"], 2, "vsd, mssd, mspd"),
        (["eval", "{results}", "--dataset", "{tiny}", "--targets", "none.json"], 2, "none.json"),
        (["eval", "{results}", "--dataset", "{tiny}", "--split", "val"], 2, "val"),
        (
            ["eval", "{results}", "--dataset", "{tiny}", "--protocol", "bop22-detection2d"],
            2,
            "6D poses",
        ),
        (["eval", "{tiny}/dataset.toml", "--dataset", "{tiny}"], 1, "dataset.toml"),
        (["show", "{results}"], 1, "not an evaluation"),
        (["show", "missing.sixd"], 2, "missing.sixd"),
        (["check", "missing.csv"], 2, "missing.csv"),
        (["check", "{tiny}/dataset.toml"], 1, "dataset.toml"),
        (["nonsense"], 2, "nonsense"),
    ],
)
def test_a_mistake_ends_in_a_message_and_a_code(
    tiny: Path, results: Path, arguments: list[str], code: int, says: str
) -> None:
    done = run(*(a.format(tiny=tiny, results=results) for a in arguments))
    assert done.returncode == code, done.stdout + done.stderr
    assert says in done.stderr + done.stdout


def test_a_failed_eval_leaves_no_file(tiny: Path, tmp_path: Path) -> None:
    bad = tmp_path / "bad.csv"
    bad.write_text("scene_id,im_id,obj_id,score,R,t,time\n1,0,1,nan,1 0 0 0 1 0 0 0 1,0 0 1,-1\n")
    assert run("eval", bad, "--dataset", tiny, "--out", tmp_path / "out.sixd").returncode == 1
    assert [p.name for p in tmp_path.iterdir()] == ["bad.csv"]


def test_a_run_killed_while_it_writes_leaves_the_old_file(
    tiny: Path, results: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out.sixd"
    arguments = ["sixd", "eval", *map(str, (results, "--dataset", tiny, "--out", out))]
    code = (
        "import os, pathlib, signal, sys\n"
        "kill = lambda *_: os.kill(os.getpid(), signal.SIGKILL)\n"
        "pathlib.Path.replace = kill\n"  # the moment between writing and renaming
        f"sys.argv = {arguments!r}\n"
        "from sixd.cli.main import run; run()"
    )
    older = sixd.evaluate(results, tiny, errors=["mssd"]).save(tmp_path / "older").read_bytes()
    for before in (None, older):
        if before:
            out.write_bytes(before)
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False)
        assert done.returncode == -signal.SIGKILL
        assert (out.read_bytes() if out.exists() else None) == before


def test_nothing_but_the_result_is_written(tiny: Path, results: Path, tmp_path: Path) -> None:
    before = sorted(p for p in tiny.rglob("*"))
    done = run(
        "eval", results, "--dataset", tiny, "--out", tmp_path / "a.sixd", TMPDIR=str(tmp_path)
    )
    assert done.returncode == 0
    assert sorted(p for p in tiny.rglob("*")) == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.sixd"]


def test_a_pipe_gets_no_bar_and_no_colour(tiny: Path, results: Path) -> None:
    done = run("eval", results, "--dataset", tiny)
    assert "\x1b" not in done.stdout + done.stderr
    assert done.stderr == ""


def test_protocols_are_listed() -> None:
    assert "bop24-detection-strict" in run("protocols").stdout
    names = [p["name"] for p in json.loads(run("protocols", "--json").stdout)]
    assert names == list(sixd.PROTOCOLS)


def test_nothing_but_an_evaluation_is_overwritten(
    tiny: Path, results: Path, tmp_path: Path
) -> None:
    mine = tmp_path / "mine.csv"
    mine.write_bytes(results.read_bytes())
    done = run("eval", mine, "--dataset", tiny, "--errors", "mssd", "--out", mine)
    assert done.returncode == 2
    assert mine.read_bytes() == results.read_bytes()
    done = run("eval", mine, "--dataset", tiny, "--errors", "mssd", "--out", tmp_path)
    assert done.returncode == 2


def test_two_results_of_one_name_are_not_written_into_one_folder(
    tiny: Path, results: Path, tmp_path: Path
) -> None:
    done = run("eval", results, results, "--dataset", tiny, "--bop-out", tmp_path / "scores")
    assert done.returncode == 2
    assert not (tmp_path / "scores").exists()


def test_a_pipe_of_another_encoding_is_written(tiny: Path, results: Path) -> None:
    done = run("eval", results, "--dataset", tiny, PYTHONIOENCODING="cp1252")
    assert done.returncode == 0
