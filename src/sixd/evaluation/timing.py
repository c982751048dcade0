"""Average time per image (BOP rules 1, "Time")."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sixd.rows import find_rows, first_of_each

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
UNKNOWN_S = -1.0


def average_times_s(
    images: tuple[Ints, Ints], time_s: Floats, target_images: tuple[Ints, Ints]
) -> tuple[float, float]:
    """Average over the images of the results, as the toolkit has it, and over all target images.

    A row that lacks its time makes both unknown. An image counts with its first row; that the rows
    of an image agree is the checker's business. Images without rows take no time: the toolkit
    leaves them out of its mean, the second average divides by them too.

    Args:
        images: scene and image of each row, ``(N,)``.
        time_s: ``(N,)``, NaN where missing.
        target_images: scene and image of the targets, ``(T,)``, repeats allowed.

    Returns:
        Seconds, -1 where unknown.
    """
    if not len(time_s) or not (time_s >= 0).all():
        return UNKNOWN_S, UNKNOWN_S
    first = first_of_each(images)
    is_target = find_rows((images[0][first], images[1][first]), target_images) >= 0
    times_s = time_s[first]
    n_targets = len(first_of_each(target_images))
    return float(times_s.mean()), float(times_s[is_target].sum() / max(n_targets, 1))
