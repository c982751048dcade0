"""Measure every error of a protocol once, on all cores."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sixd.datasets.dataset import Dataset
from sixd.datasets.truth import GroundTruth
from sixd.evaluation.errors_table import (
    ErrorTable,
    EstimateRows,
    Groups,
    Pairs,
    TruthRows,
    all_pairs,
)
from sixd.evaluation.prepared import PreparedModels
from sixd.evaluation.protocol import EvalProtocol
from sixd.evaluation.scores import table_column
from sixd.evaluation.selection import Selection
from sixd.geometry.pose import Pose
from sixd.metrics.reference import within_reach
from sixd.results.tables import PoseEstimates
from sixd.rows import rows_of_each

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]
Progress = Callable[[str, int, int], None]
"""Called with (what, done, total) as work proceeds; drawing is the caller's business."""

CHUNK = 2048
MSPD_WIDTH_PX = 640


def no_progress(what: str, done: int, total: int) -> None:
    """Report nothing."""


@dataclass(frozen=True)
class _Job:
    """Everything the workers read. They write into disjoint rows of ``errors``."""

    models: PreparedModels
    protocol: EvalProtocol
    est: Pose
    """``(P,)`` the estimate of each pair."""
    gt: Pose
    scene_id: Ints
    im_id: Ints
    obj_id: Ints
    within_reach: NDArray[np.bool_]
    errors: dict[str, Floats]


def measure(
    selection: Selection,
    estimates: PoseEstimates,
    truth: GroundTruth,
    models: PreparedModels,
    protocol: EvalProtocol,
    *,
    workers: int = 1,
    progress: Progress = no_progress,
) -> ErrorTable:
    """Errors of every estimate against every instance of its object in its image.

    Args:
        selection: which estimates and instances take part.
        estimates: the table that ``selection`` was made from.
        truth: likewise.
        models: what is prepared per object of the dataset; keep it for the next batch.
        protocol: which errors.
        workers: threads.
        progress: told after each piece of work.
    """
    pairs = all_pairs(selection.estimate_group, selection.truth_group, len(selection.obj_id))
    est = estimates.pose_c_m[selection.estimate_rows[pairs.estimate]]
    gt = truth.pose_c_m[selection.truth_rows[pairs.truth]]
    groups = _groups(selection, models.dataset)
    group = selection.estimate_group[pairs.estimate]
    job = _Job(
        models=models,
        protocol=protocol,
        est=est,
        gt=gt,
        scene_id=selection.scene_id[group],
        im_id=selection.im_id[group],
        obj_id=selection.obj_id[group],
        within_reach=(
            within_reach(est, gt, groups.diameter_mm[group])
            if protocol.reach_check
            else np.ones(len(group), bool)
        ),
        errors=_empty_errors(protocol, len(group)),
    )
    _run(job, pairs, selection, estimates, truth, workers, progress)
    return ErrorTable(
        groups,
        EstimateRows(
            selection.estimate_group,
            selection.estimate_rows,
            estimates.score[selection.estimate_rows],
        ),
        TruthRows(
            selection.truth_group,
            truth.gt_id[selection.truth_rows],
            truth.visib_fract[selection.truth_rows],
            selection.truth_matchable,
            selection.truth_counted,
        ),
        pairs,
        job.errors,
    )


def _groups(selection: Selection, dataset: Dataset) -> Groups:
    objects, obj = np.unique(selection.obj_id, return_inverse=True)
    scenes, scene = np.unique(selection.scene_id, return_inverse=True)
    has_truth = np.isin(objects, selection.obj_id[selection.truth_group])
    # Objects that only estimates name are never compared with a truth and need no model.
    diameter_mm = np.array(
        [
            dataset.model(int(o)).diameter_mm if known else np.nan
            for o, known in zip(objects, has_truth, strict=True)
        ]
    )
    width_px = np.array([dataset.image_size_of(int(s))[0] for s in scenes], float)
    return Groups(
        selection.scene_id,
        selection.im_id,
        selection.obj_id,
        selection.n_wanted,
        diameter_mm[obj] if len(objects) else np.zeros(0),
        (MSPD_WIDTH_PX / width_px)[scene] if len(scenes) else np.zeros(0),
    )


def _empty_errors(protocol: EvalProtocol, n_pairs: int) -> dict[str, Floats]:
    errors: dict[str, Floats] = {}
    for spec in protocol.errors:
        shape = (n_pairs, len(spec.taus)) if spec.name == "vsd" else (n_pairs,)
        errors[table_column(spec.name)] = np.full(shape, np.inf)
    return errors


def _run(
    job: _Job,
    pairs: Pairs,
    selection: Selection,
    estimates: PoseEstimates,
    truth: GroundTruth,
    workers: int,
    progress: Progress,
) -> None:
    with ThreadPoolExecutor(max(workers, 1)) as pool:
        waiting: dict[Future[None], int] = {}
        if any(spec.name != "vsd" for spec in job.protocol.errors):
            waiting |= {
                pool.submit(_measure_object, job, obj_id, rows): len(rows)
                for obj_id, rows in _by_object(job.obj_id)
            }
        if job.protocol.needs_depth:
            from sixd.evaluation.measure_vsd import VsdTask

            task = VsdTask(
                job.models, job.protocol, selection, pairs, estimates, truth, job.errors["vsd"]
            )
            waiting |= {pool.submit(task.measure_image, g, r): len(r) for g, r in task.images()}
        total, done = sum(waiting.values()), 0
        progress("measuring errors", 0, total)
        try:
            for future in as_completed(waiting):
                future.result()
                done += waiting[future]
                progress("measuring errors", done, total)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _by_object(obj_id: Ints) -> Iterator[tuple[int, Ints]]:
    for obj, rows in rows_of_each(obj_id):
        for start in range(0, len(rows), CHUNK):
            yield obj, rows[start : start + CHUNK]


def _measure_object(job: _Job, obj_id: int, rows: Ints) -> None:
    """Fill the rows of one object in every column but VSD."""
    from sixd.metrics import fast

    dataset = job.models.dataset
    cells = job.models.cells(obj_id)
    symmetries = dataset.model(obj_id).symmetries.transforms()
    near = rows[job.within_reach[rows]]
    for name in dict.fromkeys(spec.name for spec in job.protocol.errors if spec.name != "vsd"):
        column = job.errors[table_column(name)]
        if name == "mssd":
            column[near] = fast.mssd(job.est[near], job.gt[near], cells, symmetries)
        elif name == "mspd":
            images = zip(job.scene_id[rows].tolist(), job.im_id[rows].tolist(), strict=True)
            cameras = [dataset.cameras(scene_id)[im_id].camera for scene_id, im_id in images]
            column[rows] = fast.mspd_cameras(
                job.est[rows], job.gt[rows], cells, symmetries, cameras
            )
        elif name == "ad" and {"add_mm", "adi_mm"} <= job.errors.keys():
            same = "adi_mm" if dataset.is_symmetric(obj_id) else "add_mm"  # measured just before
            column[near] = job.errors[same][near]
        else:
            is_adi = name == "adi" or (name == "ad" and dataset.is_symmetric(obj_id))
            column[near] = (fast.adi if is_adi else fast.add)(job.est[near], job.gt[near], cells)
