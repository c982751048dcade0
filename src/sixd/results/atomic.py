"""A results file appears whole or not at all."""

from __future__ import annotations

import gzip
from pathlib import Path

from sixd.errors import MissingDataError


def write_results_text(path: str | Path, text: bytes) -> None:
    """Write beside the target, then move onto it; a name that ends in ``.gz`` is compressed.

    Raises:
        MissingDataError: the folder may not be written.
    """
    from sixd.datasets.writing import write_bytes

    path = Path(path)
    if path.suffix == ".gz":
        text = gzip.compress(text, mtime=0)  # equal results, equal bytes
    try:
        write_bytes(path, text)
    except OSError as error:
        raise MissingDataError(f"{path}: cannot be written: {error.strerror}") from error
