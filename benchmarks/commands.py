"""Whole `sixd eval` commands against the reference toolkit's figures for the same input.

The toolkit's figures are those of `peer_synth/README.md` (2 cores, 2 workers), where the input
comes from. CPU seconds are compared, which depend less on what else the machine does.

    python benchmarks/commands.py ../shared/data/peer_synth
"""

from __future__ import annotations

import statistics
import sys
from pathlib import Path

from machine import print_table, run_command, write_json

TOOLKIT_CPU_S = {
    "bop19-localization": 83.6,
    "bop24-detection": 89.7,
    "bop22-detection2d": 0.68,
    "bop22-segmentation2d": 0.72,
}
RESULTS = {
    "bop19-localization": "synthloc_lmo-test.csv",
    "bop24-detection": "synthdet_lmo-test.csv",
    "bop22-detection2d": "synthbox_lmo-test.json",
    "bop22-segmentation2d": "synthseg_lmo-test.json.gz",
}
RUNS = 5


def main(data: Path) -> None:
    rows = []
    for protocol, file in RESULTS.items():
        command = [sys.executable, "-m", "sixd", "eval", str(data / "results" / file), "--dataset",
                   str(data / "dataset/lmo"), "--protocol", protocol, "--json"]  # fmt: skip
        run_command(command)  # the first run may compile
        runs = [run_command(command) for _ in range(RUNS)]
        row = {name: statistics.median(r[name] for r in runs) for name in runs[0]}
        theirs = TOOLKIT_CPU_S[protocol]
        rows.append(
            {"protocol": protocol, **row, "toolkit_cpu_s": theirs, "ratio": theirs / row["cpu_s"]}
        )
    print_table(rows)
    print(f"median of {RUNS} runs; written to {write_json('commands', rows)}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
