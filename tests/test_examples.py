from __future__ import annotations

import subprocess
import sys
from pathlib import Path

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


def test_scoring_while_training_shows_progress(tiny: Path) -> None:
    done = subprocess.run(
        [sys.executable, EXAMPLES / "score_while_training.py", tiny],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    scores = [float(line.split()[-1]) for line in done.stdout.splitlines()]
    assert len(scores) == 3
    assert scores == sorted(scores)
