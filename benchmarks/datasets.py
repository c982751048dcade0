"""Reading the annotations of a split as large as T-LESS's: 1000 images, 67,000 instances.

python benchmarks/datasets.py
"""

from __future__ import annotations

import json
import tempfile
import time
from pathlib import Path

import numpy as np
from machine import print_table, write_json

from sixd.datasets.opening import open_dataset
from sixd.datasets.preflight import find_missing
from sixd.datasets.truth import read_truth

N_SCENES, IMAGES_PER_SCENE, INSTANCES_PER_IMAGE = 20, 50, 67
RUNS = 5


def write_split(folder: Path) -> None:
    rng = np.random.default_rng(0)
    for scene_id in range(1, N_SCENES + 1):
        scene = folder / f"test/{scene_id:06d}"
        scene.mkdir(parents=True)
        camera, gt, info = {}, {}, {}
        for im_id in range(IMAGES_PER_SCENE):
            camera[im_id] = {"cam_K": [1075.0, 0, 360, 0, 1075, 270, 0, 0, 1], "depth_scale": 0.1}
            gt[im_id] = [
                {"obj_id": n % 30 + 1, "cam_R_m2c": R, "cam_t_m2c": t}
                for n, (R, t) in enumerate(
                    zip(
                        rng.normal(size=(INSTANCES_PER_IMAGE, 9)).tolist(),
                        rng.normal(size=(INSTANCES_PER_IMAGE, 3)).tolist(),
                        strict=True,
                    )
                )
            ]
            info[im_id] = [
                {"visib_fract": 0.5, "px_count_all": 700, "px_count_visib": 350,
                 "px_count_valid": 690, "bbox_obj": [1, 2, 3, 4], "bbox_visib": [1, 2, 3, 4]}
            ] * INSTANCES_PER_IMAGE  # fmt: skip
        for name, record in (("camera", camera), ("gt", gt), ("gt_info", info)):
            (scene / f"scene_{name}.json").write_text(json.dumps(record))


def main() -> None:
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        write_split(Path(folder))
        images = np.array(
            [(s, i) for s in range(1, N_SCENES + 1) for i in range(IMAGES_PER_SCENE)], np.int64
        )
        for what in ("truth to arrays", "cameras", "preflight"):
            best = np.inf
            for _ in range(RUNS):
                dataset = open_dataset(folder)
                start = time.perf_counter()
                if what == "truth to arrays":
                    n = len(read_truth(dataset))
                elif what == "cameras":
                    n = sum(len(dataset.cameras(s)) for s in dataset.scene_ids)
                else:
                    find_missing(dataset, images[:, 0], images[:, 1], (), ("camera", "truth"))
                    n = len(images)
                best = min(best, time.perf_counter() - start)
            rows.append({"what": what, "n": n, "seconds": float(best)})
    print_table(rows)
    print(f"best of {RUNS}; written to {write_json('datasets', rows)}")


if __name__ == "__main__":
    main()
