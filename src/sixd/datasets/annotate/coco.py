"""COCO annotations of one scene: amodal boxes, visible masks, the ``ignore`` flag."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from sixd.datasets.annotate.gt_info import span_box_px
from sixd.datasets.annotate.rle import Rle, encode_rle

IGNORE_BELOW = 0.1
"""Visible fraction below which a detection is neither asked for nor wrong (BOP rules)."""


class CocoAnnotation(TypedDict):
    """One entry of ``annotations``."""

    id: int
    image_id: int
    category_id: int
    iscrowd: int
    area: int
    bbox: list[int]
    segmentation: Rle
    width: int
    height: int
    ignore: bool


def coco_annotation(
    ann_id: int,
    im_id: int,
    obj_id: int,
    mask: NDArray[np.bool_],
    visible: NDArray[np.bool_],
    visib_fract: float,
) -> CocoAnnotation | None:
    """One instance's annotation, or None when nothing of it is visible (BOP rules).

    Args:
        ann_id: counts from 1 within a scene.
        im_id: image.
        obj_id: object, the COCO category.
        mask: ``(H, W)`` silhouette inside the image: gives the box, by the pixels it covers.
        visible: ``(H, W)`` visible part: gives area and run lengths.
        visib_fract: below 0.1 the annotation is marked to be ignored.
    """
    area = int(np.count_nonzero(visible))
    if not area:
        return None
    x, y, w, h = span_box_px(mask)
    height, width = mask.shape
    return {
        "id": ann_id,
        "image_id": im_id,
        "category_id": obj_id,
        "iscrowd": 0,
        "area": area,
        "bbox": [x, y, w + 1, h + 1],
        "segmentation": encode_rle(visible),
        "width": width,
        "height": height,
        "ignore": visib_fract < IGNORE_BELOW,
    }


def coco_file(
    description: str,
    obj_ids: Iterable[int],
    images: Sequence[tuple[int, str]],
    size_px: tuple[int, int],
    annotations: Sequence[CocoAnnotation],
) -> dict[str, object]:
    """All of a ``scene_gt_coco.json``.

    Args:
        description: what it is, for people.
        obj_ids: the dataset's objects, also those that are not in this scene.
        images: image id and file name relative to the scene's folder.
        size_px: ``(w, h)``.
        annotations: of all images, ids counted from 1.
    """
    width, height = size_px
    return {
        "info": {"description": description},
        "licenses": [],
        "categories": [{"id": i, "name": str(i), "supercategory": "object"} for i in obj_ids],
        "images": [
            {"id": im_id, "file_name": name, "width": width, "height": height}
            for im_id, name in images
        ],
        "annotations": list(annotations),
    }
