"""A report as text: problems of one kind together, the first few in full, the rest counted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

from sixd.errors import Problem
from sixd.results.fix import FixReport
from sixd.results.lint import CheckReport

Style = Literal["plain", "good", "error", "warning", "faint"]
Line = tuple[Style, str]
SHOWN_OF_A_KIND = 5


def report_lines(report: CheckReport, shown: int = SHOWN_OF_A_KIND) -> Iterator[Line]:
    """The report, line by line, each with the style a terminal gives it."""
    counts = report.counts
    found = [_count(n, severity) for severity, n in counts.items() if n]
    what = "unreadable"
    if report.kind is not None:
        noun = "estimate" if report.kind == "pose-csv" else "detection"
        what = f"{report.kind}, {_count(report.n_rows, noun)} in {_count(report.n_images, 'image')}"
    style: Style = "error" if counts["error"] else "warning" if counts["warning"] else "good"
    verdict = "fine" if report.ok else "not fine"
    yield style, f"{report.file}: {what}: {', '.join([verdict, *found])}"
    for alike in _alike(report.problems):
        yield from _kind_lines(alike, shown, report.omitted.get(alike[0].code, 0))


def fix_lines(report: FixReport, shown: int = SHOWN_OF_A_KIND) -> Iterator[Line]:
    """What was mended, and where the rest stands."""
    if not report.written:
        yield "error", f"{report.out} was not written: mend the errors below in {report.file} first"
        return
    yield "good", f"{report.out} was written: {_count(len(report.changes), 'change')}"
    kinds: dict[str, list[Line]] = {}
    for change in report.changes:
        place = f"line {change.line}" if change.line else "file"
        told = ("plain", f"    {place}: {change.before} -> {change.after}")
        kinds.setdefault(change.what, []).append(told)  # type: ignore[arg-type]
    for what, lines in kinds.items():
        yield "plain", f"  {what}" + (f" ({len(lines):,} times)" if len(lines) > 1 else "")
        yield from lines[:shown]
        if len(lines) > shown:
            yield "faint", f"    and {len(lines) - shown:,} more like this"


def _alike(problems: Sequence[Problem]) -> list[list[Problem]]:
    """Problems that differ in place and value only; errors first, then in order of lines."""
    groups: dict[tuple[str, ...], list[Problem]] = {}
    for severity in ("error", "warning"):
        for problem in problems:
            if problem.severity == severity:
                key = (severity, problem.code, problem.what, problem.fix)
                groups.setdefault(key, []).append(problem)
    return list(groups.values())


def _kind_lines(alike: Sequence[Problem], shown: int, n_omitted: int) -> Iterator[Line]:
    first = alike[0]
    times = f" ({len(alike):,} times)" if len(alike) > 1 else ""
    yield first.severity, f"  {first.severity} {first.code}: {first.what}{times}"
    one_expected = len({problem.expected for problem in alike}) == 1
    for problem in alike[:shown]:
        place = f"line {problem.line}" if problem.line else ""
        where = ", ".join(part for part in (place, problem.field) if part) or "file"
        wanted = f", expected {problem.expected}" if problem.expected and not one_expected else ""
        yield "plain", f"    {where}: got {problem.got or 'nothing'}{wanted}"
    if len(alike) > shown:
        yield "faint", f"    and {len(alike) - shown:,} more like this"
    if n_omitted:
        yield "faint", f"    and {n_omitted:,} more {first.code} that were counted but not kept"
    if one_expected and first.expected:
        yield "plain", f"    expected: {first.expected}"
    if first.fix:
        yield "plain", f"    fix: {first.fix}"


def _count(n: int, noun: str) -> str:
    return f"{n:,} {noun}" + ("" if n == 1 else "s")
