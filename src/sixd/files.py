"""Files are written whole or not at all."""

from __future__ import annotations

import hashlib
import secrets
from contextlib import suppress
from pathlib import Path

from sixd.errors import OutputError


def write_atomically(path: str | Path, data: bytes) -> Path:
    """Write ``data`` beside ``path``, then rename: a killed run leaves the old file or none.

    Raises:
        OutputError: the folder cannot be made or written.
    """
    path = Path(path)
    temporary = beside(path)
    if path.exists() and not path.is_file():
        raise OutputError(f"{path}: cannot be written: it is there and is not a regular file")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_bytes(data)
        temporary.replace(path)
    except OSError as error:
        _discard(temporary)
        raise cannot_write(path, error) from error
    except BaseException:
        _discard(temporary)
        raise
    return path


def cannot_write(path: Path, error: OSError) -> OutputError:
    """The error to raise where the system refuses to write."""
    return OutputError(f"{path}: cannot be written: {error.strerror or error}")


def _discard(temporary: Path) -> None:
    with suppress(OSError):  # its folder may not even be one
        temporary.unlink(missing_ok=True)


def beside(path: Path) -> Path:
    """A hidden name that nobody else uses, on the same file system."""
    return path.with_name(f".{path.name}.{secrets.token_hex(6)}.tmp")


def sha256_of(path: str | Path) -> str:
    """Hex digest of a file's bytes."""
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
