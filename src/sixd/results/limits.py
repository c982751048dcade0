"""How much a results file may ask of the machine that reads it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Bounds that hold while a file is read, so that a hostile one is refused, not suffered.

    A gzip bomb is noticed while it inflates. The defaults are far above any real submission
    (the largest public ones have some 100,000 rows); a server sets its own.
    """

    inflated_bytes: int = 2 << 30
    """Length of the text, after inflating."""
    ratio: int = 200
    """Inflated over compressed bytes; real submissions stay below 30."""
    ratio_floor_bytes: int = 16 << 20
    """Below this many inflated bytes no ratio is looked at."""
    rows: int = 5_000_000
    """Estimates or detections in one file; a pose CSV may have twice as many lines."""
    line_bytes: int = 64 << 10
    """Length of one line of a pose CSV, where 400 is usual."""
    entry_chars: int = 16 << 20
    """Length of one entry of a COCO JSON that is not plain (a mask can be long)."""
    problems: int = 10_000
    """Problems of one kind that are kept; the rest is counted."""
