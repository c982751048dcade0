"""Time of reading, checking and writing results, from 1,000 to 100,000 rows.

    python benchmarks/results_io.py

Rows are made here: poses with all the digits of a double (280 bytes a row, as the largest public
files have), boxes, and compressed masks of 270 characters. CPU seconds, the best of several runs.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from machine import print_table, write_json

from sixd.results import (
    Detections,
    PoseEstimates,
    Rle,
    check_file,
    read_results,
    write_coco_json,
    write_pose_csv,
)

RUNS = 5
ROWS = (1_000, 10_000, 100_000)
IMAGE_PX = (480, 640)


def poses(n: int) -> PoseEstimates:
    rng = np.random.default_rng(0)
    R = np.linalg.qr(rng.normal(size=(n, 3, 3)))[0]
    R *= np.linalg.det(R)[:, None, None]
    return PoseEstimates.from_arrays(
        scene_id=1,
        im_id=np.arange(n) // 20,
        obj_id=rng.integers(1, 31, n),
        score=rng.random(n),
        R=R,
        t_mm=rng.normal(size=(n, 3)) * 100 + [0, 0, 900],
        time_s=0.25,
    )


def boxes(n: int) -> Detections:
    rng = np.random.default_rng(0)
    return Detections.from_arrays(
        scene_id=1,
        im_id=np.arange(n) // 20,
        obj_id=rng.integers(1, 31, n),
        score=rng.random(n),
        bbox_xywh_px=rng.uniform(1, 200, (n, 4)),
        time_s=0.25,
    )


def masks(n: int) -> Detections:
    from hotcoco import mask

    height, width = IMAGE_PX
    y, x = np.mgrid[:height, :width]
    discs = [((x - 300 - k) ** 2 + (y - 200) ** 2 < (40 + k) ** 2) for k in range(20)]
    coded = [mask.encode(np.asfortranarray(disc.astype(np.uint8)))["counts"] for disc in discs]
    texts = [c if isinstance(c, str) else c.decode() for c in coded]
    rles = tuple(Rle(IMAGE_PX, texts[k % len(texts)]) for k in range(n))
    return replace(boxes(n), segmentation=rles)


def best_s(call: Callable[[], object]) -> float:
    seconds = []
    for _ in range(RUNS):
        began = time.process_time()
        call()
        seconds.append(time.process_time() - began)
    return min(seconds)


def measure(kind: str, n: int, folder: Path) -> dict[str, object]:
    table = {"poses": poses, "boxes": boxes, "masks": masks}[kind](n)
    path = folder / f"{kind}{n}"

    def write(target: Path) -> None:
        if isinstance(table, PoseEstimates):
            write_pose_csv(target, table)
        else:
            write_coco_json(target, table)

    write(path)
    write(folder / "packed.gz")
    return {
        "kind": kind,
        "rows": n,
        "MB": path.stat().st_size / 1e6,
        "read_s": best_s(lambda: read_results(path)),
        "read_gz_s": best_s(lambda: read_results(folder / "packed.gz")),
        "check_s": best_s(lambda: check_file(path)),
        "write_s": best_s(lambda: write(path)),
    }


def import_s() -> float:
    code = (
        "import time; t = time.process_time(); import sixd.results; print(time.process_time() - t)"
    )
    runs = [
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        for _ in range(RUNS)
    ]
    return min(float(run.stdout) for run in runs)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        rows = [measure(k, n, Path(folder)) for k in ("poses", "boxes", "masks") for n in ROWS]
    print_table(rows)
    print(f"import sixd.results: {import_s():.3f} s CPU, NumPy included")
    print(f"best of {RUNS} runs; written to {write_json('results_io', rows)}")


if __name__ == "__main__":
    main()
