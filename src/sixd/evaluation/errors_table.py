"""The table of errors: measured once, scored often. It needs no dataset to be scored again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Groups:
    """``(G,)`` objects in images, in processing order."""

    scene_id: Ints
    im_id: Ints
    obj_id: Ints
    n_wanted: Ints
    """Instances to be found."""
    diameter_mm: Floats
    px_scale: Floats
    """640 / image width: MSPD thresholds are stated for images 640 px wide."""


@dataclass(frozen=True)
class EstimateRows:
    """``(E,)`` estimates that play a part, ordered by group, then best score first."""

    group: Ints
    row: Ints
    """Row in the results file, from 0."""
    score: Floats


@dataclass(frozen=True)
class TruthRows:
    """``(T,)`` instances of the groups, ordered by group, then gt_id."""

    group: Ints
    gt_id: Ints
    visib_fract: Floats
    matchable: Bools
    counted: Bools


@dataclass(frozen=True)
class Pairs:
    """``(P,)`` every estimate with every instance of its group, in that order."""

    estimate: Ints
    truth: Ints


@dataclass(frozen=True)
class ErrorTable:
    """Errors of all pairs of an estimate and an instance of the same object in the same image."""

    groups: Groups
    estimates: EstimateRows
    truths: TruthRows
    pairs: Pairs
    errors: Mapping[str, Floats]
    """Raw errors: ``mssd_mm (P,)``, ``mspd_px (P,)``, ``vsd (P, T)``, ``add_mm`` ... by name."""

    @property
    def pair_group(self) -> Ints:
        """``(P,)`` group of each pair."""
        return self.estimates.group[self.pairs.estimate]

    def check(self) -> None:
        """Raise `ValueError` unless columns have equal lengths and indices point to rows."""
        n = {}
        for part in ("groups", "estimates", "truths", "pairs"):
            record = getattr(self, part)
            lengths = {getattr(record, f.name).shape for f in fields(record)}
            if len(lengths) != 1 or len(shape := lengths.pop()) != 1:
                raise ValueError(f"columns of {part} have different lengths")
            n[part] = shape[0]
        indices = (
            (self.estimates.group, "groups"),
            (self.truths.group, "groups"),
            (self.pairs.estimate, "estimates"),
            (self.pairs.truth, "truths"),
        )
        for index, part in indices:
            if index.dtype.kind != "i" or (
                len(index) and not 0 <= index.min() <= index.max() < n[part]
            ):
                raise ValueError(f"an index into {part} points outside")
        if any(len(values) != n["pairs"] for values in self.errors.values()):
            raise ValueError("columns of errors have different lengths")

    def to_columns(self) -> dict[str, NDArray[np.generic]]:
        """All columns by dotted name, as they are saved."""
        columns: dict[str, NDArray[np.generic]] = {}
        for part in ("groups", "estimates", "truths", "pairs"):
            record = getattr(self, part)
            columns |= {f"{part}.{f.name}": getattr(record, f.name) for f in fields(record)}
        return columns | {f"errors.{name}": values for name, values in self.errors.items()}

    @classmethod
    def from_columns(cls, columns: Mapping[str, NDArray[np.generic]]) -> ErrorTable:
        """The inverse of `to_columns`."""

        def record(kind: type, part: str) -> object:
            return kind(**{f.name: columns[f"{part}.{f.name}"] for f in fields(kind)})

        errors = {n.removeprefix("errors."): v for n, v in columns.items() if n[:7] == "errors."}
        return cls(
            record(Groups, "groups"),  # type: ignore[arg-type]
            record(EstimateRows, "estimates"),  # type: ignore[arg-type]
            record(TruthRows, "truths"),  # type: ignore[arg-type]
            record(Pairs, "pairs"),  # type: ignore[arg-type]
            errors,  # type: ignore[arg-type]
        )

    def to_rows(self) -> dict[str, NDArray[np.generic]]:
        """One row per pair with ids, score and errors: the form that is exported for analysis."""
        group = self.pair_group
        est, gt = self.pairs.estimate, self.pairs.truth
        rows: dict[str, NDArray[np.generic]] = {
            "scene_id": self.groups.scene_id[group],
            "im_id": self.groups.im_id[group],
            "obj_id": self.groups.obj_id[group],
            "estimate_row": self.estimates.row[est],
            "score": self.estimates.score[est],
            "gt_id": self.truths.gt_id[gt],
            "visib_fract": self.truths.visib_fract[gt],
            "counted": self.truths.counted[gt],
            "diameter_mm": self.groups.diameter_mm[group],
        }
        for name, values in self.errors.items():
            if values.ndim == 1:
                rows[name] = values
            else:
                rows |= {f"{name}_{i}": values[:, i] for i in range(values.shape[1])}
        return rows


def all_pairs(estimate_group: Ints, truth_group: Ints, n_groups: int) -> Pairs:
    """Every estimate with every instance of its group, estimate by estimate.

    Args:
        estimate_group: ``(E,)`` ascending.
        truth_group: ``(T,)`` ascending.
        n_groups: number of groups.
    """
    n_truths = np.bincount(truth_group, minlength=n_groups)
    first_truth = np.cumsum(n_truths) - n_truths
    repeats = n_truths[estimate_group]
    estimate = np.repeat(np.arange(len(estimate_group)), repeats)
    first_pair = np.cumsum(repeats) - repeats
    within = np.arange(len(estimate)) - first_pair[estimate]
    return Pairs(estimate, first_truth[estimate_group[estimate]] + within)
