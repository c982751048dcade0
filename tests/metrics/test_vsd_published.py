"""VSD against what the reference toolkit computed of the same input."""

from __future__ import annotations

import csv
import gzip
import json
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np
import pytest

from sixd.geometry import Pose, read_mesh
from sixd.metrics.vsd import vsd_pairs
from sixd.render import RenderMesh, render_crop
from tests.render.shapes import shifted

TAUS = np.arange(0.05, 0.51, 0.05)
LMO_K = np.array([[572.4114, 0, 325.2611], [0, 573.57043, 242.04899], [0, 0, 1]])


def pose(R: list[float], t_mm: list[float]) -> Pose:
    return Pose(np.reshape(R, (3, 3)), np.array(t_mm))


@pytest.mark.oracle
def test_silhouettes_of_real_objects_have_the_official_size(shared_data):
    """``px_count_all`` of scene 2, image 3 of LM-O, counted on the enlarged canvas."""
    scene = shared_data / "lmo/test/000002"
    truth = json.loads((scene / "scene_gt.json").read_text())["3"]
    info = json.loads((scene / "scene_gt_info.json").read_text())["3"]
    counts = {}
    for gt, official in zip(truth, info, strict=True):
        # The other meshes of this folder are hulls, not for rendering.
        if gt["obj_id"] in (1, 5, 6, 10):
            mesh = read_mesh(shared_data / f"lmo/models_eval/obj_{gt['obj_id']:06d}.ply")
            at = pose(gt["cam_R_m2c"], gt["cam_t_m2c"])
            crop = render_crop(mesh, at, shifted(LMO_K, 640, 480), (1920, 1440))
            counts[gt["obj_id"]] = (np.count_nonzero(crop.depth_mm), official["px_count_all"])
    assert counts == {1: (1126, 1127), 5: (4329, 4330), 6: (1646, 1646), 10: (3401, 3400)}


@pytest.mark.oracle
def test_errors_are_those_of_the_reference_toolkit(shared_data):
    """It renders with OpenGL into a 16-bit depth buffer, so single pixels may differ."""
    peer = shared_data / "peer_synth"
    errors = errors_by_pair(peer)
    for k, tau in enumerate(TAUS):
        path = peer / f"peer/errors/localization_vsd_tau{tau:.3f}.json.gz"
        if not path.is_file():
            continue
        differences = [
            abs(errors[row["im_id"], row["obj_id"], row["est_id"], int(gt)][k] - error[0])
            for row in json.loads(gzip.decompress(path.read_bytes()))
            for gt, error in row["errors"].items()
        ]
        assert len(differences) > 1400
        assert np.median(differences) == 0
        assert np.quantile(differences, 0.99) < 1e-3
        assert max(differences) < 5e-3


def errors_by_pair(peer: Path) -> dict[tuple[int, int, int, int], np.ndarray]:
    """``(T,)`` errors by image, object, number of the estimate, number of the instance."""
    import cv2

    scene, models = peer / "dataset/lmo/test/000002", peer / "dataset/lmo/models_eval"
    info = json.loads((models / "models_info.json").read_text())
    ids = sorted(map(int, info))
    meshes = [RenderMesh.build(read_mesh(models / f"obj_{i:06d}.ply")) for i in ids]
    rows = defaultdict(list)
    with (peer / "results/synthloc_lmo-test.csv").open() as file:
        for row in csv.DictReader(file):
            rows[int(row["im_id"])].append(row)
    errors = {}
    for image, truth in json.loads((scene / "scene_gt.json").read_text()).items():
        im_id, n_seen = int(image), Counter()
        depth = cv2.imread(str(scene / f"depth/{im_id:06d}.png"), cv2.IMREAD_UNCHANGED)
        obj_ids = [int(row["obj_id"]) for row in rows[im_id]]
        placed = [pose(*(row[k].split() for k in "Rt")) for row in rows[im_id]]
        placed += [pose(gt["cam_R_m2c"], gt["cam_t_m2c"]) for gt in truth]
        poses = Pose(
            np.array([p.R for p in placed], float), np.array([p.t_mm for p in placed], float)
        )
        keys, pairs = [], []
        for est, obj_id in enumerate(obj_ids):
            for gt_id, gt in enumerate(truth):
                if gt["obj_id"] == obj_id:
                    keys.append((im_id, obj_id, n_seen[obj_id], gt_id))
                    pairs.append((est, len(obj_ids) + gt_id))
            n_seen[obj_id] += 1
        all_ids = obj_ids + [gt["obj_id"] for gt in truth]
        diameters_mm = np.array([info[str(key[1])]["diameter"] for key in keys])
        measured = vsd_pairs(
            depth.astype(np.float32) * np.float32(0.1),
            LMO_K,
            meshes,
            poses,
            np.searchsorted(ids, all_ids),
            np.array(pairs).reshape(-1, 2),
            diameters_mm,
            15.0,
            TAUS,
        )
        errors.update(zip(keys, measured, strict=True))
    return errors
