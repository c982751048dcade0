"""Score results: the one entry that the library, the command line and the server share."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from sixd.datasets.dataset import Dataset
from sixd.datasets.opening import open_dataset
from sixd.datasets.targets import Targets
from sixd.errors import FormatError, UsageError
from sixd.evaluation.evaluation import Evaluation, Provenance
from sixd.evaluation.foreign import refuse_foreign_name, refuse_foreign_rows
from sixd.evaluation.inputs import CocoInputs, PoseInputs, read_inputs
from sixd.evaluation.measure import Progress, measure, no_progress
from sixd.evaluation.prepared import PreparedModels
from sixd.evaluation.protocol import EvalProtocol, get_protocol
from sixd.evaluation.scores import score
from sixd.evaluation.selection import select
from sixd.evaluation.timing import average_times_s
from sixd.files import sha256_of
from sixd.results.lint import check_file, check_table
from sixd.results.tables import Detections, PoseEstimates, Table
from sixd.version import __version__


def evaluate(
    results: str | Path | Table,
    dataset: str | Path | Dataset,
    protocol: str | EvalProtocol = "bop19-localization",
    *,
    targets: str | Path | Targets | None = None,
    errors: Iterable[str] | None = None,
    workers: int | None = None,
    progress: Progress = no_progress,
) -> Evaluation:
    """Score pose estimates or 2D detections under a protocol.

    Args:
        results: a results file, or the table itself.
        dataset: a folder, or an open `Dataset`.
        protocol: name of a protocol (``sixd protocols`` lists them) or a protocol.
        targets: another list of targets than the protocol's: a path, or a file of the dataset.
        errors: measure only these errors of the protocol; without all of them there is no
            headline score.
        workers: threads; all cores by default. They change no number.
        progress: told (what, done, total) as work proceeds.

    Raises:
        UsageError: unknown protocol or error; results of another kind or another dataset.
        MissingDataError: files of the dataset are missing (all are named, before any work).
        FormatError: results or dataset files break their format; carries all problems.
    """
    return evaluate_all(
        [results], dataset, protocol, targets=targets, errors=errors, workers=workers,
        progress=progress,
    )[0]  # fmt: skip


def evaluate_all(
    results: Iterable[str | Path | Table],
    dataset: str | Path | Dataset,
    protocol: str | EvalProtocol = "bop19-localization",
    *,
    targets: str | Path | Targets | None = None,
    errors: Iterable[str] | None = None,
    workers: int | None = None,
    progress: Progress = no_progress,
) -> list[Evaluation]:
    """`evaluate` for several results; models and truth are read once."""
    results = list(results)
    opened = dataset if isinstance(dataset, Dataset) else open_dataset(dataset)
    for one in results:  # the cheapest mistakes are told first
        if not isinstance(one, PoseEstimates | Detections):
            refuse_foreign_name(Path(one), opened)
    evaluator = Evaluator(
        opened, protocol, targets=targets, errors=errors, workers=workers, progress=progress
    )
    return [evaluator.score(one) for one in results]


class Evaluator:
    """Scores many results on one dataset, or one result that arrives in batches.

    ::

        evaluator = sixd.Evaluator("path/to/dataset", "bop19-localization")
        for batch in training_loop:
            evaluator.add(batch)        # PoseEstimates
        print(evaluator.compute().scores["AR"])

    Truth and models are read once, when it is made; it raises what `evaluate` raises.
    """

    def __init__(
        self,
        dataset: str | Path | Dataset,
        protocol: str | EvalProtocol = "bop19-localization",
        *,
        targets: str | Path | Targets | None = None,
        errors: Iterable[str] | None = None,
        workers: int | None = None,
        progress: Progress = no_progress,
    ) -> None:
        self.full_protocol = get_protocol(protocol)
        self.protocol = self.full_protocol
        if isinstance(errors, str):
            errors = errors.split(",")
        if errors is not None:
            self.protocol = self.full_protocol.with_errors(tuple(errors))
        self.dataset = dataset if isinstance(dataset, Dataset) else open_dataset(dataset)
        self.inputs = read_inputs(self.dataset, self.protocol, targets)
        self.workers = workers or os.cpu_count() or 1
        self.progress = progress
        self._models = PreparedModels(self.dataset)
        self._batches: list[Table] = []

    def add(self, batch: Table) -> None:
        """Add a batch of results; nothing is computed yet.

        Raises:
            UsageError: the protocol scores results of another kind.
        """
        self._check_kind(batch, "this batch")
        self._batches.append(batch)

    def compute(self) -> Evaluation:
        """Score everything that was added so far; more may be added afterwards.

        Raises:
            UsageError: nothing was added, or it is for another dataset.
            FormatError: broken rows; carries all of them.
        """
        if not self._batches:
            raise UsageError("nothing to score: add() results before compute()")
        if self.protocol.kind == "pose":
            poses = [b for b in self._batches if isinstance(b, PoseEstimates)]
            return self.score(PoseEstimates.concatenate(poses))
        boxes = [b for b in self._batches if isinstance(b, Detections)]
        return self.score(Detections.concatenate(boxes))

    def reset(self) -> None:
        """Forget what was added; truth and models stay."""
        self._batches.clear()

    def score(self, results: str | Path | Table) -> Evaluation:
        """Score one complete submission: a file or a table.

        Raises:
            UsageError: results of another kind, or for another dataset.
            FormatError: broken rows; carries all of them.
        """
        if isinstance(results, PoseEstimates | Detections):
            file, digest, report = "", sha256_of_table(results), check_table(results)
        else:
            refuse_foreign_name(Path(results), self.dataset)
            file, report = str(results), check_file(results)
            digest = sha256_of(results)
        table = report.table
        if table is not None:
            self._check_kind(table, file or "the table")
        if table is None or not report.ok:
            raise FormatError([p for p in report.problems if p.severity == "error"])
        provenance = Provenance(
            file, digest, self.inputs.sha256, self.inputs.targets.file, __version__
        )
        if isinstance(table, Detections):
            return self._score_detections(table, provenance)
        return self._score_poses(table, provenance)

    def _score_poses(self, estimates: PoseEstimates, provenance: Provenance) -> Evaluation:
        assert isinstance(self.inputs, PoseInputs)
        targets, truth = self.inputs.targets, self.inputs.truth
        objects = self.dataset.object_ids
        refuse_foreign_rows(estimates, self.dataset, targets, objects, provenance.results_file)
        cap = self.dataset.spec.max_estimates_per_image if self.protocol.cap_estimates else None
        selection = select(estimates, truth, targets, self.protocol, cap)
        timed = estimates.where(selection.within_cap)
        times_s = average_times_s(
            (timed.scene_id, timed.im_id), timed.time_s, (targets.scene_id, targets.im_id)
        )
        table = measure(
            selection, estimates, truth, self._models, self.protocol,
            workers=self.workers, progress=self.progress,
        )  # fmt: skip
        scored = score(table, self.protocol)
        return Evaluation(
            **self._common(provenance, selection.n_targets),
            scores=scored.values,
            breakdowns=scored.breakdowns,
            average_time_per_image=times_s[0],
            average_time_per_target_image=times_s[1],
            n_without_estimate=selection.n_without_estimate,
            n_estimates=len(estimates),
            ignored=selection.ignored,
            table=table,
        )

    def _score_detections(self, detections: Detections, provenance: Provenance) -> Evaluation:
        from sixd.evaluation.coco_summary import coco_breakdowns
        from sixd.evaluation.detection2d import coco_scores

        assert isinstance(self.inputs, CocoInputs)
        truth = self.inputs.truth
        categories = tuple(truth.category_id.tolist())
        refuse_foreign_rows(
            detections, self.dataset, self.inputs.targets, categories, provenance.results_file
        )
        scored = coco_scores(detections, truth, "segm" if self.protocol.kind == "segm" else "bbox")
        return Evaluation(
            **self._common(provenance, scored.n_truths),
            scores=scored.scores,
            breakdowns=coco_breakdowns(scored),
            average_time_per_image=scored.average_time_per_image_s,
            average_time_per_target_image=scored.average_time_per_target_image_s,
            n_without_estimate=scored.n_truths_without_detection,
            n_estimates=len(detections),
            ignored={
                "not_a_target_image": scored.n_off_target,
                "unknown_category": scored.n_unknown_category,
                "without_shape": scored.n_without_shape,
                "beyond_100": scored.n_beyond_100,
            },
        )

    def _common(self, provenance: Provenance, n_targets: int) -> dict[str, Any]:
        measured = {e.key for e in self.protocol.errors}
        left_out = [e.key for e in self.full_protocol.errors if e.key not in measured]
        notes: tuple[str, ...] = ()
        if left_out:
            lacks_headline = set(left_out) & set(self.full_protocol.headline)
            so = f", so there is no {self.protocol.score}" if lacks_headline else ""
            notes = (f"{', '.join(left_out)} was left out as asked{so}",)
        if not n_targets:
            notes += (
                "no instance is to be found in the target images, so the scores mean nothing",
            )
        return {
            "protocol": self.protocol.id,
            "dataset": self.dataset.name,
            "split": self.dataset.split,
            "errors_measured": tuple(e.key for e in self.protocol.errors),
            "n_targets": n_targets,
            "provenance": provenance,
            "notes": notes,
        }

    def _check_kind(self, table: Table, what: str) -> None:
        if not isinstance(table, PoseEstimates | Detections):
            raise UsageError(
                f"{what} must be PoseEstimates or Detections, got {type(table).__name__}; "
                "files are read by sixd.read_results"
            )
        is_pose = isinstance(table, PoseEstimates)
        if is_pose != (self.protocol.kind == "pose"):
            kinds = ("6D poses", "2D detections")
            raise UsageError(
                f"{self.protocol.name} scores {kinds[self.protocol.kind != 'pose']}, but {what} "
                f"holds {kinds[not is_pose]}; choose another --protocol (sixd protocols lists them)"
            )


def sha256_of_table(table: Table) -> str:
    """Hex digest of a table's columns, for results that never were a file."""
    digest = hashlib.sha256()
    for name in ("scene_id", "im_id", "obj_id", "score", "time_s"):
        digest.update(np.ascontiguousarray(getattr(table, name)).tobytes())
    if isinstance(table, PoseEstimates):
        digest.update(np.ascontiguousarray(table.R).tobytes())
        digest.update(np.ascontiguousarray(table.t_mm).tobytes())
    else:
        digest.update(np.ascontiguousarray(table.bbox_xywh_px).tobytes())
        digest.update(repr(table.segmentation).encode())
    return digest.hexdigest()
