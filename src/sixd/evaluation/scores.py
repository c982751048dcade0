"""Scores from the table of errors: recall, average precision, area under the accuracy curve."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sixd.evaluation.errors_table import ErrorTable
from sixd.evaluation.matching import match
from sixd.evaluation.protocol import ErrorSpec, EvalProtocol

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

RECALL_LEVELS = np.linspace(0.0, 1.0, 101)
VISIBILITY_EDGES = np.arange(0, 11) / 10
PREFIX = {"recall": "AR", "average-precision": "AP", "auc": "AUC", "coco": "AP"}
TABLE_COLUMN = {"mssd": "mssd_mm", "mspd": "mspd_px", "vsd": "vsd"}


@dataclass(frozen=True)
class Breakdown:
    """Scores by object, scene, threshold or visibility: equally long columns, keys first."""

    by: str
    columns: Mapping[str, NDArray[np.generic]]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))


@dataclass(frozen=True)
class Scores:
    """Headline numbers and where they come from."""

    values: Mapping[str, float]
    breakdowns: Mapping[str, Breakdown]


def table_column(name: str) -> str:
    """Name of the column of `ErrorTable.errors` that holds an error."""
    return TABLE_COLUMN.get(name, f"{name}_mm")


def normalised(table: ErrorTable, spec: ErrorSpec) -> Floats:
    """``(P, C)`` errors in the unit of the thresholds of ``spec``."""
    raw = table.errors[table_column(spec.name)]
    group = table.pair_group
    if spec.unit == "diameter":
        raw = (raw.T / table.groups.diameter_mm[group]).T
    elif spec.unit == "px@640":
        raw = (raw.T * table.groups.px_scale[group]).T
    return raw[:, None] if raw.ndim == 1 else raw


def score(table: ErrorTable, protocol: EvalProtocol) -> Scores:
    """Score a table of errors (BOP rules 7 and 8). Milliseconds; call it as often as you like."""
    statistic = STATISTICS[protocol.statistic]
    scored = {spec.key: statistic(table, spec) for spec in protocol.errors}
    prefix = PREFIX[protocol.statistic]
    values: dict[str, float] = {}
    for key, one in scored.items():
        values[f"{prefix}_{key}"] = one.overall(protocol.average_over)
        if protocol.statistic == "auc":
            values[f"{prefix}_{key}_object_mean"] = one.overall("objects")
    breakdowns = {
        "object": _by_part(table, scored, protocol, "object"),
        "scene": _by_part(table, scored, protocol, "scene"),
        "threshold": _by_threshold(scored, protocol),
    }
    if protocol.task != "single-instance":  # there any instance will do, so none has its own score
        breakdowns["visibility"] = _by_visibility(table, scored)
    return Scores(with_headline(values, protocol), breakdowns)


def with_headline(values: Mapping[str, float], protocol: EvalProtocol) -> dict[str, float]:
    """Put the mean of the headline scores first; left out unless all of them were measured."""
    keys = [f"{PREFIX[protocol.statistic]}_{h}" for h in protocol.headline]
    if not keys or any(k not in values for k in keys):
        return dict(values)
    return {protocol.score: float(np.mean([values[k] for k in keys])), **values}


class _Matched(ABC):
    """What every statistic starts from: the matches at all thresholds, and who was found."""

    def __init__(self, table: ErrorTable, spec: ErrorSpec) -> None:
        self.table, self.spec = table, spec
        self.errors = normalised(table, spec)
        matched = match(table, self.errors, np.asarray(spec.thresholds))
        self.flat = matched.reshape(-1, self.errors.shape[1] * len(spec.thresholds))
        """``(E, C * L)``"""
        self.counts = np.append(table.truths.counted, False)[self.flat]  # -1 is the appended one
        self.is_ignored = (self.flat >= 0) & ~self.counts
        self.objects, self.object_of_group = _numbered(table.groups.obj_id)
        self.scenes, self.scene_of_group = _numbered(table.groups.scene_id)

    def found_fraction(self) -> Floats:
        """``(T,)`` share of thresholds at which each instance is found."""
        found = np.bincount(self.flat[self.counts], minlength=len(self.table.truths.group))
        return np.asarray(found / self.flat.shape[1], np.float64)

    @abstractmethod
    def of_parts(self, part: Ints, n_parts: int) -> Floats:
        """``(n_parts, C * L)`` score of each part of the groups; NaN where nothing is wanted."""

    def of_objects(self) -> Floats:
        """``(O, C * L)``."""
        return self.of_parts(self.object_of_group, len(self.objects))

    def of_scenes(self) -> Floats:
        """``(S, C * L)``."""
        return self.of_parts(self.scene_of_group, len(self.scenes))

    def of_all(self) -> Floats:
        """``(C * L,)``."""
        pooled: Floats = self.of_parts(np.zeros_like(self.object_of_group), 1)[0]
        return pooled

    def overall(self, average_over: str) -> float:
        """The mean over thresholds, pooled or averaged over objects."""
        if average_over == "objects":
            return mean_of_known(self.of_objects().mean(axis=1))
        return mean_of_known(self.of_all())


class _Recall(_Matched):
    """Found instances over instances to be found, pooled over the part."""

    def of_parts(self, part: Ints, n_parts: int) -> Floats:
        groups, estimates = self.table.groups, self.table.estimates
        n_wanted = np.bincount(part, weights=groups.n_wanted, minlength=n_parts)
        estimate, level = np.nonzero(self.counts)
        n_levels = self.flat.shape[1]
        cell = part[estimates.group[estimate]] * n_levels + level
        n_found = np.bincount(cell, minlength=n_parts * n_levels).reshape(n_parts, n_levels)
        with np.errstate(invalid="ignore", divide="ignore"):
            levels: Floats = np.where(n_wanted > 0, n_found.T / n_wanted, np.nan).T
        return levels


class _Precision(_Matched):
    """Average precision of each object, averaged over the objects that have targets."""

    def of_parts(self, part: Ints, n_parts: int) -> Floats:
        cells = part * len(self.objects) + self.object_of_group
        levels = self._of_single_objects(cells, n_parts * len(self.objects))
        return mean_known_rows(levels.reshape(n_parts, len(self.objects), -1))

    def of_objects(self) -> Floats:
        objects: Floats = self._objects
        return objects

    def of_scenes(self) -> Floats:
        return super().of_scenes() if len(self.scenes) > 1 else self.of_all()[None]

    def of_all(self) -> Floats:
        mean: Floats = mean_known_rows(self._objects[None])[0]
        return mean

    @cached_property
    def _objects(self) -> Floats:
        return self._of_single_objects(self.object_of_group, len(self.objects))

    def _of_single_objects(self, part: Ints, n_parts: int) -> Floats:
        """`of_parts` for parts of which each holds one object."""
        table = self.table
        n_wanted = np.bincount(part, weights=table.groups.n_wanted, minlength=n_parts)
        estimate_part = part[table.estimates.group]
        order = np.lexsort((-table.estimates.score, estimate_part))
        ends = np.searchsorted(estimate_part[order], np.arange(n_parts + 1))
        levels = np.full((n_parts, self.flat.shape[1]), np.nan)
        for p in np.flatnonzero(n_wanted > 0):
            rows = order[ends[p] : ends[p + 1]]
            wanted = int(n_wanted[p])
            levels[p] = average_precision(self.counts[rows], self.is_ignored[rows], wanted)
        return levels


class _Auc(_Matched):
    """Area under accuracy against threshold, from 0 to the one threshold of the error."""

    def of_parts(self, part: Ints, n_parts: int) -> Floats:
        from sixd.metrics.reference import auc

        wanted, part_of_truth = self.table.truths.counted, part[self.table.truths.group]
        areas = np.full((n_parts, 1), np.nan)
        for p in range(n_parts):
            errors = self._error_of_truth[wanted & (part_of_truth == p)]
            if len(errors):
                areas[p] = auc(errors, self.spec.thresholds[0])
        return areas

    @cached_property
    def _error_of_truth(self) -> Floats:
        """``(T,)`` error of the estimate that found each instance, whatever it is."""
        table = self.table
        matched = match(table, self.errors, np.array([np.inf]))[:, 0, 0]
        chosen = matched[table.pairs.estimate] == table.pairs.truth
        errors = np.full(len(table.truths.group), np.inf)
        errors[table.pairs.truth[chosen]] = self.errors[chosen, 0]
        return errors


STATISTICS: Mapping[str, type[_Matched]] = {
    "recall": _Recall,
    "average-precision": _Precision,
    "auc": _Auc,
}


def _numbered(keys: Ints) -> tuple[Ints, Ints]:
    values, number = np.unique(keys, return_inverse=True)
    return values, number.astype(np.int64)


def average_precision(
    is_true: NDArray[np.bool_], is_ignored: NDArray[np.bool_], n_wanted: int
) -> Floats:
    """Area under the 101-point interpolated precision-recall curve, as COCO and BOP define it.

    Args:
        is_true: ``(E, L)`` estimates that found an instance, best score first; L thresholds.
        is_ignored: ``(E, L)`` estimates that are neither true nor false.
        n_wanted: number of instances to be found, at least 1.

    Returns:
        ``(L,)`` mean over recall levels r of the best precision at recall >= r, 0 where none.
    """
    n_true = np.cumsum(is_true, axis=0)
    n_shown = np.cumsum(~is_ignored, axis=0)
    precision = n_true / np.maximum(n_shown, 1)
    best_from_here = np.maximum.accumulate(precision[::-1], axis=0)[::-1]
    # Recall rises only at true estimates, so a level is first reached where enough are found.
    best_with = np.zeros((n_wanted + 1, is_true.shape[1]))
    best_with[0] = best_from_here[0] if len(is_true) else 0.0
    row, level = np.nonzero(is_true)
    best_with[n_true[row, level], level] = best_from_here[row, level]
    enough = np.searchsorted(np.arange(n_wanted + 1) / n_wanted, RECALL_LEVELS, side="left")
    areas: Floats = best_with[enough].mean(axis=0)
    return areas


def mean_of_known(values: Floats) -> float:
    """Mean of the values that are not NaN; 0 where there is none."""
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else 0.0


def mean_known_rows(cells: Floats) -> Floats:
    """``(A, B, C)`` to ``(A, C)``: mean over B of what is not NaN; NaN where nothing is known."""
    known = ~np.isnan(cells)
    n_known = known.sum(axis=1)
    total = np.where(known, cells, 0.0).sum(axis=1)
    mean: Floats = np.where(n_known > 0, total / np.maximum(n_known, 1), np.nan)
    return mean


def _by_part(
    table: ErrorTable,
    scored: Mapping[str, _Matched],
    protocol: EvalProtocol,
    by: Literal["object", "scene"],
) -> Breakdown:
    key_name = "obj_id" if by == "object" else "scene_id"
    parts, part = _numbered(getattr(table.groups, key_name))
    n = len(parts)
    n_wanted = np.bincount(part, weights=table.groups.n_wanted, minlength=n)
    columns: dict[str, NDArray[np.generic]] = {
        key_name: parts,
        "n_targets": n_wanted.astype(np.int64),
        "n_estimates": np.bincount(part[table.estimates.group], minlength=n),
    }
    prefix = PREFIX[protocol.statistic]
    by_error = {
        key: (one.of_objects() if by == "object" else one.of_scenes()).mean(axis=1)
        for key, one in scored.items()
    }
    if protocol.headline and all(h in by_error for h in protocol.headline):
        columns[protocol.score] = np.mean([by_error[h] for h in protocol.headline], axis=0)
    columns |= {f"{prefix}_{key}": values for key, values in by_error.items()}
    return Breakdown(by, columns)


def _by_threshold(scored: Mapping[str, _Matched], protocol: EvalProtocol) -> Breakdown:
    rows: list[tuple[str, float, float, str, float]] = []
    for key, one in scored.items():
        spec = one.spec
        places = [(tau, th) for tau in spec.taus or (np.nan,) for th in spec.thresholds]
        values = one.of_all().tolist()
        rows += [(key, tau, th, spec.unit, v) for (tau, th), v in zip(places, values, strict=True)]
    error, tau, threshold, unit, value = zip(*rows, strict=True)
    name = {"recall": "recall", "average-precision": "AP", "auc": "AUC"}[protocol.statistic]
    return Breakdown(
        "threshold",
        {
            "error": np.array(error, dtype=str),
            "tau": np.array(tau, float),
            "threshold": np.array(threshold, float),
            "unit": np.array(unit, dtype=str),
            name: np.array(value, float),
        },
    )


def _by_visibility(table: ErrorTable, scored: Mapping[str, _Matched]) -> Breakdown:
    """Recall by visible fraction: precision has no visibility, since false poses have none."""
    counted = table.truths.counted
    n_bins = len(VISIBILITY_EDGES) - 1
    which = np.clip(np.digitize(table.truths.visib_fract, VISIBILITY_EDGES) - 1, 0, n_bins - 1)
    n_targets = np.bincount(which[counted], minlength=n_bins)
    columns: dict[str, NDArray[np.generic]] = {
        "visib_from": VISIBILITY_EDGES[:-1],
        "visib_to": VISIBILITY_EDGES[1:],
        "n_targets": n_targets,
    }
    for key, one in scored.items():
        found = np.bincount(which[counted], weights=one.found_fraction()[counted], minlength=n_bins)
        with np.errstate(invalid="ignore"):
            columns[f"recall_{key}"] = np.where(n_targets > 0, found / n_targets, np.nan)
    return Breakdown("visibility", columns)
