"""Normals that are smooth over curved parts and sharp at edges."""

from __future__ import annotations

import numpy as np

from sixd.geometry.mesh import Mesh, face_normals_by_area


def creased(mesh: Mesh, angle_deg: float = 40.0) -> Mesh:
    """The same surface with vertices doubled along sharp edges, and a normal at each.

    For pictures only: the closed mesh, whose vertices are shared, is what errors are measured on.

    Args:
        mesh: with shared vertices.
        angle_deg: triangles at one vertex share a normal if they are turned by less than this.
    """
    by_area = face_normals_by_area(mesh)
    unit = by_area / np.linalg.norm(by_area, axis=1, keepdims=True)
    vertex = mesh.faces.reshape(-1)
    order = np.argsort(vertex, kind="stable")
    face, vertex = order // 3, vertex[order]
    normals = by_area[face].copy()
    # Corners of one vertex are neighbours now: compare each with the k-th after it.
    for k in range(1, int(np.bincount(vertex).max())):
        first = np.flatnonzero(vertex[:-k] == vertex[k:])
        a, b = face[first], face[first + k]
        alike = (unit[a] * unit[b]).sum(axis=1) > np.cos(np.deg2rad(angle_deg))
        normals[first[alike]] += by_area[b[alike]]
        normals[first[alike] + k] += by_area[a[alike]]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    keys = np.column_stack([vertex, np.rint(normals * 1e4)])
    _, kept, new_index = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    faces = np.zeros(len(order), np.int32)
    faces[order] = new_index.reshape(-1)
    source = vertex[kept]
    return Mesh(
        mesh.vertices_mm[source],
        faces.reshape(-1, 3),
        normals[kept],
        None if mesh.colors is None else mesh.colors[source],
    )
