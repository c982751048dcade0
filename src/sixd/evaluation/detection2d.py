"""2D detection and segmentation: COCO's average precision, with the numbers of the BOP toolkit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sixd.errors import FormatError, Problem, UsageError
from sixd.evaluation.coco_curves import (
    Candidates,
    Curves,
    IouType,
    average_precision_of_parts,
    coco_curves,
    mask_areas_px,
)
from sixd.evaluation.coco_summary import (
    IOU_THRESHOLDS,
    UNDEFINED,
    CategoryScores,
    CocoScores,
    SceneScores,
    coco_breakdowns,
)
from sixd.evaluation.coco_truth import CocoTruth, Segmentation
from sixd.evaluation.timing import average_times_s
from sixd.rows import find_rows, row_codes

if TYPE_CHECKING:
    from sixd.results.tables import Detections

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

__all__ = ["IOU_THRESHOLDS", "CocoScores", "coco_breakdowns", "coco_scores"]

MAX_DETECTIONS = 100
"""Per image and category; the lowest scores beyond it play no part."""


def coco_scores(detections: Detections, truth: CocoTruth, iou_type: IouType = "bbox") -> CocoScores:
    """Score 2D detections as ``eval_bop22_coco`` of the BOP toolkit does (BOP rules 8, "COCO").

    It differs on purpose in two points. No detections on the target images give AP 0, where the
    toolkit gives -1 for every score. And a category whose best detection is right has precision 1
    there, where COCO has 1 - 2^-52, so that the truth scores exactly 1.

    Args:
        detections: a whole submission; rows outside the target images are dropped and counted.
        truth: of the target images; with masks if ``iou_type`` is ``segm``.
        iou_type: ``bbox`` compares boxes, ``segm`` masks.

    Raises:
        UsageError: masks are asked for and the truth was read without.
        FormatError: no detection has the box or mask to be scored, a score is not finite, or
            a mask cannot be decoded.
    """
    if iou_type == "segm" and truth.segmentation is None:
        raise UsageError("masks cannot be scored: read the truth with masks=True")
    candidates, dropped = _candidates(detections, truth, iou_type)
    curves = coco_curves(candidates, truth, iou_type)
    n_without_detection, n_beyond_100 = _shortfall_and_excess(candidates, truth)
    times_s = average_times_s(
        (detections.scene_id, detections.im_id), detections.time_s, (truth.scene_id, truth.im_id)
    )
    total = _twelve(curves)
    return CocoScores(
        **total,
        iou_type=iou_type,
        AP_at_iou=_means(curves.precision[..., 0, 2], axes=(1, 2)),
        AR_at_iou=_means(curves.recall[..., 0, 2], axes=(1,)),
        categories=_by_category(curves, candidates, truth),
        scenes=_by_scene(candidates, truth, iou_type, total),
        n_truths=int((~truth.ignored).sum()),
        n_ignored_truths=int(truth.ignored.sum()),
        n_truths_without_detection=n_without_detection,
        n_detections=len(candidates),
        n_off_target=dropped.off_target,
        n_unknown_category=dropped.unknown_category,
        n_without_shape=dropped.without_shape,
        n_beyond_100=n_beyond_100,
        average_time_per_image_s=times_s[0],
        average_time_per_target_image_s=times_s[1],
    )


class _Dropped(NamedTuple):
    off_target: int
    unknown_category: int
    without_shape: int


def _candidates(
    detections: Detections, truth: CocoTruth, iou_type: IouType
) -> tuple[Candidates, _Dropped]:
    """Rows that can be scored, and how many were dropped why."""
    shaped = _check_rows(detections, iou_type)
    image = find_rows((detections.scene_id, detections.im_id), (truth.scene_id, truth.im_id))
    on_target = image >= 0
    known = np.isin(detections.obj_id, truth.category_id)
    rows = np.flatnonzero(on_target & shaped)
    if iou_type == "segm":
        _check_mask_sizes(detections, truth, rows, image[rows])
    areas_px = _areas_px(detections, rows, _scene_of_image(truth)[image[rows]], iou_type)
    rows, areas_px = rows[known[rows]], areas_px[known[rows]]
    candidates = Candidates(
        image=image[rows],
        obj_id=detections.obj_id[rows],
        score=detections.score[rows],
        bbox_xywh_px=np.nan_to_num(detections.bbox_xywh_px[rows]),
        area_px=areas_px,
        segmentation=_masks(detections, rows) if iou_type == "segm" else None,
    )
    dropped = _Dropped(
        off_target=int((~on_target).sum()),
        unknown_category=int((on_target & shaped & ~known).sum()),
        without_shape=int((on_target & ~shaped).sum()),
    )
    return candidates, dropped


def _check_rows(detections: Detections, iou_type: IouType) -> Bools:
    """Mask of the rows that have the shape to be scored."""
    unusable = ~np.isfinite(detections.score) | np.isinf(detections.bbox_xywh_px).any(axis=1)
    if unusable.any():
        what = "has a score or box that is not a finite number"
        rows = np.flatnonzero(unusable).tolist()
        raise FormatError(
            [Problem("not-finite", f"row {row}, counted from 0, {what}") for row in rows]
        )
    if iou_type == "bbox":
        shaped, shape, other = detections.has_bbox, "bbox", "bop22-segmentation2d"
    else:
        shaped, shape, other = detections.has_mask, "segmentation", "bop22-detection2d"
    if len(shaped) and not shaped.any():
        fix = f"use --protocol {other}, or write a {shape} in every row"
        raise FormatError([Problem("no-shapes", f"no detection has a {shape}", fix=fix)])
    return shaped


def _check_mask_sizes(detections: Detections, truth: CocoTruth, rows: Ints, image: Ints) -> None:
    """A mask of another size than its image overlaps nothing; that is a mistake, not a score."""
    sizes = [mask.size if mask else (0, 0) for mask in (detections.segmentation[r] for r in rows)]
    wrong = np.flatnonzero((np.array(sizes).reshape(-1, 2) != truth.size_px[image, ::-1]).any(1))
    if len(wrong):
        raise FormatError(
            [
                Problem(
                    "mask-size",
                    f"row {rows[w]}, counted from 0, has a mask of another size than its image",
                    field="segmentation",
                    expected=f"[height, width] {truth.size_px[image[w], ::-1].tolist()}",
                    got=str(list(sizes[w])),
                    fix="write masks at the size of the image, height first",
                )
                for w in wrong.tolist()
            ]
        )


def _areas_px(detections: Detections, rows: Ints, scene: Ints, iou_type: IouType) -> Floats:
    """Areas that decide whether an unmatched detection is small, medium or large.

    As COCO's ``loadRes``: boxes for all if the first detection evaluated has one, else masks. Where
    the toolkit would then stop, at a later detection that has only a mask, its mask is taken.
    """
    boxes_px = detections.bbox_xywh_px[rows]
    box_areas_px: Floats = boxes_px[:, 2] * boxes_px[:, 3]
    if iou_type == "bbox" or not len(rows):
        return box_areas_px
    areas_px = mask_areas_px(_masks(detections, rows), rows)  # also finds broken masks
    has_box = np.isfinite(box_areas_px)
    first = int(np.argmin(scene))
    return np.where(has_box, box_areas_px, areas_px) if has_box[first] else areas_px


def _masks(detections: Detections, rows: Ints) -> list[Segmentation]:
    masks = detections.segmentation or ()
    return [mask.as_coco() for r in rows.tolist() if (mask := masks[r]) is not None]


def _twelve(curves: Curves) -> dict[str, float]:
    """COCO's summary: means over everything that is defined."""
    at_50, at_75 = curves.precision[0], curves.precision[5]
    averages = {
        "AP": curves.precision[..., 0, 2],
        "AP50": at_50[..., 0, 2],
        "AP75": at_75[..., 0, 2],
    }
    areas = {"small": 1, "medium": 2, "large": 3}
    averages |= {f"AP_{name}": curves.precision[..., a, 2] for name, a in areas.items()}
    averages |= {f"AR{n}": curves.recall[..., 0, m] for m, n in enumerate((1, 10, 100))}
    averages |= {f"AR_{name}": curves.recall[..., a, 2] for name, a in areas.items()}
    return {name: _mean_defined(values) for name, values in averages.items()}


def _mean_defined(values: Floats) -> float:
    defined = values[values > UNDEFINED]
    return float(np.mean(defined)) if defined.size else UNDEFINED


def _means(values: Floats, axes: tuple[int, ...]) -> Floats:
    """Mean of what is defined along some axes; NaN where nothing is."""
    defined = values > UNDEFINED
    with np.errstate(invalid="ignore"):
        means: Floats = np.where(defined, values, 0).sum(axis=axes) / defined.sum(axis=axes)
    return means


def _by_category(curves: Curves, candidates: Candidates, truth: CocoTruth) -> CategoryScores:
    precision, recall = curves.precision[..., 0, 2], curves.recall[..., 0, 2]

    def count(obj_id: Ints) -> Ints:
        order = np.searchsorted(truth.category_id, obj_id)
        return np.bincount(order, minlength=len(truth.category_id)).astype(np.int64)

    return CategoryScores(
        obj_id=truth.category_id,
        n_truths=count(truth.obj_id[~truth.ignored]),
        n_detections=count(candidates.obj_id),
        AP=_means(precision, axes=(0, 1)),
        AP50=_means(precision[0], axes=(0,)),
        AP75=_means(precision[5], axes=(0,)),
        AR100=_means(recall, axes=(0,)),
    )


def _shortfall_and_excess(candidates: Candidates, truth: CocoTruth) -> tuple[int, int]:
    """Truths beyond the detections of their image and category; detections beyond the limit."""
    counted = ~truth.ignored
    of_truth, of_candidate = row_codes(
        (truth.image[counted], truth.obj_id[counted]), (candidates.image, candidates.obj_id)
    )
    n_groups = len(of_truth) + len(of_candidate)
    n_truths = np.bincount(of_truth, minlength=n_groups)
    n_candidates = np.bincount(of_candidate, minlength=n_groups)
    return (
        int(np.maximum(n_truths - n_candidates, 0).sum()),
        int(np.maximum(n_candidates - MAX_DETECTIONS, 0).sum()),
    )


def _scene_of_image(truth: CocoTruth) -> Ints:
    """``(I,)`` number of each image's scene, in the order of evaluation."""
    return np.cumsum(np.diff(truth.scene_id, prepend=truth.scene_id[:1]) != 0).astype(np.int64)


def _by_scene(
    candidates: Candidates, truth: CocoTruth, iou_type: IouType, total: Mapping[str, float]
) -> SceneScores:
    scene = _scene_of_image(truth)
    _, first = np.unique(scene, return_index=True)
    scores = np.array([total["AP"]])
    if len(first) > 1:
        scores = average_precision_of_parts(candidates, truth, iou_type, scene)

    def count(image: Ints) -> Ints:
        return np.bincount(scene[image], minlength=len(first)).astype(np.int64)

    return SceneScores(
        scene_id=truth.scene_id[first],
        n_images=np.bincount(scene).astype(np.int64),
        n_truths=count(truth.image[~truth.ignored]),
        n_ignored_truths=count(truth.image[truth.ignored]),
        n_detections=count(candidates.image),
        AP=np.where(scores > UNDEFINED, scores, np.nan),
    )
