"""Cutting triangles at a plane in front of the camera."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sixd.geometry.pose import Floats

NEAR_MM = 1.0
"""Surface nearer to the camera plane than this is not drawn: it is cut away, not the triangle."""


def clip_at_near_plane(
    points: Floats, faces: NDArray[np.integer], near: float = NEAR_MM
) -> tuple[Floats, NDArray[np.uint32]]:
    """Keep what has a third coordinate of at least ``near``.

    Linear maps that keep the third coordinate commute with it: points may be in the camera frame
    or already multiplied by intrinsics.

    Args:
        points: ``(V, 3)``.
        faces: ``(F, 3)``.
        near: where the plane is.

    Returns:
        Points ``(V', 3)`` and faces ``(F', 3)``; a triangle that is cut becomes one or two.
    """
    inside = points[faces, 2] >= near
    n_inside = inside.sum(axis=1)
    whole = faces[n_inside == 3]
    pieces = [points[whole].reshape(-1, 3)]
    for kept in (1, 2):
        cut = n_inside == kept
        # Turn each triangle so that its lone corner, inside or outside, comes first.
        lone = np.argmax(inside[cut] == (kept == 1), axis=1)
        turned = faces[cut][np.arange(len(lone))[:, None], (lone[:, None] + np.arange(3)) % 3]
        apex, left, right = (points[turned[:, i]] for i in range(3))
        cut_left = _cross(apex, left, near)
        cut_right = _cross(apex, right, near)
        if kept == 1:
            pieces.append(np.stack([apex, cut_left, cut_right], axis=1).reshape(-1, 3))
        else:
            pieces.append(np.stack([cut_left, left, right], axis=1).reshape(-1, 3))
            pieces.append(np.stack([cut_left, right, cut_right], axis=1).reshape(-1, 3))
    soup = np.concatenate(pieces)
    return soup, np.arange(len(soup), dtype=np.uint32).reshape(-1, 3)


def _cross(start: Floats, end: Floats, near: float) -> Floats:
    """Where the segments ``(N, 3)`` meet the plane."""
    share = (near - start[:, 2]) / (end[:, 2] - start[:, 2])
    crossing: Floats = start + share[:, None] * (end - start)
    crossing[:, 2] = near
    return crossing
