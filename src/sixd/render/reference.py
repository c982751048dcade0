"""Readable NumPy definition of rendering; `sixd.render.raster` is the fast one.

A pixel sees along the ray through its centre: pixel i samples u = i + 0.5 (BOP rules). It shows the
nearest point at which that ray meets a triangle, seen from either side, with z of at least
`NEAR_MM`. So surface that reaches behind the camera is cut at the near plane, not dropped.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sixd.geometry.mesh import Mesh
from sixd.geometry.pose import Floats, Pose
from sixd.render.clipping import NEAR_MM

EDGE_SLACK = 1e-11
"""A ray this close outside of a triangle, in barycentric units, still meets it: no cracks.

The kernels take it from here. Whoever changes it must change or touch their files too: numba's
cache notices changes of the compiled module only.
"""
BOX_SLACK_PX = 1e-6
"""Boxes are larger than their triangles by this, so that they never decide."""


@dataclass(frozen=True, eq=False)
class Raster:
    """What each pixel sees, ``(H, W)`` images."""

    depth_mm: Floats
    """Along the optical axis, 0 = background."""
    face: NDArray[np.int32]
    """Index of the triangle, -1 = background."""
    barycentric: Floats
    """``(H, W, 3)`` weights of its corners in space (perspective-correct), 0 = background."""


def pixel_rays(K: Floats, size_px: tuple[int, int]) -> Floats:
    """Directions ``(H, W, 3)`` with z = 1 through the pixel centres."""
    u, v = np.meshgrid(np.arange(size_px[0]) + 0.5, np.arange(size_px[1]) + 0.5)
    rays: Floats = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(K).T
    return rays


def rasterise(mesh: Mesh, pose_c_m: Pose, K: Floats, size_px: tuple[int, int]) -> Raster:
    """Depth, triangle and barycentric weights of every pixel.

    Args:
        mesh: the object.
        pose_c_m: one pose.
        K: ``(3, 3)``, px.
        size_px: ``(width, height)``.
    """
    rays = pixel_rays(K, size_px)
    depth_mm = np.full(rays.shape[:2], np.inf)
    face = np.full(rays.shape[:2], -1, np.int32)
    barycentric = np.zeros(rays.shape)
    corners_mm = pose_c_m.apply(mesh.vertices_mm)[mesh.faces]
    low, high = pixel_boxes(corners_mm, K, size_px)
    for f in np.flatnonzero((low < high).all(axis=-1)):
        part = np.s_[low[f, 1] : high[f, 1], low[f, 0] : high[f, 0]]
        weights, z_mm = intersect(rays[part], corners_mm[f])
        nearer = z_mm < depth_mm[part]
        depth_mm[part][nearer] = z_mm[nearer]
        face[part][nearer] = f
        barycentric[part][nearer] = weights[nearer]
    depth_mm[face < 0] = 0
    return Raster(depth_mm, face, barycentric)


def render_depth(mesh: Mesh, pose_c_m: Pose, K: Floats, size_px: tuple[int, int]) -> Floats:
    """Depth image ``(H, W)``, mm, 0 = background."""
    return rasterise(mesh, pose_c_m, K, size_px).depth_mm


def intersect(rays: Floats, corners_mm: Floats) -> tuple[Floats, Floats]:
    """Where rays with z = 1 meet a triangle.

    A point with weights b of the corners lies on the ray at depth z if ``sum b_i p_i = z ray``.
    So ``b / z`` is linear in the ray (Cramer's rule), and ``sum b = 1`` gives z.

    Args:
        rays: ``(..., 3)``.
        corners_mm: ``(3, 3)``, one corner a row, in the camera frame.

    Returns:
        Weights ``(..., 3)`` and depths ``(...)``, which are inf where the ray misses.
    """
    p0, p1, p2 = corners_mm
    volume = p0 @ np.cross(p1, p2)
    if volume == 0:  # a line or a point, or seen edge-on: no ray meets it
        return np.zeros(rays.shape), np.full(rays.shape[:-1], np.inf)
    over_z = rays @ np.stack([np.cross(p1, p2), np.cross(p2, p0), np.cross(p0, p1)]).T / volume
    with np.errstate(divide="ignore", invalid="ignore"):
        z_mm = 1 / over_z.sum(axis=-1)
        weights = over_z * z_mm[..., None]
    meets = (z_mm >= NEAR_MM) & (weights >= -EDGE_SLACK).all(axis=-1)
    return weights, np.where(meets, z_mm, np.inf)


def pixel_boxes(
    corners_mm: Floats, K: Floats, size_px: tuple[int, int]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First column and row, and the ends, ``(F, 2)`` each, of pixels that may see a triangle.

    Args:
        corners_mm: ``(F, 3, 3)``, in the camera frame.
        K: ``(3, 3)``, px.
        size_px: what the boxes are clipped to. All of it if a triangle reaches the near plane.
    """
    projected = corners_mm @ K.T
    with np.errstate(divide="ignore", invalid="ignore"):
        centres = projected[..., :2] / projected[..., 2:] - 0.5
    crossing = corners_mm[..., 2].min(axis=-1) < NEAR_MM
    low = np.ceil(centres.min(axis=1) - BOX_SLACK_PX)
    high = np.floor(centres.max(axis=1) + BOX_SLACK_PX) + 1
    low[crossing], high[crossing] = 0, size_px
    return np.clip(low, 0, size_px).astype(np.int64), np.clip(high, 0, size_px).astype(np.int64)
