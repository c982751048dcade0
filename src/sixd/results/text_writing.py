"""A results file appears whole or not at all."""

from __future__ import annotations

import gzip
from pathlib import Path

from sixd.files import write_atomically


def write_results_text(path: str | Path, text: bytes) -> None:
    """Write atomically; a name that ends in ``.gz`` is compressed.

    Raises:
        OutputError: the file cannot be written.
    """
    # No time in the header: equal results, equal bytes.
    is_gzip = Path(path).suffix == ".gz"
    write_atomically(path, gzip.compress(text, mtime=0) if is_gzip else text)
