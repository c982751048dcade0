"""Every MSSD and MSPD error the reference toolkit wrote, on data it evaluated."""

from __future__ import annotations

import csv
import gzip
import json
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest

from sixd.geometry import Pose, Symmetries, camera_from_bop, read_vertices
from sixd.metrics import fast, reference

pytestmark = pytest.mark.oracle
Pairs = dict[int, tuple[Pose, Pose, np.ndarray, np.ndarray]]


@pytest.fixture(scope="module")
def peer(shared_data) -> Path:
    return shared_data / "peer_synth"


def estimates_by_target(path: Path, cap: int | None) -> dict[tuple[int, int, int], list]:
    """(scene, image, object) -> rows in the order that est_id counts (BOP rules, section 1)."""
    by_image = defaultdict(list)
    with path.open() as file:
        for row in csv.DictReader(file):
            by_image[int(row["scene_id"]), int(row["im_id"])].append(row)
    by_target = defaultdict(list)
    for image, rows in by_image.items():
        kept = sorted(rows, key=lambda row: -float(row["score"]))[:cap] if cap else rows
        for row in kept:
            by_target[*image, int(row["obj_id"])].append(row)
    return by_target


def read_pairs(peer: Path, task: str, metric: str) -> Pairs:
    """Object -> estimates, truths, intrinsics and the toolkit's errors, row by row."""
    name, cap = {"detection": ("synthdet", 100), "localization": ("synthloc", None)}[task]
    estimates = estimates_by_target(peer / "results" / f"{name}_lmo-test.csv", cap)
    scene = peer / "dataset" / "lmo" / "test" / "000002"
    truth = json.loads((scene / "scene_gt.json").read_text())
    cameras = json.loads((scene / "scene_camera.json").read_text())
    with gzip.open(peer / "peer" / "errors" / f"{task}_{metric}.json.gz") as file:
        written = json.load(file)
    rows = defaultdict(list)
    for entry in written:
        image, obj_id = str(entry["im_id"]), entry["obj_id"]
        est = estimates[entry["scene_id"], entry["im_id"], obj_id][entry["est_id"]]
        assert float(est["score"]) == entry["score"]
        for gt_id, (error,) in entry["errors"].items():
            gt = truth[image][int(gt_id)]
            numbers = [
                *map(float, est["R"].split()),
                *map(float, est["t"].split()),
                *gt["cam_R_m2c"],
                *gt["cam_t_m2c"],
                *camera_from_bop(cameras[image]).K.ravel(),
                error,
            ]
            rows[obj_id].append(numbers)
    pairs = {}
    for obj_id, numbers in rows.items():
        est_R, est_t, gt_R, gt_t, K, error = np.split(np.array(numbers), [9, 12, 21, 24, 33], 1)
        pairs[obj_id] = (
            Pose(est_R.reshape(-1, 3, 3), est_t),
            Pose(gt_R.reshape(-1, 3, 3), gt_t),
            K.reshape(-1, 3, 3),
            error[:, 0],
        )
    return pairs


@pytest.mark.parametrize("metric", ["mssd", "mspd"])
@pytest.mark.parametrize(("task", "count"), [("detection", 12_523), ("localization", 1665)])
def test_every_error_equals_the_toolkits(peer, task, count, metric):
    models = peer / "dataset" / "lmo" / "models_eval"
    info = json.loads((models / "models_info.json").read_text())
    pairs = read_pairs(peer, task, metric)
    assert sum(len(p[3]) for p in pairs.values()) == count
    for obj_id, (est, gt, K, expected) in pairs.items():
        cells = fast.VertexCells.build(read_vertices(models / f"obj_{obj_id:06d}.ply"))
        symmetries = Symmetries.from_models_info(info[str(obj_id)]).transforms()
        if metric == "mspd":
            found = fast.mspd(est, gt, cells, symmetries, K)
        else:
            found = fast.mssd(est, gt, cells, symmetries)
            found[~reference.within_reach(est, gt, info[str(obj_id)]["diameter"])] = np.inf
        np.testing.assert_array_equal(np.isinf(found), np.isinf(expected))
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
