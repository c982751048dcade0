"""The one checker of results files, shared by library, command line and server."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from sixd.errors import FormatError, Problem, UsageError
from sixd.geometry.pose import Floats
from sixd.results.findings import Findings
from sixd.results.limits import Limits
from sixd.results.lint_dataset import check_known_ids, check_targets
from sixd.results.lint_detections import check_detections
from sixd.results.lint_images import check_cap, check_images, count_images
from sixd.results.lint_poses import check_poses
from sixd.results.reading import parse_results
from sixd.results.results_text import Kind, open_results_text
from sixd.results.tables import PoseEstimates, Table

if TYPE_CHECKING:
    from sixd.datasets.dataset import Dataset


@dataclass(frozen=True)
class CheckRules:
    """What an evaluation protocol asks of a results file.

    `EvalProtocol.check_rules` makes those of a protocol::

        rules = sixd.PROTOCOLS["bop19-localization"].check_rules()
        sixd.check_file("method_lmo-test.csv", dataset, rules)
    """

    targets_file: str | None = None
    """List of targets, in the dataset's folder."""
    kind: Literal["pose", "bbox", "segm"] | None = None
    """What is scored."""
    cap: bool | int = False
    """Most estimates of an image that are scored; True: the number of the dataset."""
    every_target_object: bool = False
    """A target is an object in an image (localization), not an image (detection)."""


@dataclass(frozen=True)
class CheckReport:
    """All that is wrong with one results file."""

    file: str
    kind: Kind | None
    """None if that could not be told."""
    n_rows: int
    """Rows that could be read at least in part."""
    n_images: int
    problems: tuple[Problem, ...]
    """In order of lines; those of the whole file first."""
    omitted: Mapping[str, int] = field(default_factory=dict)
    """How many more problems of each code there are than `Limits.problems` keeps."""
    strict: bool = False
    table: Table | None = field(default=None, repr=False)
    """What was read, so that it need not be read again; None unless every row is readable."""

    @property
    def counts(self) -> Mapping[str, int]:
        """How many problems there are of each severity, those not kept included."""
        severity = {problem.code: problem.severity for problem in self.problems}
        counts = Counter({"error": 0, "warning": 0})
        counts.update(problem.severity for problem in self.problems)
        for code, n in self.omitted.items():
            counts[severity[code]] += n
        return counts

    @property
    def ok(self) -> bool:
        """No errors; when strict, no warnings either."""
        return not self.counts["error"] and not (self.strict and self.counts["warning"])

    def to_dict(self) -> dict[str, Any]:
        """The report as ``sixd check --json`` prints it."""
        return {
            "file": self.file,
            "ok": self.ok,
            "kind": self.kind,
            "n_rows": self.n_rows,
            "n_images": self.n_images,
            "n_errors": self.counts["error"],
            "n_warnings": self.counts["warning"],
            "strict": self.strict,
            "problems": [asdict(problem) for problem in self.problems],
            "omitted": dict(self.omitted),
        }


def check_file(
    path: str | Path,
    dataset: Dataset | None = None,
    protocol: CheckRules | None = None,
    *,
    strict: bool = False,
    limits: Limits | None = None,
) -> CheckReport:
    """Find everything that is wrong with a results file.

    Args:
        path: a pose CSV or a COCO results JSON, plain or gzipped, whatever its name.
        dataset: check ids and image sizes against it.
        protocol: check kind, cap and, with a dataset, targets; a protocol's rules come from
            `EvalProtocol.check_rules`.
        strict: warnings fail too.
        limits: how much the file may ask of this machine.

    Raises:
        MissingDataError: there is no such file, or a file of the dataset is missing.
    """
    if not isinstance(protocol, CheckRules | None):
        raise UsageError(
            f"protocol must be CheckRules, as sixd.PROTOCOLS[name].check_rules() makes them; "
            f"got {protocol!r:.60}"
        )
    if isinstance(dataset, str | Path):
        raise UsageError("dataset must be open: sixd.open_dataset(folder)")
    limits = limits or Limits()
    found = Findings(str(path), limits.problems)
    kind: Kind | None = None
    table: Table | None = None
    try:
        text = open_results_text(path, limits)
        kind = text.kind
        if text.has_bom:
            found.add(_has_bom())
        table = parse_results(text, found, limits)
    except FormatError as error:
        found.stop(error)
    is_readable = table is not None and not found.has_errors
    if table is not None:
        _check(table, dataset, protocol or CheckRules(), found)
    return _report(found, kind, table, table if is_readable else None, strict)


def check_table(
    table: Table,
    dataset: Dataset | None = None,
    protocol: CheckRules | None = None,
    *,
    strict: bool = False,
    limits: Limits | None = None,
) -> CheckReport:
    """`check_file` for results in memory; problems name rows, counted from 0, not lines.

    Raises:
        MissingDataError: a file of the dataset is missing.
    """
    found = Findings("", (limits or Limits()).problems)
    _check_finite(table, found)
    _check(table, dataset, protocol or CheckRules(), found)
    kind: Kind = "pose-csv" if isinstance(table, PoseEstimates) else "coco-json"
    return _report(found, kind, table, table, strict)


def _check_finite(table: Table, found: Findings) -> None:
    """What a reader finds in a file; NaN says that a box or time is missing."""
    for name in ("score", "R", "t_mm") if isinstance(table, PoseEstimates) else ("score",):
        column = getattr(table, name).reshape(len(table), -1)

        def not_finite(row: int, name: str = name, column: Floats = column) -> Problem:
            return Problem(
                code="not-finite",
                what=f"row {row}, counted from 0, is not finite",
                field=name,
                expected="finite numbers",
                got=str(column[row].tolist()),
                fix="leave out estimates that do not exist",
            )

        found.each(np.flatnonzero(~np.isfinite(column).all(axis=1)).tolist(), not_finite)


def _report(
    found: Findings, kind: Kind | None, seen: Table | None, usable: Table | None, strict: bool
) -> CheckReport:
    return CheckReport(
        file=found.file,
        kind=kind,
        n_rows=0 if seen is None else len(seen),
        n_images=0 if seen is None else count_images(seen),
        problems=found.problems(),
        omitted=dict(found.omitted),
        strict=strict,
        table=usable,
    )


def _check(table: Table, dataset: Dataset | None, rules: CheckRules, found: Findings) -> None:
    if not len(table) and not found.has_errors:
        found.add(_no_rows())
    is_pose = isinstance(table, PoseEstimates)
    if rules.kind is not None and (rules.kind == "pose") != is_pose:
        found.add(_wrong_kind(rules, is_pose))
        return
    check_images(table, found)
    if isinstance(table, PoseEstimates):
        check_poses(table, found)
    else:
        check_detections(table, dataset, None if rules.kind == "pose" else rules.kind, found)
    cap = _cap(rules, dataset)
    if cap is not None:
        check_cap(table, cap, found)
    if dataset is not None:
        targets = dataset.targets(rules.targets_file) if rules.targets_file else None
        check_known_ids(table, dataset, targets, found)
        if targets is not None:
            check_targets(table, targets, rules.every_target_object, not found.stopped, found)


def _cap(rules: CheckRules, dataset: Dataset | None) -> int | None:
    if rules.cap is False:
        return None
    if rules.cap is not True:
        return rules.cap
    return _USUAL_CAP if dataset is None else dataset.spec.max_estimates_per_image


_USUAL_CAP = 100


def _no_rows() -> Problem:
    return Problem(
        code="no-estimates",
        what="the file holds no estimates",
        expected="at least one row",
        got="none",
        fix="write the estimates; was the method run on any image?",
    )


def _wrong_kind(rules: CheckRules, is_pose: bool) -> Problem:
    expected = {
        "pose": "a pose CSV",
        "bbox": "a COCO results JSON with boxes",
        "segm": "a COCO results JSON with masks",
    }
    return Problem(
        code="wrong-kind",
        what="the protocol scores results of another kind",
        expected=expected[rules.kind or "pose"],
        got="a pose CSV" if is_pose else "a COCO results JSON",
        fix="name the protocol that goes with the file, or the file that goes with the protocol",
    )


def _has_bom() -> Problem:
    return Problem(
        code="bom",
        what="the file begins with a byte order mark",
        line=1,
        expected="text from the first byte",
        got="EF BB BF before the first line",
        fix="nothing has to be done; sixd check --fix OUT removes it",
        severity="warning",
    )
