"""What each pixel of a scene of several objects sees: object, triangle, place on it, depth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sixd.geometry.mesh import Mesh
from sixd.geometry.pose import Floats, Pose
from sixd.render.clipping import NEAR_MM


@dataclass(frozen=True, eq=False)
class SceneObject:
    """A mesh in its place."""

    mesh: Mesh
    pose_c_m: Pose
    """Batch shape ``()``."""
    color: tuple[int, int, int] | None = None
    """RGB for all of it, instead of the mesh's own texture or vertex colours."""


@dataclass(frozen=True, eq=False)
class SceneRaster:
    """Images ``(H, W)`` of what each pixel's ray meets first."""

    depth_mm: Floats
    """Along the optical axis, 0 = background."""
    instance_id: NDArray[np.int32]
    """Index of the object, -1 = background."""
    face_id: NDArray[np.int32]
    """Index of its triangle, -1 = background."""
    barycentric: Floats
    """``(H, W, 3)`` weights of the triangle's corners in space (perspective-correct)."""


def rasterise_scene(
    objects: Sequence[SceneObject], K: Floats, size_px: tuple[int, int]
) -> SceneRaster:
    """Find the nearest surface of every pixel; conventions as `sixd.render.reference`.

    Args:
        objects: a surface exactly as near as that of an earlier object does not replace it.
        K: ``(3, 3)``, px.
        size_px: ``(width, height)``.
    """
    from sixd.render.scene_kernels import draw_object

    shape = (int(size_px[1]), int(size_px[0]))
    inverse_z, weights = np.zeros(shape), np.zeros((*shape, 2))
    instance_id, face_id = np.full(shape, -1, np.int32), np.full(shape, -1, np.int32)
    for i, item in enumerate(objects):
        points = np.ascontiguousarray(item.pose_c_m.apply(item.mesh.vertices_mm) @ K.T)
        draw_object(points, item.mesh.faces, NEAR_MM, i, inverse_z, instance_id, face_id, weights)
    depth_mm = np.divide(1.0, inverse_z, out=np.zeros(shape), where=inverse_z > 0)
    third = np.where(instance_id >= 0, 1.0 - weights.sum(axis=-1), 0.0)
    return SceneRaster(depth_mm, instance_id, face_id, np.dstack([weights, third]))
