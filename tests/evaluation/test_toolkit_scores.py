"""From the toolkit's own errors to its own scores: matching and AP, to the last digit."""

from __future__ import annotations

import csv
import gzip
import json
from pathlib import Path

import numpy as np
import pytest

from sixd.evaluation.errors_table import ErrorTable, EstimateRows, Groups, TruthRows, all_pairs
from sixd.evaluation.protocol import ErrorSpec, get_protocol
from sixd.evaluation.scores import score
from sixd.rows import find_rows, first_of_each

pytestmark = pytest.mark.oracle
VISIB_MIN = 0.1


@pytest.fixture(scope="module")
def truth_of_lmo(shared_data: Path) -> dict[str, np.ndarray]:
    scene = shared_data / "lmo/test/000002"
    gt = json.loads((scene / "scene_gt.json").read_text())
    info = json.loads((scene / "scene_gt_info.json").read_text())
    rows = [
        (int(im), entry["obj_id"], gt_id, info[im][gt_id]["visib_fract"])
        for im, entries in gt.items()
        for gt_id, entry in enumerate(entries)
    ]
    im_id, obj_id, gt_id, visib = (np.array(c) for c in zip(*rows, strict=True))
    return {"im_id": im_id, "obj_id": obj_id, "gt_id": gt_id, "visib_fract": visib}


def table_of_toolkit(path: Path, column: str, truth: dict[str, np.ndarray]) -> ErrorTable:
    with gzip.open(path) as file:
        entries = json.load(file)
    est = [(e["im_id"], e["obj_id"], e["score"]) for e in entries]
    im_id, obj_id, scores = (np.array(c) for c in zip(*est, strict=True))
    keys = (
        np.concatenate([truth["im_id"], im_id]).astype(np.int64),
        np.concatenate([truth["obj_id"], obj_id]).astype(np.int64),
    )
    first = first_of_each(keys)
    groups = (keys[0][first], keys[1][first])
    truth_group = find_rows((truth["im_id"], truth["obj_id"]), groups)
    estimate_group = find_rows((im_id, obj_id), groups)
    truth_order = np.lexsort((truth["gt_id"], truth_group))
    order = np.lexsort((-scores, estimate_group))
    visib = truth["visib_fract"][truth_order]
    counted = visib >= VISIB_MIN
    pairs = all_pairs(estimate_group[order], truth_group[truth_order], len(first))
    gt_id = truth["gt_id"][truth_order]
    errors = np.array(
        [
            entries[order[e]]["errors"][str(gt_id[t])][0]
            for e, t in zip(pairs.estimate, pairs.truth, strict=True)
        ]
    )
    n = len(first)
    return ErrorTable(
        Groups(
            np.full(n, 2),
            *groups,
            np.bincount(truth_group[truth_order][counted], minlength=n),
            np.ones(n),
            np.ones(n),
        ),
        EstimateRows(estimate_group[order], order, scores[order]),
        TruthRows(truth_group[truth_order], gt_id, visib, np.ones(len(gt_id), bool), counted),
        pairs,
        {column: errors},
    )


DIAMETERS_MM = {1: 102.099, 5: 201.404, 6: 154.546, 8: 261.472, 9: 108.999, 10: 164.628,
                11: 175.889, 12: 145.543}  # fmt: skip


@pytest.mark.parametrize(
    ("folder", "published", "spec"),
    [
        ("mssd", "mAP_mssd.csv", get_protocol("bop24-detection").errors[0]),
        ("mssd", "mAP_mssd_mm.csv", get_protocol("bop24-detection").errors[2]),
        ("mspd", "mAP_mspd.csv", get_protocol("bop24-detection").errors[1]),
    ],
)
def test_every_ap_of_every_object_at_every_threshold_is_the_toolkits(
    shared_data: Path,
    truth_of_lmo: dict[str, np.ndarray],
    folder: str,
    published: str,
    spec: ErrorSpec,
) -> None:
    outputs = shared_data / "lmo_eval_outputs"
    column = "mspd_px" if folder == "mspd" else "mssd_mm"
    table = table_of_toolkit(outputs / folder / "errors_000002.json.gz", column, truth_of_lmo)
    if spec.unit == "diameter":
        diameter_mm = np.array([DIAMETERS_MM[o] for o in table.groups.obj_id.tolist()])
        table.groups.diameter_mm[:] = diameter_mm
    from sixd.evaluation.scores import _Precision

    levels = _Precision(table, spec).of_objects()
    with (outputs / published).open() as file:
        head, *rows = csv.reader(file)
    thresholds = [float(h) for h in head[1:11]]
    assert thresholds == list(spec.thresholds)
    theirs = np.array([[float(v) for v in row[1:11]] for row in rows if row[0].isdigit()])
    np.testing.assert_allclose(levels, theirs, rtol=0, atol=1e-12)


def test_the_means_are_the_toolkits(shared_data: Path, truth_of_lmo: dict[str, np.ndarray]) -> None:
    outputs = shared_data / "lmo_eval_outputs"
    published = json.loads((outputs / "scores_bop24.json").read_text())
    protocol = get_protocol("bop24-detection").with_errors(("mspd",))
    table = table_of_toolkit(outputs / "mspd/errors_000002.json.gz", "mspd_px", truth_of_lmo)
    ours = score(table, protocol).values["AP_mspd"]
    assert ours == pytest.approx(published["bop24_mAP_mspd"], abs=1e-12)
