"""Time of 2D scores: against the toolkit on one input, and as detections grow.

    python benchmarks/coco.py [--shared ../shared/data]

The toolkit's figures are those of `peer_synth/README.md`: its whole command, on 2 CPU cores.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

TOOLKIT_CPU_S = {"bbox": 0.68, "segm": 0.72}
RESULTS = {"bbox": "synthbox_lmo-test.json", "segm": "synthseg_lmo-test.json.gz"}
ONE_RUN = """
import sys
from pathlib import Path
from sixd.datasets.opening import open_dataset
from sixd.evaluation.coco_truth import read_coco_truth
from sixd.evaluation.detection2d import coco_scores
from sixd.results.reading import read_results
folder, results, iou_type = sys.argv[1:]
dataset = open_dataset(folder)
truth = read_coco_truth(
    dataset, dataset.targets("test_targets_bop19.json"), masks=iou_type == "segm"
)
print(coco_scores(read_results(Path(results)), truth, iou_type).AP)
"""


def whole_run(shared: Path, iou_type: str, bytecode: str) -> tuple[float, float, str]:
    """CPU and wall seconds of reading and scoring in a fresh process, and the AP it prints."""
    # An installed package has its bytecode beside it; a checkout may be told not to write any.
    environment = os.environ | {"PYTHONDONTWRITEBYTECODE": "", "PYTHONPYCACHEPREFIX": bytecode}
    peer = shared / "peer_synth"
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.perf_counter()
    run = subprocess.run(
        [sys.executable, "-c", ONE_RUN, peer / "dataset/lmo", peer / "results" / RESULTS[iou_type],
         iou_type],
        capture_output=True, text=True, check=True, env=environment,
    )  # fmt: skip
    wall_s = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return cpu_s, wall_s, run.stdout.strip()


def growth(n_detections: int, rng: np.random.Generator) -> float:
    """CPU seconds to score boxes scattered about the truth of as many images as that takes."""
    from sixd.evaluation.coco_truth import CocoTruth
    from sixd.evaluation.detection2d import coco_scores
    from sixd.results.tables import Detections

    n_images, per_image = n_detections // 20 + 1, 8
    n = n_images * per_image
    image = np.repeat(np.arange(n_images), per_image)
    truth = CocoTruth(
        scene_id=np.ones(n_images, np.int64),
        im_id=np.arange(n_images),
        size_px=np.tile([640, 480], (n_images, 1)),
        category_id=np.arange(1, 31),
        image=image,
        obj_id=rng.integers(1, 31, n),
        bbox_xywh_px=rng.uniform(20, 300, (n, 4)),
        area_px=rng.uniform(100, 20000, n),
        ignored=rng.random(n) < 0.1,
        crowd=np.zeros(n, bool),
        segmentation=None,
    )
    rows = rng.integers(0, n, n_detections)
    detections = Detections.from_arrays(
        scene_id=1,
        im_id=image[rows],
        obj_id=truth.obj_id[rows],
        score=rng.random(n_detections),
        bbox_xywh_px=truth.bbox_xywh_px[rows] + rng.normal(0, 10, (n_detections, 4)),
    )
    start = time.process_time()
    coco_scores(detections, truth)
    return time.process_time() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    default = Path(__file__).resolve().parents[2] / "shared" / "data"
    parser.add_argument("--shared", type=Path, default=default)
    shared = parser.parse_args().shared
    print("whole run, best of 4   CPU s   toolkit CPU s   wall s   AP")
    with tempfile.TemporaryDirectory() as bytecode:
        for iou_type, toolkit_cpu_s in TOOLKIT_CPU_S.items():
            runs = [whole_run(shared, iou_type, bytecode) for _ in range(4)]
            cpu_s, wall_s, score = min(runs)
            print(f"{iou_type:20} {cpu_s:7.2f} {toolkit_cpu_s:15.2f} {wall_s:8.2f}   {score}")
    peak_mb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    print(f"peak memory {peak_mb:.0f} MB")
    print("detections   CPU s of scoring")
    rng = np.random.default_rng(0)
    growth(1000, rng)
    for n in (1_000, 10_000, 50_000, 100_000):
        print(f"{n:10} {growth(n, rng):18.3f}")


if __name__ == "__main__":
    main()
