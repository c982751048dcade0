"""Score results: the one entry that the library, the command line and the server share."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from sixd.datasets.dataset import Dataset
from sixd.datasets.models import some
from sixd.datasets.opening import open_dataset
from sixd.datasets.preflight import Need, find_missing
from sixd.datasets.spec import known_datasets
from sixd.datasets.targets import Targets
from sixd.datasets.truth import dataset_hash, read_truth
from sixd.errors import FormatError, MissingDataError, UsageError
from sixd.evaluation.coco_truth import coco_truth_hash, read_coco_truth
from sixd.evaluation.evaluation import Evaluation, Provenance
from sixd.evaluation.keys import find_rows
from sixd.evaluation.measure import Progress, measure, no_progress
from sixd.evaluation.prepared import PreparedModels
from sixd.evaluation.protocol import EvalProtocol, get_protocol
from sixd.evaluation.scores import score
from sixd.evaluation.selection import keep_best_per_image, select
from sixd.evaluation.timing import (
    average_time_all_targets_s,
    average_time_s,
    time_of_each_image,
)
from sixd.files import sha256_of
from sixd.results.limits import Limits
from sixd.results.lint import check_file, check_table
from sixd.results.source import open_results_text
from sixd.results.tables import Detections, PoseEstimates
from sixd.version import __version__

MOST_UNKNOWN = 0.1
"""Results with a larger share of unknown scenes or objects are taken to be for another dataset."""

Results = PoseEstimates | Detections


def evaluate(
    results: str | Path | Results,
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
        workers: threads; all cores by default.
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
    results: Iterable[str | Path | Results],
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
            _refuse_foreign_name(Path(one), opened)
    evaluator = Evaluator(
        opened, protocol, targets=targets, errors=errors, workers=workers, progress=progress
    )
    return [evaluator.score(one) for one in results]


class Evaluator:
    """Scores many results on one dataset, or one result that arrives in batches.

    ::

        evaluator = sixd.Evaluator("lmo", "bop19-localization")
        for batch in training_loop:
            evaluator.add(batch)        # PoseEstimates
        print(evaluator.compute().scores["AR"])
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
        if errors is not None:
            self.protocol = self.full_protocol.with_errors(tuple(errors))
        self.dataset = dataset if isinstance(dataset, Dataset) else open_dataset(dataset)
        self.targets = self._read_targets(targets)
        self.workers = workers or os.cpu_count() or 1
        self.progress = progress
        self._batches: list[Results] = []
        self._models = PreparedModels(self.dataset)
        self._preflight()

    def add(self, batch: Results) -> None:
        """Add a batch of results; nothing is computed yet."""
        self._check_kind(batch, "this batch")
        self._batches.append(batch)

    def compute(self) -> Evaluation:
        """Score everything that was added so far; more may be added afterwards."""
        if self.protocol.kind == "pose":
            poses = [b for b in self._batches if isinstance(b, PoseEstimates)]
            return self.score(PoseEstimates.concatenate(poses))
        boxes = [b for b in self._batches if isinstance(b, Detections)]
        return self.score(Detections.concatenate(boxes))

    def reset(self) -> None:
        """Forget what was added; truth and models stay."""
        self._batches.clear()

    def score(self, results: str | Path | Results) -> Evaluation:
        """Score one complete submission: a file or a table.

        Raises:
            UsageError: results of another kind, or for another dataset.
            FormatError: broken rows; carries all of them.
        """
        if isinstance(results, PoseEstimates | Detections):
            file, digest, report = "", sha256_of_table(results), check_table(results)
        else:
            _refuse_foreign_name(Path(results), self.dataset)
            file, report = str(results), check_file(results)
            digest = sha256_of(results)
        table = report.table
        if table is not None:
            self._check_kind(table, file or "the table")
        if table is None or not report.ok:
            raise FormatError([p for p in report.problems if p.severity == "error"])
        provenance = Provenance(file, digest, self._dataset_sha256, self.targets.file, __version__)
        if isinstance(table, Detections):
            return self._score_detections(table, provenance)
        return self._score_poses(table, provenance)

    def _score_poses(self, estimates: PoseEstimates, provenance: Provenance) -> Evaluation:
        cap = self.dataset.spec.max_estimates_per_image if self.protocol.cap_estimates else None
        selection = select(estimates, self._truth, self.targets, self.protocol, cap)
        self._refuse_foreign(estimates, provenance.results_file)
        scored_rows = estimates
        if cap is not None:
            scored_rows = estimates.where(keep_best_per_image(estimates, cap))
        times = self._times(scored_rows)
        table = measure(
            selection, estimates, self._truth, self._models, self.protocol,
            workers=self.workers, progress=self.progress,
        )  # fmt: skip
        scored = score(table, self.protocol)
        return Evaluation(
            **self._common(provenance),
            scores=scored.values,
            breakdowns=scored.breakdowns,
            average_time_per_image=times[0],
            average_time_per_target_image=times[1],
            n_targets=selection.n_targets,
            n_without_estimate=selection.n_without_estimate,
            n_estimates=len(estimates),
            ignored=selection.ignored,
            table=table,
        )

    def _score_detections(self, detections: Detections, provenance: Provenance) -> Evaluation:
        from sixd.evaluation.coco_curves import IouType
        from sixd.evaluation.coco_summary import coco_breakdowns
        from sixd.evaluation.detection2d import coco_scores

        self._refuse_foreign(detections, provenance.results_file)
        iou_type: IouType = "segm" if self.protocol.kind == "segm" else "bbox"
        scored = coco_scores(detections, self._coco_truth, iou_type)
        return Evaluation(
            **self._common(provenance),
            scores=scored.scores,
            breakdowns=coco_breakdowns(scored),
            average_time_per_image=scored.average_time_per_image_s,
            average_time_per_target_image=scored.average_time_per_target_image_s,
            n_targets=scored.n_truths,
            n_without_estimate=scored.n_truths_without_detection,
            n_estimates=len(detections),
            ignored={
                "not_a_target_image": scored.n_off_target,
                "unknown_category": scored.n_unknown_category,
                "without_shape": scored.n_without_shape,
                "beyond_100": scored.n_beyond_100,
            },
        )

    def _common(self, provenance: Provenance) -> dict[str, Any]:
        measured = {e.key for e in self.protocol.errors}
        left_out = [e.key for e in self.full_protocol.errors if e.key not in measured]
        notes: tuple[str, ...] = ()
        if left_out:
            lacks_headline = set(left_out) & set(self.full_protocol.headline)
            so = f", so there is no {self.protocol.score}" if lacks_headline else ""
            notes = (f"{', '.join(left_out)} was left out as asked{so}",)
        return {
            "protocol": self.protocol.id,
            "dataset": self.dataset.name,
            "split": self.dataset.split,
            "errors_measured": tuple(e.key for e in self.protocol.errors),
            "provenance": provenance,
            "notes": notes,
        }

    def _times(self, estimates: PoseEstimates) -> tuple[float, float]:
        """Average time per image of the results, and per target image."""
        images = self.targets.images
        on_target = (
            find_rows((estimates.scene_id, estimates.im_id), (images[:, 0], images[:, 1])) >= 0
        )
        times_s = time_of_each_image(estimates.scene_id, estimates.im_id, estimates.time_s)
        some = estimates.where(on_target)
        target_times_s = (
            None if times_s is None else time_of_each_image(some.scene_id, some.im_id, some.time_s)
        )
        return average_time_s(times_s), average_time_all_targets_s(target_times_s, len(images))

    # --- reading and refusing ---

    def _read_targets(self, targets: str | Path | Targets | None) -> Targets:
        if isinstance(targets, Targets):
            return targets
        return self.dataset.targets(self.protocol.targets_file if targets is None else targets)

    def _preflight(self) -> None:
        """Read the truth, and name everything that is missing before any error is measured."""
        images = self.targets.images
        scene_id, im_id = images[:, 0], images[:, 1]
        scenes = sorted(set(scene_id.tolist()))
        if self.protocol.kind != "pose":
            self._coco_truth = read_coco_truth(
                self.dataset,
                self.targets,
                masks=self.protocol.kind == "segm",
                modal=self.protocol.modal_boxes,
            )
            self._dataset_sha256 = coco_truth_hash(self.dataset, scenes)
            return
        needs: list[Need] = ["camera", "truth", "gt_info"]
        if self.protocol.needs_depth:
            needs.append("depth")
        problems = find_missing(self.dataset, scene_id, im_id, (), needs)
        if not problems:
            self._truth = read_truth(self.dataset, scenes)
        obj_ids = self._objects(problems == [])
        none = scene_id[:0]
        problems += find_missing(self.dataset, none, none, obj_ids, ("models_info", "meshes"))
        if problems:
            raise MissingDataError.of(problems)
        self._truth.require_images(scene_id, im_id)
        self._dataset_sha256 = dataset_hash(self.dataset, scenes, obj_ids=obj_ids)

    def _objects(self, truth_is_read: bool) -> set[int]:
        """Objects whose models are needed, as far as it can be told yet."""
        if self.targets.obj_id is not None and self.protocol.task != "detection":
            return set(self.targets.obj_id.tolist())
        if not truth_is_read:
            return set()
        images = self.targets.images
        truth_image = (self._truth.scene_id, self._truth.im_id)
        on_target = find_rows(truth_image, (images[:, 0], images[:, 1])) >= 0
        return set(self._truth.obj_id[on_target].tolist())

    def _check_kind(self, table: Results, what: str) -> None:
        is_pose = isinstance(table, PoseEstimates)
        if is_pose != (self.protocol.kind == "pose"):
            kinds = ("6D poses", "2D detections")
            raise UsageError(
                f"{self.protocol.name} scores {kinds[self.protocol.kind != 'pose']}, but {what} "
                f"holds {kinds[not is_pose]}; choose another --protocol (sixd protocols lists them)"
            )

    def _refuse_foreign(self, table: Results, file: str) -> None:
        """Refuse results most of which name scenes or objects that the dataset does not have."""
        if not len(table):
            return
        scenes, objects = self.dataset.scene_ids, self.dataset.object_ids
        unknown = ~(np.isin(table.scene_id, scenes) & np.isin(table.obj_id, objects))
        images = self.targets.images
        on_target = find_rows((table.scene_id, table.im_id), (images[:, 0], images[:, 1])) >= 0
        if unknown.mean() > MOST_UNKNOWN or not on_target.any():
            raise UsageError(
                f"{file or 'the results'}: {unknown.sum()} of {len(table)} rows name a scene or "
                f"object that {self.dataset.name} ({self.dataset.split}) does not have, and "
                f"{on_target.sum()} are in a target image; are they for another dataset?\n"
                f"    expected: scenes {some(scenes)}; objects {some(objects)}\n"
                f"    got: scenes {some(sorted(set(table.scene_id.tolist())))}; "
                f"objects {some(sorted(set(table.obj_id.tolist())))}"
            )


def _refuse_foreign_name(path: Path, dataset: Dataset) -> None:
    """Refuse a file that is not there, or whose BOP-style name is of another known dataset."""
    if not path.is_file():
        raise MissingDataError(f"no results file at {path}")
    named = re.match(r"[^_]*_([a-z0-9]+)-", path.name)
    known = known_datasets()
    if named and dataset.name in known and named[1] in set(known) - {dataset.name}:
        raise UsageError(
            f"{path.name} is named as results for {named[1]}, not for {dataset.name}; "
            f"give --dataset {named[1]}, or rename the file if its name is wrong"
        )


def default_protocol(results: str | Path) -> str:
    """The protocol for results whose user names none, by what kind of file it is."""
    kind = open_results_text(results, Limits()).kind
    return "bop19-localization" if kind == "pose-csv" else "bop22-detection2d"


def sha256_of_table(table: Results) -> str:
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
