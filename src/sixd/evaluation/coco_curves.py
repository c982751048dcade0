"""Precision and recall of 2D detections, by hotcoco, with BOP's ignore flag honoured.

BOP's scores differ from those of today's COCO libraries in one rule: a truth marked ``ignore``
(visible less than 10 %) is neither to be found nor, where found, a mistake; yet, unlike a COCO
crowd region, it takes one detection only and its IoU is the usual one. That is exactly COCO's own
rule for a truth outside the area range, so an ignored truth is given an area outside every range.
(COCO's published code overwrites the flag by ``iscrowd``; the toolkit needs a fork for it.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from sixd.errors import FormatError, Problem
from sixd.evaluation.coco_truth import CocoTruth, Segmentation

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]
IouType = Literal["bbox", "segm"]

_IN_NO_AREA_RANGE = -1.0


@dataclass(frozen=True)
class Candidates:
    """Detections in the images of a `CocoTruth`."""

    image: Ints
    """``(N,)`` index into the images of the truth."""
    obj_id: Ints
    score: Floats
    bbox_xywh_px: Floats
    """``(N, 4)``; not looked at for ``segm``."""
    area_px: Floats
    """``(N,)`` decides small, medium, large where the detection meets no truth."""
    segmentation: Sequence[Segmentation] | None

    def __len__(self) -> int:
        return len(self.image)


@dataclass(frozen=True)
class Curves:
    """COCO's curves, -1 where a category has no truth to find.

    Axes: T = 10 IoU thresholds .50:.05:.95, R = 101 recalls 0:.01:1, K categories of the truth,
    A = 4 areas (all, small, medium, large), M = 3 limits (the best 1, 10, 100 of an image).
    """

    precision: Floats
    """``(T, R, K, A, M)`` the highest precision at that recall or beyond."""
    recall: Floats
    """``(T, K, A, M)``."""


def coco_curves(candidates: Candidates, truth: CocoTruth, iou_type: IouType) -> Curves:
    """Match detections to truths and accumulate, as COCO's evaluation with its defaults does."""
    evaluation = _evaluator(candidates, truth, iou_type)
    evaluation.evaluate()
    evaluation.accumulate()
    return Curves(
        precision=_without_epsilon(evaluation.eval["precision"]),
        recall=np.asarray(evaluation.eval["recall"], np.float64),
    )


def average_precision_of_parts(
    candidates: Candidates, truth: CocoTruth, iou_type: IouType, part: Ints
) -> Floats:
    """AP of each part of the images ``(P,)``, -1 where it has no truth to find.

    Args:
        candidates: all detections.
        truth: all images.
        iou_type: ``bbox`` or ``segm``.
        part: ``(I,)`` number of each image's part, from 0 to P - 1.
    """
    evaluation = _evaluator(candidates, truth, iou_type)
    # AP needs neither the area ranges nor the lower limits; each would cost as much again.
    evaluation.params.area_rng, evaluation.params.area_rng_lbl = [[0, 1e10]], ["all"]
    evaluation.params.max_dets = [100]
    evaluation.evaluate()
    n_parts = int(part.max()) + 1
    slices = evaluation.slice_by(
        {str(p): np.flatnonzero(part == p).tolist() for p in range(n_parts)}
    )
    scores = np.array([slices[str(p)]["AP"] for p in range(n_parts)])
    return np.where(scores > 1 - 1e-12, 1.0, scores)  # see _without_epsilon


def _evaluator(candidates: Candidates, truth: CocoTruth, iou_type: IouType) -> Any:
    """The library's evaluation of these tables, ready to be run."""
    from hotcoco import COCO, COCOeval

    with_masks = iou_type == "segm"
    coco_truth = COCO.from_arrays(
        [{"id": i, "width": w, "height": h} for i, (w, h) in enumerate(truth.size_px.tolist())],
        [{"id": k, "name": str(k)} for k in truth.category_id.tolist()],
        truth.image,
        truth.obj_id,
        truth.bbox_xywh_px,
        area=np.where(truth.ignored, _IN_NO_AREA_RANGE, truth.area_px),
        iscrowd=truth.crowd,
        segmentation=list(truth.segmentation or ()) if with_masks else None,
    )
    columns = (candidates.image, candidates.bbox_xywh_px, candidates.score, candidates.obj_id)
    coco_candidates = coco_truth.load_res(
        np.column_stack(columns).astype(np.float64),
        segmentation=list(candidates.segmentation or ()) if with_masks else None,
    )
    # Its ids count from 1, in the order of rows.
    coco_candidates.update_anns(ids=np.arange(1, len(candidates) + 1), area=candidates.area_px)
    return COCOeval(coco_truth, coco_candidates, iou_type)


def mask_areas_px(masks: Sequence[Segmentation], row_numbers: Ints) -> Floats:
    """Pixels of each detected mask ``(N,)``.

    Raises:
        FormatError: masks cannot be decoded; each is named by its number among the results.
    """
    from hotcoco import mask

    try:
        areas: Any = mask.area(list(masks))  # type: ignore[arg-type]
        return np.asarray(areas, np.float64)
    except (ValueError, TypeError, OverflowError):
        problems = [
            Problem("bad-rle", f"row {row}, counted from 0: {reason}", field="segmentation")
            for row, one in zip(row_numbers.tolist(), masks, strict=True)
            if (reason := _reason_not_a_mask(one))
        ]
        raise FormatError(problems) from None


def _reason_not_a_mask(one: Any) -> str:
    from hotcoco import mask

    try:
        mask.area([one])
    except (ValueError, TypeError, OverflowError) as error:
        return str(error)
    return ""


def _without_epsilon(precision: NDArray[np.float64]) -> Floats:
    """Make a lone detection that is right exactly 1 precise.

    COCO divides by (true + false positives + 2^-52), which changes no quotient but 1 / 1.
    """
    return np.where(precision == 1 / (1 + np.spacing(1)), 1.0, precision)
