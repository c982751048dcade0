"""How fast MSSD, MSPD, ADD and ADI are, and how their time grows.

Run: python benchmarks/metrics.py [--quick]
Prints tables, writes benchmarks/out/metrics.json. Times are CPU time of one thread, best of three.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numba
import numpy as np

from sixd.geometry import Pose, Symmetries, SymmetryAxis
from sixd.metrics import fast

OUT = Path(__file__).parent / "out" / "metrics.json"
K = np.array([[1075.0, 0, 360], [0, 1073, 270], [0, 0, 1]])
Z_AXIS = SymmetryAxis(np.array([0, 0, 1.0]), np.zeros(3))
FIRST_USE = """
import time
start = time.process_time()
import numpy as np
from sixd.geometry import Pose
from sixd.metrics import fast
cells = fast.VertexCells.build(np.random.default_rng(0).normal(size=(500, 3)))
one = Pose.identity(1)
times = {"import": time.process_time() - start}
for name, call in {
    "mssd, mspd": lambda: fast.mspd(one, one, cells, one, np.eye(3)),
    "add": lambda: fast.add(one, one, cells),
    "adi": lambda: fast.adi(one, one, cells),
    "fisheye": lambda: fast.mspd_fisheye624(one, one, cells, one, np.ones(16)),
}.items():
    start = time.process_time()
    call()
    times[name] = time.process_time() - start
import json
print(json.dumps(times))
"""


def rotation(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    x, y, z = (axis / np.linalg.norm(axis, axis=1, keepdims=True)).T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(-1, 3, 3)
    sin, cos = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + sin * cross + (1 - cos) * (cross @ cross)


def body_of_revolution(rng: np.random.Generator, n_vertices: int) -> np.ndarray:
    """Vertices of a bumpy bottle, 10 cm high, with a symmetry about z."""
    height = rng.uniform(-50, 50, n_vertices)
    radius = 25 + 8 * np.sin(height / 9) + rng.normal(0, 0.2, n_vertices)
    angle = rng.uniform(0, 2 * np.pi, n_vertices)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)


def pairs(rng: np.random.Generator, n: int) -> tuple[Pose, Pose]:
    """Half of the estimates a few degrees off, a quarter turned at random, a quarter elsewhere."""
    gt = Pose(
        rotation(rng.normal(size=(n, 3)), rng.uniform(0, np.pi, n)),
        rng.uniform(-150, 150, (n, 3)) + [0, 0, 700],
    )
    kind = rng.choice(3, n, p=[0.5, 0.25, 0.25])
    angle = np.where(kind == 0, np.radians(rng.exponential(8, n)), rng.uniform(0, np.pi, n))
    turn = rotation(rng.normal(size=(n, 3)), angle)
    shift = rng.normal(size=(n, 3)) * np.array([6.0, 6.0, 80.0])[kind, None]
    return Pose(turn @ gt.R, gt.t_mm + shift), gt


def cpu_seconds(call: Callable[[], object]) -> float:
    best = float("inf")
    for _ in range(3):
        start = time.process_time()
        call()
        best = min(best, time.process_time() - start)
    return best


def us_per_pair(n: int, n_vertices: int, symmetries: Pose) -> dict[str, float]:
    rng = np.random.default_rng(0)
    cells = fast.VertexCells.build(body_of_revolution(rng, n_vertices))
    est, gt = pairs(rng, n)
    return {
        "mssd": cpu_seconds(lambda: fast.mssd(est, gt, cells, symmetries)) / n * 1e6,
        "mspd": cpu_seconds(lambda: fast.mspd(est, gt, cells, symmetries, K)) / n * 1e6,
    }


def t_less_like(n_pairs: int) -> dict[str, float]:
    """30 objects of 5k to 20k vertices: 12 continuous axes, 16 half turns, 2 without symmetry."""
    rng = np.random.default_rng(0)
    total = {"build": 0.0, "mssd": 0.0, "mspd": 0.0}
    half_turn = Symmetries(Z_AXIS.rotations(2)[1:]).transforms()
    continuous = Symmetries(axes=(Z_AXIS,)).transforms()
    for obj in range(30):
        symmetries = continuous if obj < 12 else half_turn if obj < 28 else Pose.identity(1)
        points = body_of_revolution(rng, 5000 + 500 * obj)
        est, gt = pairs(rng, n_pairs // 30)
        start = time.process_time()
        cells = fast.VertexCells.build(points)
        built = time.process_time()
        fast.mssd(est, gt, cells, symmetries)
        middle = time.process_time()
        fast.mspd(est, gt, cells, symmetries, K)
        end = time.process_time()
        for name, seconds in zip(total, (built - start, middle - built, end - middle), strict=True):
            total[name] += seconds
    return total


def first_use() -> dict[str, float]:
    """CPU seconds with an empty cache of compiled code."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
        command = [sys.executable, "-c", FIRST_USE]
        done = subprocess.run(command, env=environment, capture_output=True, check=True, text=True)
    return json.loads(done.stdout)


def growth(quick: bool) -> dict[str, dict[str, dict[str, float]]]:
    one, turns = Pose.identity(1), Symmetries(axes=(Z_AXIS,)).transforms()
    two_axes = Symmetries(axes=(Z_AXIS, SymmetryAxis(np.array([1.0, 0, 0]), np.zeros(3))))
    n = 500 if quick else 2000
    sets = {"1": one, "2": Z_AXIS.rotations(2), "16": Z_AXIS.rotations(16), "315": turns}
    sets["630"] = two_axes.transforms()
    return {
        "pairs": {str(k): us_per_pair(k, 8000, one) for k in (1000, 10_000, 100_000)[: 3 - quick]},
        "vertices": {str(k): us_per_pair(n, k, one) for k in (1000, 4000, 16_000, 64_000)},
        "symmetries": {name: us_per_pair(n, 8000, group) for name, group in sets.items()},
    }


def mean_errors(n: int) -> dict[str, float]:
    rng = np.random.default_rng(0)
    cells = fast.VertexCells.build(body_of_revolution(rng, 8000))
    est, gt = pairs(rng, n)
    return {
        "add": cpu_seconds(lambda: fast.add(est, gt, cells)) / n * 1e6,
        "adi": cpu_seconds(lambda: fast.adi(est, gt, cells)) / n * 1e6,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer pairs")
    quick = parser.parse_args().quick
    report = {
        "machine": {"processor": platform.processor(), "system": platform.platform()},
        "versions": {
            "python": platform.python_version(),
            "numpy": np.__version__,
            "numba": numba.__version__,
        },
        "first use, CPU s": first_use(),
        "growth, us per pair": growth(quick),
        "ADD and ADI, 8000 vertices, us per pair": mean_errors(50 if quick else 200),
        "T-LESS-like, 50,000 pairs, CPU s": t_less_like(50_000),
    }
    OUT.parent.mkdir(exist_ok=True)
    OUT.write_text(json.dumps(report, indent=1) + "\n")
    for title, table in report.items():
        print(f"\n{title}")
        for name, row in table.items():
            if isinstance(row, dict) and all(isinstance(v, dict) for v in row.values()):
                print(f"  by number of {name}")
                for key, values in row.items():
                    print(f"    {key:>8}  " + "  ".join(f"{k} {v:8.1f}" for k, v in values.items()))
            else:
                print(f"  {name:>12}  {row:.2f}" if isinstance(row, float) else f"  {name}: {row}")


if __name__ == "__main__":
    main()
