"""The outcome of a 2D evaluation: COCO's twelve scores, their parts, and what they rest on."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sixd.evaluation.coco_curves import IouType

if TYPE_CHECKING:
    from sixd.evaluation.scores import Breakdown

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

IOU_THRESHOLDS: tuple[float, ...] = tuple(n / 100 for n in range(50, 100, 5))
UNDEFINED = -1.0
"""COCO's score where there is no truth to find, as ``AP_small`` without small objects."""


@dataclass(frozen=True)
class CategoryScores:
    """Columns ``(K,)``, one row for each category; scores are NaN where it has no truth to find."""

    obj_id: Ints
    n_truths: Ints
    n_detections: Ints
    AP: Floats
    AP50: Floats
    AP75: Floats
    AR100: Floats


@dataclass(frozen=True)
class SceneScores:
    """Columns ``(S,)``, one row for each scene, in the order of evaluation."""

    scene_id: Ints
    n_images: Ints
    n_truths: Ints
    n_ignored_truths: Ints
    n_detections: Ints
    AP: Floats
    """NaN where the scene has no truth to find."""


@dataclass(frozen=True)
class CocoScores:
    """COCO's twelve scores, -1 where there is no truth to find, and what they rest on.

    AP and AR are means over IoU thresholds .50:.05:.95 and over categories that have truth.
    """

    AP: float
    AP50: float
    AP75: float
    AP_small: float
    """Truths up to 32^2 px of area; ``AP_medium`` from there to 96^2, ``AP_large`` from there."""
    AP_medium: float
    AP_large: float
    AR1: float
    """Recall of the best detection per image and category; ``AR10``, ``AR100`` likewise."""
    AR10: float
    AR100: float
    AR_small: float
    AR_medium: float
    AR_large: float
    iou_type: IouType
    AP_at_iou: Floats
    """``(10,)`` at each of `IOU_THRESHOLDS`; their mean is ``AP``. NaN without truth to find."""
    AR_at_iou: Floats
    """``(10,)`` likewise; their mean is ``AR100``."""
    categories: CategoryScores
    scenes: SceneScores
    n_truths: int
    """Instances to be found."""
    n_ignored_truths: int
    n_truths_without_detection: int
    """Instances to be found beyond the number of detections of their category in their image."""
    n_detections: int
    """Detections in target images that can be scored."""
    n_off_target: int
    """Dropped: not in a target image."""
    n_unknown_category: int
    """Dropped: in a target image, of a category that the truth does not list."""
    n_without_shape: int
    """Dropped: in a target image, without the box (``bbox``) or mask (``segm``) to be scored."""
    n_beyond_100: int
    """Of ``n_detections``: not among the 100 best of their category in their image, so unused."""
    average_time_per_image_s: float
    """Over the images of the file, as the toolkit computes it; -1 where any time is missing."""
    average_time_per_target_image_s: float
    """Over all target images, those without detections taking no time; -1 likewise."""

    @property
    def AP_of_category(self) -> dict[int, float]:
        """AP of each category that has truth to find; their mean is ``AP``."""
        rows = zip(self.categories.obj_id.tolist(), self.categories.AP.tolist(), strict=True)
        return {k: score for k, score in rows if not np.isnan(score)}

    @property
    def scores(self) -> dict[str, float]:
        """The twelve scores by name, in COCO's order."""
        return {f.name: getattr(self, f.name) for f in fields(self)[:12]}


def coco_breakdowns(scores: CocoScores) -> dict[str, Breakdown]:
    """Scores by ``object``, ``scene`` and ``threshold``, as `Evaluation` holds them."""
    from sixd.evaluation.scores import Breakdown

    objects, scenes, n = scores.categories, scores.scenes, len(IOU_THRESHOLDS)
    by_object: dict[str, NDArray[np.generic]] = {
        "obj_id": objects.obj_id,
        "n_targets": objects.n_truths,
        "n_estimates": objects.n_detections,
    }
    by_object |= {name: getattr(objects, name) for name in ("AP", "AP50", "AP75", "AR100")}
    by_scene: dict[str, NDArray[np.generic]] = {
        "scene_id": scenes.scene_id,
        "n_images": scenes.n_images,
        "n_targets": scenes.n_truths,
        "n_ignored_targets": scenes.n_ignored_truths,
        "n_estimates": scenes.n_detections,
        "AP": scenes.AP,
    }
    by_threshold: dict[str, NDArray[np.generic]] = {
        "error": np.full(n, f"iou_{scores.iou_type}"),
        "threshold": np.array(IOU_THRESHOLDS),
        "AP": scores.AP_at_iou,
        "AR": scores.AR_at_iou,
    }
    parts = {"object": by_object, "scene": by_scene, "threshold": by_threshold}
    return {by: Breakdown(by, columns) for by, columns in parts.items()}
