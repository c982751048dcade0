"""Perturbed 2D detections: boxes with moved borders, masks that slid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sixd.datasets.annotate.rle import decode_rle, encode_rle
from sixd.errors import UsageError
from sixd.geometry.pose import Floats
from sixd.results.tables import Detections, Rle
from sixd.synth.perturb import Perturbation

Ids = list[tuple[int, int, int]]


def box_detections(true: Detections, size_px: tuple[int, int], how: Perturbation) -> Detections:
    """Boxes whose borders moved, some of them twice, and boxes around nothing.

    Args:
        true: with amodal boxes.
        size_px: ``(w, h)`` of the images.
        how: strength and randomness.
    """
    width, height = size_px
    found = how.found(len(true))
    again = how.doubled(found)
    rows = np.concatenate([found, again])
    moved_px = how.rng.normal(0.0, how.strength.border_px * width / 640, (len(rows), 4))
    moved_px[len(found) :] *= 2.0
    corners_px = true.bbox_xywh_px[rows].copy()
    corners_px[:, 2:] += corners_px[:, :2]
    score = how.scores(np.abs(moved_px).mean(axis=1) * 640 / width / 3)
    score[len(found) :] = np.round(score[len(found) :] * 0.7, 4)
    ids = _ids(true, rows)
    false: Ids = [
        (*image, o) for image in how.time_s_of_image for o in how.false_objects(true, image)
    ]
    low_px = how.rng.uniform(0.0, 0.8, (len(false), 2)) * size_px
    sides_px = how.rng.uniform(0.06, 0.2, (len(false), 2)) * width
    corners_px = np.concatenate(
        [corners_px + moved_px, np.concatenate([low_px, low_px + sides_px], axis=1)]
    )
    scores = np.concatenate([score, how.false_scores(len(false))])
    return _table(ids + false, scores, how, boxes=_inside(corners_px, width, height))


def mask_detections(true: Detections, how: Perturbation) -> Detections:
    """Visible masks that slid by some pixels.

    Args:
        true: with masks as uncompressed run lengths.
        how: strength and randomness.
    """
    rows = how.found(len(true))
    slid_px = how.rng.normal(0.0, how.strength.border_px, (len(rows), 2))
    masks = []
    for row, (right_px, down_px) in zip(rows.tolist(), slid_px, strict=True):
        rle = true.segmentation[row] if true.segmentation else None
        if rle is None:
            raise UsageError(f"row {row} has no mask to perturb")
        mask = decode_rle({"size": list(rle.size), "counts": rle.counts})
        per_px = mask.shape[1] / 640
        slid = slide(mask, round(right_px * per_px), round(down_px * per_px))
        coded = encode_rle(slid if slid.any() else mask)
        masks.append(Rle((coded["size"][0], coded["size"][1]), coded["counts"]))
    scores = how.scores(np.hypot(*slid_px.T) / 3)
    return _table(_ids(true, rows), scores, how, masks=masks)


def slide(mask: NDArray[np.bool_], right_px: int, down_px: int) -> NDArray[np.bool_]:
    """A mask ``(H, W)`` moved by whole pixels; what leaves the image is gone."""
    height, width = mask.shape
    pad = ((max(down_px, 0), max(-down_px, 0)), (max(right_px, 0), max(-right_px, 0)))
    padded = np.pad(mask, pad)
    top, left = max(-down_px, 0), max(-right_px, 0)
    return padded[top : top + height, left : left + width]


def _ids(table: Detections, rows: NDArray[np.int64]) -> Ids:
    columns = (table.scene_id[rows], table.im_id[rows], table.obj_id[rows])
    return list(zip(*(column.tolist() for column in columns), strict=True))


def _inside(corners_px: Floats, width: int, height: int) -> Floats:
    """Boxes x, y, w, h from corners, clipped to the image, at least one pixel wide and high."""
    low = np.clip(corners_px[:, :2], 0, [width - 1, height - 1])
    high = np.clip(corners_px[:, 2:], low + 1, [width, height])
    return np.round(np.concatenate([low, high - low], axis=1), 2)


def _table(
    ids: Ids,
    score: Floats,
    how: Perturbation,
    boxes: Floats | None = None,
    masks: Sequence[Rle] | None = None,
) -> Detections:
    """Rows by image, the surest first, with the image's time."""
    scene_id, im_id, obj_id = np.array(ids, np.int64).reshape(-1, 3).T
    table = Detections.from_arrays(
        scene_id=scene_id,
        im_id=im_id,
        obj_id=obj_id,
        score=score,
        bbox_xywh_px=boxes,
        segmentation=masks,
        time_s=how.times_s(scene_id, im_id),
    )
    return table.where(np.lexsort((-table.score, table.im_id, table.scene_id)))
