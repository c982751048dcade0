"""The truth of a dataset in the form of results: what a perfect method would hand in.

It scores exactly 1 in every protocol, which is the first test of any evaluation.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from sixd.datasets.annotate.coco import IGNORE_BELOW
from sixd.datasets.dataset import Dataset
from sixd.datasets.targets import Targets
from sixd.datasets.truth import GroundTruth, coco_truth_path, read_truth
from sixd.errors import FormatError, MissingDataError, Problem, UsageError
from sixd.results.tables import Detections, PoseEstimates, Rle

Kind = Literal["localization", "detection", "detection2d", "segmentation2d"]


def results_from_truth(
    dataset: Dataset, kind: Kind, targets: str | Path | None = None
) -> PoseEstimates | Detections:
    """The truth as results, every score 1, no times.

    Args:
        dataset: any dataset whose truth is there.
        kind: ``localization`` gives the instances that the target list asks for; ``detection``,
            ``detection2d`` and ``segmentation2d`` give all instances of the target images that
            are visible enough to count (a tenth).
        targets: target list; by default the split's bop19 list.

    Raises:
        UsageError: there is no such kind.
        MissingDataError: the target list, the truth, or (2D) ``scene_gt_coco.json`` is missing.
    """
    if kind not in get_args(Kind):
        raise UsageError(f"kind must be one of {', '.join(get_args(Kind))}, got {kind!r}")
    listed = dataset.targets(targets or f"{dataset.split}_targets_bop19.json")
    if kind in ("localization", "detection"):
        return poses_from_truth(dataset, listed, all_visible=kind == "detection")
    return detections_from_truth(dataset, listed, masks=kind == "segmentation2d")


def poses_from_truth(
    dataset: Dataset, targets: Targets, *, all_visible: bool = False
) -> PoseEstimates:
    """True poses of the targets, or (``all_visible``) of all countable instances in their images.

    Raises:
        MissingDataError: the truth is missing, or the list has no objects and counts to go by.
    """
    truth = read_truth(dataset, np.unique(targets.scene_id).tolist())
    rows = _visible_rows(truth, targets) if all_visible else _target_rows(truth, targets)
    return PoseEstimates.from_arrays(
        scene_id=truth.scene_id[rows],
        im_id=truth.im_id[rows],
        obj_id=truth.obj_id[rows],
        score=1.0,
        R=truth.R[rows],
        t_mm=truth.t_mm[rows],
    )


def detections_from_truth(dataset: Dataset, targets: Targets, *, masks: bool) -> Detections:
    """True amodal boxes, or (``masks``) true visible masks, of all countable instances.

    Raises:
        MissingDataError: a scene has no COCO annotations.
        FormatError: they are not such annotations.
    """
    from sixd.datasets.jsonfiles import read_json

    wanted = set(map(tuple, targets.images.tolist()))
    rows = []
    for scene_id in dict.fromkeys(targets.scene_id.tolist()):
        path = coco_truth_path(dataset, scene_id)
        try:
            annotations = read_json(path, dict)["annotations"]
            rows += [
                (scene_id, a["image_id"], a["category_id"], a["bbox"], a["segmentation"])
                for a in annotations
                if (scene_id, a["image_id"]) in wanted and not (a.get("ignore") or a["iscrowd"])
            ]
        except (KeyError, TypeError) as error:
            problem = Problem("bad-coco-truth", f"lacks {error}", file=str(path))
            raise FormatError([problem]) from error
    return Detections.from_arrays(
        scene_id=np.array([row[0] for row in rows], np.int64),
        im_id=np.array([row[1] for row in rows], np.int64),
        obj_id=np.array([row[2] for row in rows], np.int64),
        score=np.ones(len(rows)),
        bbox_xywh_px=None if masks else np.array([row[3] for row in rows]).reshape(-1, 4),
        segmentation=[Rle(tuple(row[4]["size"]), row[4]["counts"]) for row in rows]
        if masks
        else None,
    )


def _visible_rows(truth: GroundTruth, targets: Targets) -> NDArray[np.intp]:
    """Instances of the target images that count in detection."""
    wanted = set(map(tuple, targets.images.tolist()))
    images = zip(truth.scene_id.tolist(), truth.im_id.tolist(), strict=True)
    listed = np.fromiter((image in wanted for image in images), bool, len(truth))
    return np.flatnonzero(listed & (truth.visib_fract >= IGNORE_BELOW))


def _target_rows(truth: GroundTruth, targets: Targets) -> NDArray[np.intp]:
    """The most visible instances of each target, as many as it asks for (BOP rules 3)."""
    if targets.obj_id is None or targets.inst_count is None:
        raise MissingDataError(f"{targets.file} lists images only, not objects and their counts")
    left = {
        key: count
        for *key_parts, count in zip(
            targets.scene_id.tolist(),
            targets.im_id.tolist(),
            targets.obj_id.tolist(),
            targets.inst_count.tolist(),
            strict=True,
        )
        for key in [tuple(key_parts)]
    }
    keys = list(
        zip(truth.scene_id.tolist(), truth.im_id.tolist(), truth.obj_id.tolist(), strict=True)
    )
    chosen = []
    for row in np.argsort(-np.nan_to_num(truth.visib_fract, nan=1.0), kind="stable").tolist():
        if left.get(keys[row], 0) > 0:
            left[keys[row]] -= 1
            chosen.append(row)
    return np.sort(np.array(chosen, np.intp))
