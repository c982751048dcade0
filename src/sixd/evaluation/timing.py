"""Average time per image (BOP rules 1, "Time")."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sixd.errors import FormatError, Problem

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TOLERANCE_S = 0.001
UNKNOWN = -1.0


def time_of_each_image(scene_id: Ints, im_id: Ints, time_s: Floats) -> Floats | None:
    """``(N images,)`` seconds, or None where any row lacks its time (NaN or negative).

    Raises:
        FormatError: rows of one image differ by more than a millisecond from its first row.
    """
    if not len(time_s) or not (time_s >= 0).all():
        return None
    images, first, image = np.unique(
        np.stack([scene_id, im_id]), axis=1, return_index=True, return_inverse=True
    )
    image = image.reshape(-1)
    time_of_image_s: Floats = time_s[first]
    wrong = np.flatnonzero(np.abs(time_s - time_of_image_s[image]) > TOLERANCE_S)
    if len(wrong):
        raise FormatError(
            [
                Problem(
                    code="inconsistent-time",
                    what=f"scene {images[0, image[r]]}, image {images[1, image[r]]}: "
                    "the time is that of the whole image, so all its rows must agree",
                    field=f"time (row {r + 1})",
                    expected=f"{time_of_image_s[image[r]]!r}",
                    got=f"{time_s[r]!r}",
                    fix="write the same time in every row of an image, or: sixd check --fix OUT",
                )
                for r in wrong.tolist()
            ]
        )
    return time_of_image_s


def average_time_s(times_s: Floats | None) -> float:
    """Mean over the images that occur in the results, as the toolkit reports it; -1: unknown."""
    return UNKNOWN if times_s is None else float(np.mean(times_s))


def average_time_all_targets_s(times_s: Floats | None, n_target_images: int) -> float:
    """Sum of times over the number of target images: an image without estimates takes no time."""
    if times_s is None or not n_target_images:
        return UNKNOWN
    return float(times_s.sum() / n_target_images)
