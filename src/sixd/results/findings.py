"""Collects the problems of one file, with a bound on how many of a kind are kept."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace

from sixd.errors import FormatError, Problem

_SHOWN_CHARS = 72


class Findings:
    """Problems found so far. What is over the bound is counted, never forgotten."""

    def __init__(self, file: str, per_kind: int) -> None:
        self.file = file
        self.omitted: Counter[str] = Counter()
        """How many problems of each code were found but not kept."""
        self.stopped = False
        """The file was not read to its end, so nothing can be said to be missing from it."""
        self._per_kind = max(per_kind, 1)
        self._kept: list[Problem] = []
        self._counts: Counter[str] = Counter()

    def add(self, problem: Problem) -> None:
        """Keep a problem, or count it if there are too many like it."""
        self._counts[problem.code] += 1
        if self._counts[problem.code] > self._per_kind:
            self.omitted[problem.code] += 1
        else:
            self._kept.append(problem)

    def each(self, rows: Iterable[int], problem_of: Callable[[int], Problem]) -> None:
        """Add the problem of every row; rows over the bound cost next to nothing."""
        code = ""
        for row in rows:
            if code and self._counts[code] >= self._per_kind:
                self._counts[code] += 1
                self.omitted[code] += 1
                continue
            problem = problem_of(int(row))
            code = problem.code
            self.add(problem)

    def stop(self, error: FormatError) -> None:
        """Take over the problems of an error that ended the reading before the file's end."""
        self.stopped = True
        for problem in error.problems:
            self.add(problem)

    @property
    def has_errors(self) -> bool:
        """Whether anything worse than a warning was found."""
        return any(problem.severity == "error" for problem in self._kept)

    def problems(self) -> tuple[Problem, ...]:
        """All that was kept, in order of lines; what concerns the whole file comes first."""
        ordered = sorted(self._kept, key=lambda problem: problem.line or 0)
        return tuple(replace(problem, file=self.file) for problem in ordered)

    def raise_errors(self) -> None:
        """End the reading if the file cannot be used.

        Raises:
            FormatError: carries every error found.
        """
        if not self.has_errors:
            return
        errors = [problem for problem in self.problems() if problem.severity == "error"]
        if self.omitted:
            errors.append(
                Problem(
                    code="more-problems",
                    what=f"{sum(self.omitted.values())} more problems like these are not listed",
                    file=self.file,
                )
            )
        raise FormatError(errors)


def shown(text: str) -> str:
    """A piece of a file as a message quotes it: escaped, and not longer than a line."""
    quoted = repr(text[: _SHOWN_CHARS + 1])
    return (
        quoted
        if len(text) <= _SHOWN_CHARS
        else f"{quoted[:_SHOWN_CHARS]}...' ({len(text)} characters)"
    )
