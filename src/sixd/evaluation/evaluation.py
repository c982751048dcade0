"""The outcome of an evaluation: scores, breakdowns, provenance and the errors behind them."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sixd.errors import FormatError, MissingDataError, Problem, UsageError, need
from sixd.evaluation.errors_table import ErrorTable
from sixd.evaluation.scores import Breakdown
from sixd.files import write_atomically

FORMAT = "sixd-evaluation"
FORMAT_VERSION = 1
MAX_BYTES = 1 << 30
"""Larger files are not inflated: they are no evaluations."""


@dataclass(frozen=True)
class Provenance:
    """Where a number comes from: two evaluations may be compared only if the truth is the same."""

    results_file: str
    results_sha256: str
    dataset_sha256: str
    """Of the ground truth, targets, model information and meshes that were used."""
    targets_file: str
    sixd_version: str


@dataclass(frozen=True)
class Evaluation:
    """Scores of one submission on one dataset under one protocol."""

    protocol: str
    """``name@version``."""
    dataset: str
    split: str
    errors_measured: tuple[str, ...]
    """Fewer than the protocol's where the user left some out; then there is no headline score."""
    scores: Mapping[str, float]
    breakdowns: Mapping[str, Breakdown]
    average_time_per_image: float
    """Seconds, over the images in the results, as the toolkit reports it; -1: unknown."""
    average_time_per_target_image: float
    """Seconds, over all target images; -1: unknown."""
    n_targets: int
    """Instances to be found."""
    n_without_estimate: int
    """Instances for which their image has no estimate: counted as misses."""
    n_estimates: int
    """Estimates in the results file."""
    ignored: Mapping[str, int]
    """Estimates that play no part, by reason."""
    provenance: Provenance
    notes: tuple[str, ...] = ()
    table: ErrorTable | None = None
    """None for 2D protocols."""

    def by(self, what: str) -> Breakdown:
        """The breakdown by ``object``, ``scene``, ``threshold`` or ``visibility``.

        Raises:
            UsageError: this evaluation has no such breakdown.
        """
        if what not in self.breakdowns:
            raise UsageError(
                f"no breakdown by {what!r}; this evaluation has {', '.join(self.breakdowns)}"
            )
        return self.breakdowns[what]

    def summary(self) -> dict[str, Any]:
        """What ``sixd eval --json`` prints: one flat record of plain values."""
        return {
            "protocol": self.protocol,
            "dataset": self.dataset,
            "split": self.split,
            "scores": dict(self.scores),
            "errors": list(self.errors_measured),
            "average_time_per_image": self.average_time_per_image,
            "average_time_per_target_image": self.average_time_per_target_image,
            "n_targets": self.n_targets,
            "n_without_estimate": self.n_without_estimate,
            "n_estimates": self.n_estimates,
            "ignored": dict(self.ignored),
            "notes": list(self.notes),
            "provenance": asdict(self.provenance),
        }

    def save(self, path: str | Path) -> Path:
        """Write everything to one file, atomically; the same evaluation gives the same bytes.

        A zip of ``evaluation.json`` and the columns of all tables as ``.npy``.

        Raises:
            UsageError: something else than an evaluation is there.
            OutputError: the folder cannot be written.
        """
        if Path(path).is_file() and not zipfile.is_zipfile(path):
            raise UsageError(f"{path} is there and is no evaluation: it is not overwritten")
        columns = self._columns()
        head = {"format": FORMAT, "format_version": FORMAT_VERSION} | self.summary()
        head["breakdowns"] = list(self.breakdowns)
        members = {"evaluation.json": json.dumps(head, indent=2).encode()}
        for name, values in columns.items():
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, np.ascontiguousarray(values), allow_pickle=False)
            members[f"{name}.npy"] = buffer.getvalue()
        return _write_zip(Path(path), members)

    def _columns(self) -> dict[str, NDArray[np.generic]]:
        columns = {
            f"by_{by}/{i:02d}.{name}": values
            for by, breakdown in self.breakdowns.items()
            for i, (name, values) in enumerate(breakdown.columns.items())
        }
        if self.table is not None:
            columns |= {f"table/{name}": v for name, v in self.table.to_columns().items()}
        return columns

    def export_errors(self, path: str | Path) -> Path:
        """Write one row per pair of an estimate and an instance, as ``.csv`` or ``.parquet``.

        Raises:
            MissingDataError: a 2D evaluation has no table of errors.
            MissingExtraError: parquet is asked for and polars is not installed.
            UsageError: another ending.
        """
        path = Path(path)
        if self.table is None:
            raise MissingDataError(f"{self.protocol} measures no pose errors, so none to export")
        rows = self.table.to_rows()
        head = (",".join(rows) + "\n").encode()
        if path.suffix == ".csv" and path.is_file() and not path.read_bytes().startswith(head):
            raise UsageError(f"{path} is there and holds something else: it is not overwritten")
        if path.suffix == ".parquet":
            frame = need("polars", "parquet").DataFrame(rows)
            buffer = io.BytesIO()
            frame.write_parquet(buffer)
            return write_atomically(path, buffer.getvalue())
        if path.suffix == ".csv":
            lines = [",".join(rows)]
            columns = [c.tolist() for c in rows.values()]
            lines += [",".join(map(str, row)) for row in zip(*columns, strict=True)]
            return write_atomically(path, ("\n".join(lines) + "\n").encode())
        raise UsageError(f"errors are exported as .csv or .parquet, got {path.name}")


def load_evaluation(path: str | Path) -> Evaluation:
    """Read what `Evaluation.save` wrote; needs no dataset.

    Raises:
        MissingDataError: no such file.
        FormatError: not a saved evaluation, or one of a later sixd.
    """
    path = Path(path)
    if not path.is_file():
        raise MissingDataError(f"no evaluation at {path}")
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(info.file_size for info in archive.infolist()) > MAX_BYTES:
                raise ValueError(f"it inflates to more than {MAX_BYTES} bytes")
            head = json.loads(archive.read("evaluation.json"))
            if head.get("format") != FORMAT:
                raise ValueError(f"format is {head.get('format')!r}")
            if head["format_version"] > FORMAT_VERSION:
                raise ValueError("it was written by a later sixd; upgrade sixd to read it")
            columns = {
                name.removesuffix(".npy"): _read_column(archive.read(name))
                for name in archive.namelist()
                if name.endswith(".npy")
            }
        evaluation = _from_parts(head, columns)
        _check_lengths(evaluation)
        return evaluation
    except Exception as error:  # a damaged file may fail in zip, zlib, JSON, NumPy or here
        problem = Problem(
            code="not-an-evaluation",
            what="is not an evaluation saved by sixd, or is damaged",
            file=str(path),
            expected="a file written by: sixd eval ... --out FILE",
            got=str(error) or type(error).__name__,
            fix="score the results again with sixd eval --out",
        )
        raise FormatError([problem]) from error


def _read_column(data: bytes) -> NDArray[np.generic]:
    column: NDArray[np.generic] = np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
    return column


def _check_lengths(evaluation: Evaluation) -> None:
    """Raise `ValueError` unless all columns of each table go together."""
    for by, breakdown in evaluation.breakdowns.items():
        if len({len(column) for column in breakdown.columns.values()}) != 1:
            raise ValueError(f"columns of the breakdown by {by} have different lengths")
    if evaluation.table is not None:
        evaluation.table.check()


def _from_parts(head: dict[str, Any], columns: Mapping[str, NDArray[np.generic]]) -> Evaluation:
    breakdowns = {}
    for by in head["breakdowns"]:
        part = f"by_{by}/"
        named = sorted((n.removeprefix(part), v) for n, v in columns.items() if n.startswith(part))
        breakdowns[by] = Breakdown(by, {n.partition(".")[2]: v for n, v in named})
    table = {n.removeprefix("table/"): v for n, v in columns.items() if n.startswith("table/")}
    return Evaluation(
        protocol=head["protocol"],
        dataset=head["dataset"],
        split=head["split"],
        errors_measured=tuple(head["errors"]),
        scores=head["scores"],
        breakdowns=breakdowns,
        average_time_per_image=head["average_time_per_image"],
        average_time_per_target_image=head["average_time_per_target_image"],
        n_targets=head["n_targets"],
        n_without_estimate=head["n_without_estimate"],
        n_estimates=head["n_estimates"],
        ignored=head["ignored"],
        provenance=Provenance(**head["provenance"]),
        notes=tuple(head["notes"]),
        table=ErrorTable.from_columns(table) if table else None,
    )


def _write_zip(path: Path, members: Mapping[str, bytes]) -> Path:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, data in members.items():
            info = zipfile.ZipInfo(name)  # its fixed date keeps the bytes reproducible
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            archive.writestr(info, data)
    return write_atomically(path, buffer.getvalue())
