"""What a figure was measured on, and where it is written."""

from __future__ import annotations

import importlib.metadata
import json
import os
import platform
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

OUT = Path(__file__).parent / "out"


def machine() -> dict[str, Any]:
    """Processor, cores and versions."""
    model = ""
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        lines = cpuinfo.read_text().splitlines()
        model = next((line.split(":")[1].strip() for line in lines if "model name" in line), "")
    packages = ("sixd", "numpy", "numba", "scipy", "opencv-python-headless", "hotcoco", "msgspec")
    return {
        "processor": model or platform.processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "versions": {p: importlib.metadata.version(p) for p in packages},
    }


def write_json(name: str, rows: Sequence[dict[str, Any]]) -> Path:
    """Write the rows of a table beside what they were measured on."""
    OUT.mkdir(exist_ok=True)
    path = OUT / f"{name}.json"
    path.write_text(json.dumps({"machine": machine(), "rows": list(rows)}, indent=2) + "\n")
    return path


def print_table(rows: Sequence[dict[str, Any]]) -> None:
    """Print rows as a Markdown table."""
    if not rows:
        return
    head = list(rows[0])
    cells = [[_text(row[name]) for name in head] for row in rows]
    widths = [max(len(c) for c in column) for column in zip(head, *cells, strict=True)]
    for line in (head, ["-" * w for w in widths], *cells):
        print("| " + " | ".join(c.rjust(w) for c, w in zip(line, widths, strict=True)) + " |")


def _text(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def run_command(command: Sequence[str]) -> dict[str, float]:
    """Wall and CPU seconds and peak memory of one process, which must succeed."""
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{' '.join(command)} ended with exit code {process.returncode}")
    return {
        "wall_s": time.perf_counter() - start,
        "cpu_s": usage.ru_utime + usage.ru_stime,
        "peak_mb": usage.ru_maxrss / 1024,
    }
