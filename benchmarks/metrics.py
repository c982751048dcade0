"""How fast MSSD, MSPD, ADD and ADI are, and how their time grows.

Run: python benchmarks/metrics.py [--quick]
Prints tables, writes benchmarks/out/metrics.json. Times are CPU time of one thread, best of three.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from machine import machine, print_table, write_json

from sixd.geometry import Pose, Symmetries, SymmetryAxis
from sixd.geometry.pose import rotations_about
from sixd.metrics import fast

Row = dict[str, Any]
K = np.array([[1075.0, 0, 360], [0, 1073, 270], [0, 0, 1]])
IN_VIEW = np.array([0, 0, 700.0])
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


def body_of_revolution(rng: np.random.Generator, n_vertices: int) -> np.ndarray:
    """Vertices of a bumpy bottle, 10 cm high, with a symmetry about z."""
    height = rng.uniform(-50, 50, n_vertices)
    radius = 25 + 8 * np.sin(height / 9) + rng.normal(0, 0.2, n_vertices)
    angle = rng.uniform(0, 2 * np.pi, n_vertices)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)


def pairs(rng: np.random.Generator, n: int) -> tuple[Pose, Pose]:
    """Half of the estimates a few degrees off, a quarter turned at random, a quarter elsewhere."""
    gt = Pose(
        rotations_about(rng.normal(size=(n, 3)), rng.uniform(0, np.pi, n)),
        rng.uniform(-150, 150, (n, 3)) + IN_VIEW,
    )
    kind = rng.choice(3, n, p=[0.5, 0.25, 0.25])
    angle = np.where(kind == 0, np.radians(rng.exponential(8, n)), rng.uniform(0, np.pi, n))
    turn = rotations_about(rng.normal(size=(n, 3)), angle)
    shift = rng.normal(size=(n, 3)) * np.array([6.0, 6.0, 80.0])[kind, None]
    return Pose(turn @ gt.R, gt.t_mm + shift), gt


def cpu_seconds(call: Callable[[], object]) -> float:
    best = float("inf")
    for _ in range(3):
        start = time.process_time()
        call()
        best = min(best, time.process_time() - start)
    return best


def row(what: str, n: int, n_vertices: int, symmetries: Pose) -> Row:
    rng = np.random.default_rng(0)
    cells = fast.VertexCells.build(body_of_revolution(rng, n_vertices))
    est, gt = pairs(rng, n)
    mssd_s = cpu_seconds(lambda: fast.mssd(est, gt, cells, symmetries))
    mspd_s = cpu_seconds(lambda: fast.mspd(est, gt, cells, symmetries, K))
    return {
        "growing": what,
        "pairs": n,
        "vertices": n_vertices,
        "symmetries": len(symmetries),
        "MSSD us/pair": mssd_s / n * 1e6,
        "MSPD us/pair": mspd_s / n * 1e6,
    }


def growth(quick: bool) -> list[Row]:
    one, turns = Pose.identity(1), Symmetries(axes=(Z_AXIS,)).transforms()
    two_axes = Symmetries(axes=(Z_AXIS, SymmetryAxis(np.array([1.0, 0, 0]), np.zeros(3))))
    sets = [one, Z_AXIS.rotations(2), Z_AXIS.rotations(16), turns, two_axes.transforms()]
    n = 500 if quick else 2000
    return [
        *(row("pairs", k, 8000, one) for k in (1000, 10_000, 100_000)[: 2 if quick else 3]),
        *(row("vertices", n, k, one) for k in (1000, 4000, 16_000, 64_000)),
        *(row("symmetries", n, 8000, group) for group in sets),
    ]


def mean_errors(n: int) -> list[Row]:
    rng = np.random.default_rng(0)
    cells = fast.VertexCells.build(body_of_revolution(rng, 8000))
    est, gt = pairs(rng, n)
    calls = {"ADD": lambda: fast.add(est, gt, cells), "ADI": lambda: fast.adi(est, gt, cells)}
    return [
        {"error": name, "vertices": 8000, "us/pair": cpu_seconds(call) / n * 1e6}
        for name, call in calls.items()
    ]


def t_less_like(n_pairs: int) -> list[Row]:
    """30 objects of 5k to 20k vertices: 12 continuous axes, 16 half turns, 2 without symmetry."""
    rng = np.random.default_rng(0)
    half_turn = Symmetries(Z_AXIS.rotations(2)[1:]).transforms()
    continuous = Symmetries(axes=(Z_AXIS,)).transforms()
    times = np.zeros(4)
    for obj in range(30):
        symmetries = continuous if obj < 12 else half_turn if obj < 28 else Pose.identity(1)
        points = body_of_revolution(rng, 5000 + 500 * obj)
        est, gt = pairs(rng, n_pairs // 30)
        clock = [time.process_time()]
        cells = fast.VertexCells.build(points)
        clock.append(time.process_time())
        fast.mssd(est, gt, cells, symmetries)
        clock.append(time.process_time())
        fast.mspd(est, gt, cells, symmetries, K)
        clock.append(time.process_time())
        times += [*np.diff(clock), clock[-1] - clock[0]]
    names = "cells", "MSSD", "MSPD", "sum"
    return [
        {"T-LESS-like": name, "pairs": n_pairs, "CPU s": float(s)}
        for name, s in zip(names, times, strict=True)
    ]


def first_use() -> list[Row]:
    """With an empty cache of compiled code."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
        command = [sys.executable, "-c", FIRST_USE]
        done = subprocess.run(command, env=environment, capture_output=True, check=True, text=True)
    return [{"first use of": name, "CPU s": s} for name, s in json.loads(done.stdout).items()]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer pairs")
    quick = parser.parse_args().quick
    print(machine())
    rows: list[Row] = []
    for table in (
        first_use(),
        growth(quick),
        mean_errors(50 if quick else 200),
        t_less_like(50_000),
    ):
        print()
        print_table(table)
        rows += table
    print("\nwritten:", write_json("metrics", rows))


if __name__ == "__main__":
    main()
