"""Colours and normals of a mesh, as shading wants them."""

from __future__ import annotations

import numpy as np

from sixd.errors import MissingDataError
from sixd.geometry.mesh import Mesh, face_normals_by_area
from sixd.geometry.pose import Floats
from sixd.render.scene import SceneObject

PLAIN = (176, 176, 180)
"""Colour of a mesh that has none."""


def camera_normals(item: SceneObject) -> tuple[Floats, Floats]:
    """Unit normals in the camera frame of the triangles ``(F, 3)`` and of the vertices ``(V, 3)``.

    Vertices keep the normals of the file; without, they take the mean of their triangles by area.
    """
    mesh, to_camera = item.mesh, item.pose_c_m.R.T
    by_area = face_normals_by_area(mesh)
    at_vertices = mesh.normals
    if at_vertices is None:
        at_vertices = np.zeros(mesh.vertices_mm.shape)
        for axis in range(3):
            at_vertices[:, axis] = np.bincount(
                mesh.faces.ravel(), by_area[:, axis].repeat(3), minlength=len(at_vertices)
            )
    return _unit(by_area) @ to_camera, _unit(at_vertices) @ to_camera


def paint(item: SceneObject, n_samples: int) -> tuple[Floats, Floats, Floats]:
    """Vertex colours ``(V, 3)``, texture ``(h, w, 3)``, texture coordinates ``(F, 3, 2)``.

    The texture is empty where the colours are to be used: the object's one colour comes first, then
    its texture, then its vertex colours.

    Args:
        item: the object.
        n_samples: how many pixels show it; the texture is shrunk to about one texel a pixel.

    Raises:
        MissingDataError: the texture is missing or cannot be read.
    """
    mesh = item.mesh
    colors = np.full(mesh.vertices_mm.shape, item.color or PLAIN, np.float64)
    no_texture, no_uv = np.zeros((0, 1, 3)), np.zeros((0, 3, 2))
    if item.color is None and mesh.texture_file is not None and mesh.corner_uv is not None:
        texture = _shrunk_texture(mesh, mesh.corner_uv, n_samples)
        return colors, texture, mesh.corner_uv
    if item.color is None and mesh.colors is not None:
        colors = mesh.colors.astype(np.float64)
    return colors, no_texture, no_uv


def _shrunk_texture(mesh: Mesh, corner_uv: Floats, n_samples: int) -> Floats:
    import cv2

    image = cv2.imread(str(mesh.texture_file), cv2.IMREAD_COLOR)
    if image is None:
        raise MissingDataError(f"no readable texture image at {mesh.texture_file}")
    height, width = image.shape[:2]
    (ax, ay), (bx, by) = (np.moveaxis(corner_uv[:, i] - corner_uv[:, 0], -1, 0) for i in (1, 2))
    n_used = np.abs(ax * by - ay * bx).sum() / 2 * width * height
    # An object shows about half of its surface.
    shrink = np.sqrt(2 * n_samples / n_used) if n_used else 1.0
    if shrink < 1:
        size = (max(1, round(width * shrink)), max(1, round(height * shrink)))
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return np.ascontiguousarray(image[..., ::-1], np.float64)


def _unit(vectors: Floats) -> Floats:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    unit: Floats = vectors / np.where(length > 0, length, 1)
    return unit
