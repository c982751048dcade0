"""COCO's curves in plain NumPy: the definition that `coco_curves` is tested against.

Source: Lin et al., ECCV 2014, and the rules of the COCO detection challenge; BOP rules 8 for truths
that are ignored. Slow on purpose: one loop per word of the definition.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sixd.evaluation.coco_curves import Candidates, Curves, IouType
from sixd.evaluation.coco_truth import CocoTruth, Segmentation

Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

IOU_THRESHOLDS = np.linspace(0.5, 0.95, 10)
RECALLS = np.linspace(0, 1, 101)
AREAS_PX = ((0, 1e10), (0, 32**2), (32**2, 96**2), (96**2, 1e10))
"""All, small, medium, large; both ends belong to the range."""
MAX_DETECTIONS = (1, 10, 100)


def reference_curves(candidates: Candidates, truth: CocoTruth, iou_type: IouType) -> Curves:
    """See `coco_curves`, which this defines."""
    shape = (len(IOU_THRESHOLDS), len(truth.category_id), len(AREAS_PX), len(MAX_DETECTIONS))
    precision = np.full((shape[0], len(RECALLS), *shape[1:]), -1.0)
    recall = np.full(shape, -1.0)
    ious = all_ious(candidates, truth, iou_type)
    for t, k, a, m in np.ndindex(shape):
        low_px, high_px = AREAS_PX[a]
        ignored = truth.ignored | (truth.area_px < low_px) | (truth.area_px > high_px)
        wrong_size = (candidates.area_px < low_px) | (candidates.area_px > high_px)
        n_to_find = int((~ignored[truth.obj_id == truth.category_id[k]]).sum())
        if not n_to_find:
            continue
        scores, found, unused = [], [], []
        for image in range(len(truth.im_id)):
            d, g = _rows(candidates, truth, image, int(truth.category_id[k]))
            d = d[: MAX_DETECTIONS[m]]
            partner = match(ious[d][:, g], ignored[g], truth.crowd[g], float(IOU_THRESHOLDS[t]))
            scores.append(candidates.score[d])
            found.append(partner >= 0)
            takes_ignored = np.append(ignored[g], False)[partner]
            unused.append(np.where(partner >= 0, takes_ignored, wrong_size[d]))
        pooled = (np.concatenate(scores), np.concatenate(found), np.concatenate(unused))
        precision[t, :, k, a, m], recall[t, k, a, m] = precision_at_recalls(*pooled, n_to_find)
    return Curves(precision, recall)


def _rows(candidates: Candidates, truth: CocoTruth, image: int, category: int) -> tuple[Ints, Ints]:
    """Detections, best first, and truths of one category in one image."""
    d = np.flatnonzero((candidates.image == image) & (candidates.obj_id == category))
    g = np.flatnonzero((truth.image == image) & (truth.obj_id == category))
    return d[np.argsort(-candidates.score[d], kind="stable")], g


def match(ious: Floats, ignored: Bools, crowd: Bools, threshold: float) -> Ints:
    """Truth that each detection takes, -1 for none; the detections come best first.

    A detection takes the truth of highest IoU (of equals, the last) that reaches the threshold and
    is free, or is a crowd, which is never used up; an ignored one only for want of others.

    Args:
        ious: ``(D, G)``.
        ignored: ``(G,)``.
        crowd: ``(G,)``.
        threshold: IoU.
    """
    partner = np.full(len(ious), -1)
    free = np.ones(len(ignored), bool)
    for d, iou in enumerate(ious):
        for kind in (~ignored, ignored):
            eligible = kind & (free | crowd) & (iou >= threshold)
            if eligible.any():
                partner[d] = np.flatnonzero(eligible & (iou == iou[eligible].max()))[-1]
                free[partner[d]] = False
                break
    return partner


def precision_at_recalls(
    scores: Floats, found: Bools, unused: Bools, n_to_find: int
) -> tuple[Floats, float]:
    """Precision at `RECALLS`, and the recall of all detections (0 without any).

    Precision at a recall is the highest at that recall or beyond, and 0 where none gets so far.

    Args:
        scores: ``(N,)``, of all images.
        found: detections that took a truth.
        unused: detections that count neither as right nor as wrong.
        n_to_find: truths.
    """
    used = np.argsort(-scores, kind="stable")
    used = used[~unused[used]]
    n_right = np.cumsum(found[used])
    recall = n_right / n_to_find
    precision = n_right / np.arange(1, len(used) + 1)
    highest = np.maximum.accumulate(precision[::-1])[::-1]
    reached = np.searchsorted(recall, RECALLS, side="left")
    return np.append(highest, 0.0)[reached], float(recall[-1]) if len(recall) else 0.0


def all_ious(candidates: Candidates, truth: CocoTruth, iou_type: IouType) -> Floats:
    """IoU of every detection with every truth ``(N, G)``, as if all were in one image."""
    if iou_type == "bbox":
        return box_ious(candidates.bbox_xywh_px, truth.bbox_xywh_px, truth.crowd)
    return mask_ious(_pixels(candidates.segmentation), _pixels(truth.segmentation), truth.crowd)


def _pixels(masks: Sequence[Segmentation] | None) -> Bools:
    from hotcoco import mask

    pixels: list[Any] = [mask.decode(m) for m in masks or ()]  # type: ignore[arg-type]
    return np.array([p.ravel() for p in pixels]).astype(np.bool_)


def box_ious(detected_px: Floats, true_px: Floats, crowd: Bools) -> Floats:
    """IoU of boxes ``(D, 4)`` and ``(G, 4)``; the share of the detection that lies in a crowd."""
    low = np.maximum(detected_px[:, None, :2], true_px[:, :2])
    ends = detected_px[:, None, :2] + detected_px[:, None, 2:], true_px[:, :2] + true_px[:, 2:]
    size = np.clip(np.minimum(*ends) - low, 0, None)
    areas = detected_px[:, 2] * detected_px[:, 3], true_px[:, 2] * true_px[:, 3]
    return _ratio(size.prod(-1), *areas, crowd)


def mask_ious(detected: Bools, true: Bools, crowd: Bools) -> Floats:
    """IoU of masks of one size, ``(D, pixels)`` and ``(G, pixels)``; crowds as for boxes."""
    if not len(detected) or not len(true):
        return np.zeros((len(detected), len(true)))
    shared = detected.astype(np.float64) @ true.T.astype(np.float64)
    return _ratio(shared, detected.sum(axis=1), true.sum(axis=1), crowd)


def _ratio(shared: Floats, detected: Floats, true: Floats, crowd: Bools) -> Floats:
    whole = np.where(crowd, detected[:, None], detected[:, None] + true - shared)
    return np.divide(shared, whole, out=np.zeros_like(shared), where=shared > 0)
