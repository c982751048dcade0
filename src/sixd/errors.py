"""Every error a user can meet: one tree, one `Problem` record, one place for shape checks."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from types import ModuleType
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

_MOST_ALIKE = 20


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong: what, where, what was expected, what came, how to mend it.

    The same record travels from the library to the terminal, to ``--json`` and to the server.
    """

    code: str
    """Stable kebab-case name, for machines: ``not-a-rotation``."""
    what: str
    """One sentence, for people."""
    _: KW_ONLY
    file: str = ""
    line: int | None = None
    """Line of a text file, counted from 1 (a header is line 1)."""
    field: str = ""
    expected: str = ""
    got: str = ""
    fix: str = ""
    severity: Literal["error", "warning"] = "error"

    def __str__(self) -> str:
        place = ":".join(str(p) for p in (self.file, self.line) if p not in ("", None))
        head = ": ".join(p for p in (place, self.field, self.what) if p)
        pairs = (("expected", self.expected), ("got", self.got), ("fix", self.fix))
        return head + "".join(f"\n    {name}: {text}" for name, text in pairs if text)


class SixdError(Exception):
    """Something the user can mend. The command line prints it without a traceback, exit code 2."""

    exit_code = 2


class UsageError(SixdError, ValueError):
    """An argument names what does not exist, or does not go with the others."""


class ShapeError(SixdError, ValueError):
    """An array has the wrong shape."""


class MissingDataError(SixdError, LookupError):
    """A file, image, object or field that is needed is not there."""

    @classmethod
    def of(cls, problems: Sequence[Problem]) -> MissingDataError:
        """One error that names everything that is missing."""
        return cls(_listed(problems))


class OutputError(SixdError, OSError):
    """A file or folder cannot be written."""


class MissingExtraError(SixdError, ImportError):
    """An optional package is needed and not installed."""


class FormatError(SixdError, ValueError):
    """Files break their format; carries all problems found, not the first. Exit code 1."""

    exit_code = 1

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__(_listed(problems))


def _listed(problems: Sequence[Problem]) -> str:
    """All problems as text; of many that are mended alike, the first few and their number."""
    alike: dict[tuple[str, str], list[Problem]] = {}
    for problem in problems:
        alike.setdefault((problem.code, problem.fix), []).append(problem)
    lines: list[str] = []
    for some in alike.values():
        lines += map(str, some[:_MOST_ALIKE])
        more = len(some) - _MOST_ALIKE
        if more > 0:
            lines.append(f"    ... and {more:,} more like this")
    return "\n".join(lines)


def check_shape(name: str, array: ArrayLike, tail: tuple[int, ...]) -> None:
    """Raise `ShapeError` unless the last axes of ``array`` are ``tail``."""
    import numpy as np  # here, so that `sixd --help` does not wait for it

    got = np.shape(array)
    if got[-len(tail) :] != tail:
        want = ", ".join(["...", *map(str, tail)])
        raise ShapeError(f"{name} must have shape ({want}), got {got}")


def need(module: str, extra: str) -> ModuleType:
    """Import an optional package, or say which extra brings it.

    Raises:
        MissingExtraError: the package is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingExtraError(
            f"{module} is needed for this and is not installed: pip install 'sixd[{extra}]'"
        ) from error
