"""Pixel counts, visible fraction and boxes of one instance: a row of ``scene_gt_info.json``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from sixd.geometry.pose import Floats
from sixd.render.visibility import visible_mask

Bools = NDArray[np.bool_]

CANVAS = 3
"""The canvas is so many times wider and higher than the image, the image in its middle: what is
cut off by the image border still counts as part of the object (BOP rules)."""


class GtInfo(TypedDict):
    """One entry of ``scene_gt_info.json``."""

    bbox_obj: list[int]
    bbox_visib: list[int]
    px_count_all: int
    px_count_valid: int
    px_count_visib: int
    visib_fract: float


@dataclass(frozen=True, eq=False)
class InstanceMasks:
    """Where one instance is: all of it, what the image holds, what the sensor saw."""

    info: GtInfo
    mask: Bools
    """``(H, W)`` silhouette inside the image, as if nothing stood before it."""
    visible: Bools
    """``(H, W)`` the part of it that is visible."""


def canvas_camera(K: Floats, size_px: tuple[int, int]) -> tuple[Floats, tuple[int, int]]:
    """Intrinsics and size ``(w, h)`` of the enlarged canvas around an image."""
    width, height = size_px
    shifted = K.copy()
    shifted[:2, 2] += np.array([width, height]) * (CANVAS // 2)
    return shifted, (width * CANVAS, height * CANVAS)


def measure_instance(
    canvas_depth_mm: NDArray[np.floating],
    origin_px: tuple[int, int],
    measured_depth_mm: NDArray[np.floating],
    K: Floats,
    delta_mm: float = 15.0,
) -> InstanceMasks:
    """Masks and gt info of one instance from its rendering and the measured depth.

    Args:
        canvas_depth_mm: ``(h, w)`` rendering of the object alone, 0 = background; any crop of the
            canvas that holds all of the object.
        origin_px: x and y of the crop's first pixel in the image's coordinates; may be negative.
        measured_depth_mm: ``(H, W)``, 0 = no reading.
        K: ``(3, 3)`` of the image, pixels.
        delta_mm: tolerance of the visibility rule.
    """
    height, width = measured_depth_mm.shape
    model = np.zeros((height, width), dtype=canvas_depth_mm.dtype)
    x0, y0 = origin_px
    rows, columns = canvas_depth_mm.shape
    left, right = np.clip([x0, x0 + columns], 0, width)
    top, bottom = np.clip([y0, y0 + rows], 0, height)
    inside = canvas_depth_mm[top - y0 : bottom - y0, left - x0 : right - x0]
    model[top:bottom, left:right] = inside
    visible = np.zeros((height, width), dtype=bool)
    visible[top:bottom, left:right] = visible_mask(
        inside, measured_depth_mm[top:bottom, left:right], K, delta_mm, (int(left), int(top))
    )
    mask = model > 0
    info = gt_info_row(canvas_depth_mm > 0, origin_px, mask, visible, measured_depth_mm)
    return InstanceMasks(info, mask, visible)


def gt_info_row(
    silhouette: Bools,
    origin_px: tuple[int, int],
    mask: Bools,
    visible: Bools,
    measured_depth_mm: NDArray[np.floating],
) -> GtInfo:
    """Counts and boxes of one instance (BOP rules, ``scene_gt_info.json``).

    Args:
        silhouette: ``(h, w)`` all of the object, beyond the image border too.
        origin_px: x and y of its first pixel in the image's coordinates.
        mask: ``(H, W)`` the silhouette inside the image.
        visible: ``(H, W)`` the visible part.
        measured_depth_mm: ``(H, W)``, 0 = no reading.
    """
    n_all, n_visible = int(np.count_nonzero(silhouette)), int(np.count_nonzero(visible))
    box_all, box_visible = [-1] * 4, [-1] * 4
    if n_visible:
        x, y, w, h = span_box_px(silhouette)
        box_all = [x + origin_px[0], y + origin_px[1], w, h]
        box_visible = span_box_px(visible)
    return {
        "bbox_obj": box_all,
        "bbox_visib": box_visible,
        "px_count_all": n_all,
        "px_count_valid": int(np.count_nonzero(mask & (measured_depth_mm > 0))),
        "px_count_visib": n_visible,
        "visib_fract": n_visible / n_all if n_all else 0.0,
    }


def span_box_px(mask: Bools) -> list[int]:
    """``[x, y, w, h]`` with w and h the *differences* of the last and first index.

    gt info counts so, one less than the pixels covered; COCO annotations do not (BOP rules).
    """
    columns, rows = np.flatnonzero(mask.any(axis=0)), np.flatnonzero(mask.any(axis=1))
    x0, x1, y0, y1 = int(columns[0]), int(columns[-1]), int(rows[0]), int(rows[-1])
    return [x0, y0, x1 - x0, y1 - y0]
