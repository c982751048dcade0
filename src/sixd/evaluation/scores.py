"""Scores from the table of errors: recall, average precision, area under the accuracy curve."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

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
    statistic = {"recall": _Recall, "average-precision": _Precision, "auc": _Auc}[
        protocol.statistic
    ]
    scored = {e.key: statistic(table, e) for e in protocol.errors}
    prefix = PREFIX[protocol.statistic]
    groups = table.groups
    values: dict[str, float] = {}
    for key, one in scored.items():
        values[f"{prefix}_{key}"] = one.overall(protocol.average_over)
        if protocol.average_over == "instances" and protocol.statistic == "auc":
            values[f"{prefix}_{key}_object_mean"] = one.overall("objects")
    values = with_headline(values, protocol)
    breakdowns = {
        "object": _by_part(table, scored, protocol, "obj_id", groups.obj_id),
        "scene": _by_part(table, scored, protocol, "scene_id", groups.scene_id),
        "threshold": _by_threshold(scored, protocol),
        "visibility": _by_visibility(table, scored),
    }
    return Scores(values, breakdowns)


def with_headline(values: Mapping[str, float], protocol: EvalProtocol) -> dict[str, float]:
    """Put the mean of the headline scores first; left out unless all of them were measured."""
    keys = [f"{PREFIX[protocol.statistic]}_{h}" for h in protocol.headline]
    if not keys or any(k not in values for k in keys):
        return dict(values)
    return {protocol.score: float(np.mean([values[k] for k in keys])), **values}


class _Matched:
    """What every statistic starts from: the matches at all thresholds, and who was found."""

    def __init__(self, table: ErrorTable, spec: ErrorSpec) -> None:
        self.table, self.spec = table, spec
        errors = normalised(table, spec)
        self.thresholds = np.asarray(spec.thresholds)
        self.matched = match(table, errors, self.thresholds)
        self.flat = self.matched.reshape(-1, errors.shape[1] * len(spec.thresholds))
        """``(E, C * L)``"""
        self.counts = np.append(table.truths.counted, False)[self.flat]  # -1 is the appended one
        self.is_ignored = (self.flat >= 0) & ~self.counts

    def found_fraction(self) -> Floats:
        """``(T,)`` share of thresholds at which each instance is found."""
        found = np.bincount(self.flat[self.counts], minlength=len(self.table.truths.group))
        share: Floats = found / self.flat.shape[1]
        return share


class _Recall(_Matched):
    """Found instances over instances to be found, pooled over the dataset."""

    def levels(self, part: Ints, n_parts: int) -> Floats:
        """``(n_parts, C * L)`` recall of each part of the groups; NaN where nothing is wanted."""
        table = self.table
        n_wanted = np.bincount(part, weights=table.groups.n_wanted, minlength=n_parts)
        n_found = np.zeros((n_parts, self.flat.shape[1]))
        np.add.at(n_found, part[table.estimates.group], self.counts)
        with np.errstate(invalid="ignore", divide="ignore"):
            levels: Floats = np.where(n_wanted > 0, n_found.T / n_wanted, np.nan).T
        return levels

    def overall_levels(self) -> Floats:
        return self.levels(np.zeros(len(self.table.groups.obj_id), np.int64), 1)[0]

    def overall(self, average_over: str) -> float:
        if average_over == "objects":
            objects, part = np.unique(self.table.groups.obj_id, return_inverse=True)
            return mean_of_known(self.levels(part, len(objects)).mean(axis=1))
        return mean_of_known(self.overall_levels())


class _Precision(_Matched):
    """Average precision of each object, averaged over the objects that have targets."""

    def __init__(self, table: ErrorTable, spec: ErrorSpec) -> None:
        super().__init__(table, spec)
        objects, part = np.unique(table.groups.obj_id, return_inverse=True)
        self.object_levels = self._objects_of(part.astype(np.int64), len(objects))

    def levels(self, part: Ints, n_parts: int) -> Floats:
        """``(n_parts, C * L)`` AP within each part: mean over its objects that have targets."""
        obj_id = self.table.groups.obj_id
        objects, obj = np.unique(obj_id, return_inverse=True)
        cells = self._objects_of(part * len(objects) + obj, n_parts * len(objects))
        return mean_known_rows(cells.reshape(n_parts, len(objects), -1))

    def overall_levels(self) -> Floats:
        return mean_known_rows(self.object_levels[None])[0]

    def overall(self, average_over: str) -> float:
        return mean_of_known(self.object_levels.mean(axis=1))

    def _objects_of(self, part: Ints, n_parts: int) -> Floats:
        """``(n_parts, C * L)`` AP of one object in each part; NaN where it has no targets."""
        table = self.table
        n_wanted = np.bincount(part, weights=table.groups.n_wanted, minlength=n_parts)
        estimate_part = part[table.estimates.group]
        order = np.lexsort((-table.estimates.score, estimate_part))
        ends = np.searchsorted(estimate_part[order], np.arange(n_parts + 1))
        levels = np.full((n_parts, self.flat.shape[1]), np.nan)
        for p in np.flatnonzero(n_wanted > 0):
            rows = order[ends[p] : ends[p + 1]]
            levels[p] = average_precision(self.counts[rows], self.is_ignored[rows], n_wanted[p])
        return levels


class _Auc(_Matched):
    """Area under accuracy against threshold, from 0 to the one threshold of the error."""

    def __init__(self, table: ErrorTable, spec: ErrorSpec) -> None:
        super().__init__(table, spec)
        errors = normalised(table, spec)
        any_match = match(table, errors, np.array([np.inf]))[:, 0, 0]
        self.error_of_truth = np.full(len(table.truths.group), np.inf)
        chosen = any_match[table.pairs.estimate] == table.pairs.truth
        self.error_of_truth[table.pairs.truth[chosen]] = errors[chosen, 0]

    def levels(self, part: Ints, n_parts: int) -> Floats:
        """``(n_parts, 1)`` area of each part."""
        from sixd.metrics.reference import auc

        wanted = self.table.truths.counted
        truth_part = part[self.table.truths.group]
        areas = [
            auc(self.error_of_truth[wanted & (truth_part == p)], self.thresholds[0])
            if (wanted & (truth_part == p)).any()
            else np.nan
            for p in range(n_parts)
        ]
        return np.array(areas).reshape(n_parts, 1)

    def overall_levels(self) -> Floats:
        return self.levels(np.zeros(len(self.table.groups.obj_id), np.int64), 1)[0]

    def overall(self, average_over: str) -> float:
        if average_over == "objects":
            objects, part = np.unique(self.table.groups.obj_id, return_inverse=True)
            return mean_of_known(self.levels(part.astype(np.int64), len(objects))[:, 0])
        return mean_of_known(self.overall_levels())


def average_precision(
    is_true: NDArray[np.bool_], is_ignored: NDArray[np.bool_], n_wanted: float
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
    recall = n_true / n_wanted
    precision = n_true / np.maximum(n_shown, 1)
    best_from_here = np.maximum.accumulate(precision[::-1], axis=0)[::-1]
    padded = np.vstack([best_from_here, np.zeros(is_true.shape[1])])
    areas = [
        padded[np.searchsorted(recall[:, level], RECALL_LEVELS, side="left"), level].mean()
        for level in range(is_true.shape[1])
    ]
    return np.array(areas)


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
    scored: Mapping[str, _Recall | _Precision | _Auc],
    protocol: EvalProtocol,
    key_name: str,
    keys: Ints,
) -> Breakdown:
    parts, part = np.unique(keys, return_inverse=True)
    part, n = part.astype(np.int64), len(parts)
    columns: dict[str, NDArray[np.generic]] = {
        key_name: parts,
        "n_targets": np.bincount(part, weights=table.groups.n_wanted, minlength=n).astype(int),
        "n_estimates": np.bincount(part[table.estimates.group], minlength=n),
    }
    prefix = PREFIX[protocol.statistic]
    by_error = {k: one.levels(part, n).mean(axis=1) for k, one in scored.items()}
    if protocol.headline and all(h in by_error for h in protocol.headline):
        columns[protocol.score] = np.mean([by_error[h] for h in protocol.headline], axis=0)
    columns |= {f"{prefix}_{k}": v for k, v in by_error.items()}
    return Breakdown(key_name.removesuffix("_id").replace("obj", "object"), columns)


def _by_threshold(
    scored: Mapping[str, _Recall | _Precision | _Auc], protocol: EvalProtocol
) -> Breakdown:
    rows: list[tuple[str, float, float, str, float]] = []
    for key, one in scored.items():
        spec = one.spec
        taus = spec.taus or (np.nan,)
        places = [(tau, th) for tau in taus for th in spec.thresholds]
        rows += [
            (key, tau, th, spec.unit, float(v))
            for (tau, th), v in zip(places, one.overall_levels(), strict=True)
        ]
    error, tau, threshold, unit, value = zip(*rows, strict=True) if rows else ((),) * 5
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


def _by_visibility(
    table: ErrorTable, scored: Mapping[str, _Recall | _Precision | _Auc]
) -> Breakdown:
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
        found = np.bincount(
            which[counted], weights=one.found_fraction()[counted], minlength=n_bins
        )
        with np.errstate(invalid="ignore"):
            columns[f"recall_{key}"] = np.where(n_targets > 0, found / n_targets, np.nan)
    return Breakdown("visibility", columns)
