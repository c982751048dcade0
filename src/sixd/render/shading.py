"""Colour images of scenes: vertex colours or textures, Lambert and ambient light, soft shadows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sixd.geometry.pose import Floats
from sixd.render.scene import SceneObject, SceneRaster, rasterise_scene
from sixd.render.shadows import NO_SHADOWS, shadow_map
from sixd.render.surface import camera_normals, paint


@dataclass(frozen=True)
class Light:
    """One distant light over ambient light that falls from everywhere."""

    to_light_c: tuple[float, float, float] = (-0.45, -0.7, -0.75)
    """Direction from the scene to the light, in the camera frame (x right, y down, z forward)."""
    ambient: float = 0.45
    """Share of the colour that shadow keeps."""
    highlight: float = 0.12
    """Strength of the reflection of the light itself."""
    shadows: bool = True


@dataclass(frozen=True, eq=False)
class RenderedScene:
    """A picture of a scene with its truth."""

    rgb: NDArray[np.uint8]
    """``(H, W, 3)``."""
    depth_mm: NDArray[np.float32]
    """``(H, W)`` along the optical axis, 0 = background."""
    instance_id: NDArray[np.int32]
    """``(H, W)`` index of the object, -1 = background."""


def render_scene(
    objects: Sequence[SceneObject],
    K: Floats,
    size_px: tuple[int, int],
    *,
    light: Light | None = None,
    background: tuple[int, int, int] | NDArray[np.uint8] = (198, 202, 208),
    supersample: int = 2,
) -> RenderedScene:
    """Render several objects, which may hide and shade one another.

    Args:
        objects: what is there; a table is an object too.
        K: ``(3, 3)``, px.
        size_px: ``(width, height)``.
        light: where it comes from; over the camera's left shoulder if not given.
        background: one RGB colour, or an image ``(H, W, 3)``.
        supersample: colour is the mean of this many squared samples of a pixel. Depth and
            instances are those of its centre.

    Raises:
        MissingDataError: an object's texture is missing or cannot be read.
    """
    width, height = int(size_px[0]), int(size_px[1])
    truth = rasterise_scene(objects, K, (width, height))
    fine_K = np.diag([supersample, supersample, 1.0]) @ K
    fine = truth
    if supersample > 1:
        fine = rasterise_scene(objects, fine_K, (width * supersample, height * supersample))
    colors = shade(objects, fine, fine_K, light or Light())
    behind = np.broadcast_to(np.asarray(background, np.float32), (height, width, 3))
    behind = behind.repeat(supersample, axis=0).repeat(supersample, axis=1)
    image = np.where(fine.instance_id[..., None] >= 0, colors, behind)
    image = image.reshape(height, supersample, width, supersample, 3).mean(axis=(1, 3))
    return RenderedScene(
        np.rint(image.clip(0, 255)).astype(np.uint8),
        truth.depth_mm.astype(np.float32),
        truth.instance_id,
    )


def shade(
    objects: Sequence[SceneObject], raster: SceneRaster, K: Floats, light: Light
) -> NDArray[np.float32]:
    """Colours ``(H, W, 3)``, 0 to 255, of what a raster sees; background stays 0."""
    from sixd.render.shading_kernels import shade_object

    to_light = np.asarray(light.to_light_c, np.float64)
    to_light = to_light / np.linalg.norm(to_light)
    shadow = shadow_map(objects, raster, K, to_light) if light.shadows else NO_SHADOWS
    rgb = np.zeros((*raster.instance_id.shape, 3), np.float32)
    n_samples = np.bincount(raster.instance_id.ravel() + 1, minlength=len(objects) + 1)[1:]
    for i, item in enumerate(objects):
        if n_samples[i]:
            shade_object(
                i,
                (raster.instance_id, raster.face_id, raster.depth_mm, raster.barycentric),
                np.linalg.inv(K),
                (item.mesh.faces, *camera_normals(item)),
                paint(item, int(n_samples[i])),
                (tuple(to_light.tolist()), light.ambient, light.highlight),
                (shadow.nearest_mm, shadow.P, shadow.texel_mm),
                rgb,
            )
    return rgb
