"""Meshes and cameras of the render tests."""

from __future__ import annotations

import numpy as np

from sixd.geometry import Mesh, Pose

SIZE_PX = (48, 36)
K = np.array([[60.0, 0, 23.3], [0, 62.0, 18.6], [0, 0, 1]])
FRONT = Pose(np.eye(3), np.zeros(3))
"""The model frame is the camera frame."""


def shifted(K: np.ndarray, right_px: float, down_px: float, skew: float = 0.0) -> np.ndarray:
    """The camera whose image is moved."""
    return K + np.array([[0, skew, right_px], [0, 0, down_px], [0, 0, 0]])


def soup(rng: np.random.Generator) -> Mesh:
    """Triangles of any size anywhere: needles, points, giants, partly or wholly behind."""
    n = int(rng.integers(1, 8))
    size_mm = 10.0 ** rng.uniform(-1, 3.5, (n, 1, 1))
    middle = np.stack([*rng.uniform(-300, 300, (2, n)), rng.uniform(-300, 1000, n)], axis=-1)
    corners = middle[:, None] + size_mm * rng.normal(size=(n, 3, 3))
    kind = rng.integers(0, 6, n)
    corners[kind == 0, 2] = corners[kind == 0, 1]
    corners[kind == 1, 2] = corners[kind == 1, :2].mean(axis=1)
    corners[kind == 2, 2] = corners[kind == 2, 1] + 1e-3 * rng.normal(size=3)
    return Mesh(corners.reshape(-1, 3), np.arange(3 * n).reshape(n, 3))


def blob(rng: np.random.Generator, radius_mm: float = 60.0, rings: int = 10) -> Mesh:
    """A closed, dented ball around the origin; small triangles."""
    polar = np.linspace(0, np.pi, rings + 1)[1:-1]
    around = np.linspace(0, 2 * np.pi, 2 * rings, endpoint=False)
    p, a = (grid.ravel() for grid in np.meshgrid(polar, around, indexing="ij"))
    points = np.stack([np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), np.cos(p)], axis=-1)
    points = np.concatenate([[[0, 0, 1]], points, [[0, 0, -1]]])
    points *= radius_mm * rng.uniform(0.8, 1.2, (len(points), 1))
    n = len(around)
    faces = []
    for i in range(n):
        j = (i + 1) % n
        faces.append((0, 1 + i, 1 + j))
        faces.append((len(points) - 1, len(points) - 1 - n + j, len(points) - 1 - n + i))
        for ring in range(rings - 2):
            a, b, c, d = (1 + (ring + k) * n + m for k in (0, 1) for m in (i, j))
            faces += [(a, c, b), (b, c, d)]
    return Mesh(points, np.array(faces))


def sphere(radius_mm: float, rings: int = 60) -> Mesh:
    """A ball of constant radius at its vertices."""
    mesh = blob(np.random.default_rng(0), 1.0, rings)
    vertices = mesh.vertices_mm / np.linalg.norm(mesh.vertices_mm, axis=1, keepdims=True)
    return Mesh(radius_mm * vertices, mesh.faces)


def sheet(
    corner: np.ndarray, side_a: np.ndarray, side_b: np.ndarray, rng: np.random.Generator
) -> Mesh:
    """A parallelogram cut into triangles at random places."""
    cuts = [np.unique([0, 1, *rng.uniform(0, 1, 7)]) for _ in range(2)]
    a, b = np.meshgrid(*cuts, indexing="ij")
    inner = (a > 0) & (a < 1) & (b > 0) & (b < 1)
    a, b = (x + inner * rng.uniform(-0.01, 0.01, x.shape) for x in (a, b))
    points = corner + a[..., None] * side_a + b[..., None] * side_b
    index = np.arange(a.size).reshape(a.shape)
    p, q, r, s = index[:-1, :-1], index[1:, :-1], index[:-1, 1:], index[1:, 1:]
    flip = rng.random(p.shape) < 0.5
    first = np.where(flip[..., None], np.dstack([p, q, s]), np.dstack([p, q, r]))
    second = np.where(flip[..., None], np.dstack([p, s, r]), np.dstack([q, s, r]))
    faces = np.concatenate([first.reshape(-1, 3), second.reshape(-1, 3)])
    return Mesh(points.reshape(-1, 3), faces)
