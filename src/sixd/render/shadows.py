"""What a distant light sees: surfaces behind that lie in shadow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sixd.geometry.pose import Floats, camera_pose
from sixd.render.raster import projection_matrices, render_crop
from sixd.render.scene import SceneObject, SceneRaster

MAP_PX = 1024
"""Side of the light's depth image."""
SPARSE = 8
"""Every eighth row and column tell well enough where the visible scene is."""
FAR = 20.0
"""The light stands this many radii of the visible scene away: its rays are almost parallel."""


@dataclass(frozen=True, eq=False)
class ShadowMap:
    """The depth image of a light."""

    nearest_mm: Floats
    """``(MAP_PX, MAP_PX)``, inf = nothing."""
    P: Floats
    """``(3, 4)``: camera frame to the light's pixels."""
    texel_mm: float
    """Size of a pixel on a surface."""


NO_SHADOWS = ShadowMap(np.full((1, 1), np.inf), np.eye(3, 4), 0.0)


def shadow_map(
    objects: Sequence[SceneObject], raster: SceneRaster, K: Floats, to_light: Floats
) -> ShadowMap:
    """Depth image of a light that covers all that the camera sees.

    Args:
        objects: what casts shadows.
        raster: what the camera sees.
        K: ``(3, 3)`` of the camera, px.
        to_light: ``(3,)`` unit direction to the light, in the camera frame.
    """
    every = np.s_[::SPARSE, ::SPARSE]
    rows, columns = np.nonzero(raster.depth_mm[every])
    if not len(rows):
        return NO_SHADOWS
    pixels = np.stack([columns * SPARSE, rows * SPARSE, np.ones(len(rows))], axis=-1)
    depth_mm = raster.depth_mm[every][rows, columns]
    points_mm = pixels @ np.linalg.inv(K).T * depth_mm[:, None]
    low, high = points_mm.min(axis=0), points_mm.max(axis=0)
    radius_mm = max(float(np.linalg.norm(high - low)) / 2, 1.0)
    right = np.cross(np.eye(3)[np.argmin(np.abs(to_light))], to_light)
    pose_l_c = camera_pose(
        (low + high) / 2 + FAR * radius_mm * to_light, -to_light, right / np.linalg.norm(right)
    )
    focal_px = MAP_PX / 2 * np.sqrt(FAR**2 - 1)
    light_K = np.array([[focal_px, 0, MAP_PX / 2], [0, focal_px, MAP_PX / 2], [0, 0, 1]])
    nearest = np.full((MAP_PX, MAP_PX), np.inf)
    for item in objects:
        crop = render_crop(item.mesh, pose_l_c @ item.pose_c_m, light_K, (MAP_PX, MAP_PX))
        height, width = crop.depth_mm.shape
        part = nearest[crop.y0 : crop.y0 + height, crop.x0 : crop.x0 + width]
        np.minimum(part, crop.depth_mm, out=part, where=crop.depth_mm > 0)
    return ShadowMap(nearest, projection_matrices(pose_l_c, light_K), 2 * radius_mm / MAP_PX)
