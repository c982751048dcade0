"""Triangle meshes: the value type, files in and out, size measures."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from sixd.errors import (
    FormatError,
    MissingDataError,
    Problem,
    ShapeError,
    UsageError,
    check_shape,
)
from sixd.geometry.ply import Columns, read_ply
from sixd.geometry.ply_writing import write_columns
from sixd.geometry.pose import Floats

MANY_VERTICES = 4000
"""Comparing so many pairwise takes about as long as importing what makes convex hulls."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh in its model frame."""

    vertices_mm: Floats
    """``(V, 3)`` float64, C-contiguous."""
    faces: NDArray[np.int32]
    """``(F, 3)`` vertex indices; ``(0, 3)`` for a point cloud."""
    normals: Floats | None = None
    """``(V, 3)``, as the file has them (not normalised)."""
    colors: NDArray[np.uint8] | None = None
    """``(V, 3)`` RGB."""
    uv: Floats | None = None
    """``(V, 2)`` texture coordinates, origin at the lower left of the image."""
    texture_file: Path | None = None
    """The image ``uv`` refers to, beside the mesh; it may not exist."""
    face_uv: Floats | None = None
    """``(F, 3, 2)`` texture coordinates of each corner, for files that store them per face."""

    def __post_init__(self) -> None:
        def coerce(name: str, dtype: type, shape: tuple[int, ...]) -> None:
            value = getattr(self, name)
            if value is None:
                return
            value = np.ascontiguousarray(value, dtype)
            if value.shape != shape:
                raise ShapeError(f"Mesh.{name} must have shape {shape}, got {value.shape}")
            object.__setattr__(self, name, value)

        check_shape("Mesh.vertices_mm", self.vertices_mm, (3,))
        check_shape("Mesh.faces", self.faces, (3,))
        n_vertices, n_faces = len(self.vertices_mm), len(self.faces)
        if len(self.faces) and not 0 <= np.min(self.faces) <= np.max(self.faces) < n_vertices:
            raise UsageError(f"Mesh.faces must hold indices from 0 to {n_vertices - 1}")
        coerce("vertices_mm", np.float64, (n_vertices, 3))
        coerce("faces", np.int32, (n_faces, 3))
        coerce("normals", np.float64, (n_vertices, 3))
        coerce("colors", np.uint8, (n_vertices, 3))
        coerce("uv", np.float64, (n_vertices, 2))
        coerce("face_uv", np.float64, (n_faces, 3, 2))
        if not np.isfinite(self.vertices_mm).all():
            raise UsageError("Mesh.vertices_mm must be finite")

    @property
    def corner_uv(self) -> Floats | None:
        """``(F, 3, 2)`` texture coordinates of every triangle's corners, however stored."""
        if self.face_uv is not None or self.uv is None:
            return self.face_uv
        corners: Floats = self.uv[self.faces]
        return corners


def read_mesh(path: str | Path) -> Mesh:
    """Read a mesh; the numbers of the file are taken as millimetres.

    PLY is read here: ASCII as float64, polygons cut into fans of triangles. OBJ, GLB, OFF and STL
    go through trimesh, vertices in file order, normals and embedded textures left out.

    Raises:
        MissingDataError: there is no such file.
        FormatError: it cannot be read as a mesh, or has no vertices, vertices that are not finite,
            or faces of vertices that do not exist; the path is named.
    """
    path = Path(path)
    if path.suffix.lower() != ".ply":
        return _read_with_trimesh(path)
    content = read_ply(path)
    vertices_mm = _vertices(content.vertex, path)
    _check_faces(content.triangles, len(vertices_mm), path)
    uvs = (("texture_u", "texture_v"), ("s", "t"), ("u", "v"))
    named = next((pair for pair in uvs if set(pair) <= content.vertex.keys()), ("", ""))
    texture = content.texture_name
    return Mesh(
        vertices_mm,
        content.triangles.astype(np.int32),
        normals=_stacked(content.vertex, ("nx", "ny", "nz")),
        colors=_colors(content.vertex, path),
        uv=_stacked(content.vertex, named),
        texture_file=path.parent / texture if texture else None,
        face_uv=content.corner_uv,
    )


def read_vertices(path: str | Path) -> Floats:
    """The vertices ``(V, 3)`` mm of `read_mesh`, without the time to read faces.

    Raises:
        MissingDataError, FormatError: as `read_mesh`; broken faces go unnoticed.
    """
    path = Path(path)
    if path.suffix.lower() != ".ply":
        return _read_with_trimesh(path).vertices_mm
    return _vertices(read_ply(path, faces=False, only=("x", "y", "z")).vertex, path)


def write_ply(path: str | Path, mesh: Mesh, binary: bool = True) -> None:
    """Write a mesh as PLY, whole or not at all; `read_mesh` gives the same bits back.

    Columns are stored as float where that loses nothing, else as double.
    """
    columns: Columns = {}
    groups = (
        (mesh.vertices_mm, ("x", "y", "z")),
        (mesh.normals, ("nx", "ny", "nz")),
        (mesh.colors, ("red", "green", "blue")),
        (mesh.uv, ("texture_u", "texture_v")),
    )
    for values, names in groups:
        if values is not None:
            columns.update(zip(names, _narrowed(values).T, strict=True))
    texture = mesh.texture_file.name if mesh.texture_file else None
    write_columns(Path(path), columns, mesh.faces, mesh.face_uv, texture, binary=binary)


def bounding_box_mm(vertices_mm: Floats) -> tuple[Floats, Floats]:
    """Lowest corner ``(3,)`` and size ``(3,)`` of the axis-aligned box, mm."""
    lowest: Floats = vertices_mm.min(axis=0)
    return lowest, vertices_mm.max(axis=0) - lowest


def face_normals_by_area(mesh: Mesh) -> Floats:
    """Normals ``(F, 3)``, as long as twice the triangle's area; counter-clockwise is outside."""
    corners = mesh.vertices_mm[mesh.faces]
    normals: Floats = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return normals


def mesh_diameter_mm(vertices_mm: Floats) -> float:
    """Largest distance of two vertices ``(V, 3)``, mm; exact up to rounding, not sampled.

    All vertices that can be an end of it are compared with all others that can.
    """
    points = _far_vertices(vertices_mm)
    if len(points) > MANY_VERTICES:
        points = _hull_vertices(points)
    squares = (points * points).sum(axis=1)
    best = 0.0
    # Chunks that stay in the cache.
    rows = max(1, 100_000 // len(points))
    for start in range(0, len(points), rows):
        # The expanded square finds the partner, the difference gives its distance unrounded.
        chunk = points[start : start + rows]
        partner = np.argmax(squares - 2 * (chunk @ points.T), axis=1)
        best = max(best, float(np.linalg.norm(chunk - points[partner], axis=1).max()))
    return best


def _far_vertices(vertices_mm: Floats) -> Floats:
    """Those, about the middle of their box, that are far enough from it to end the diameter."""
    lowest_mm, size_mm = bounding_box_mm(vertices_mm)
    points = vertices_mm - (lowest_mm + size_mm / 2)
    radius = np.linalg.norm(points, axis=1)
    end, known = int(radius.argmax()), 0.0
    for _ in range(3):  # from vertex to farthest vertex: a distance near the largest
        gaps = np.linalg.norm(points - points[end], axis=1)
        end = int(gaps.argmax())
        known = max(known, float(gaps[end]))
    far: Floats = points[radius + radius.max() >= known * (1 - 1e-9)]
    return far


def _hull_vertices(centred_mm: Floats) -> Floats:
    """Those of the points that can be ends of the diameter."""
    from scipy.spatial import ConvexHull, QhullError

    # Flat and straight sets have no hull in space, but one in their own dimension.
    _, sizes, directions = np.linalg.svd(centred_mm, full_matrices=False)
    rank = int((sizes > 1e-9 * sizes.max(initial=0.0)).sum())
    if rank < 2:
        along = centred_mm @ directions[0]
        return centred_mm[[int(along.argmin()), int(along.argmax())]]
    try:
        ends = ConvexHull(centred_mm @ directions[:rank].T).vertices
    except QhullError:
        return centred_mm
    hull: Floats = centred_mm[ends]
    return hull


def _fail(path: Path, what: str, expected: str, got: str) -> NoReturn:
    fix = "export the mesh again"
    raise FormatError(
        [Problem("bad-mesh", what, file=str(path), expected=expected, got=got[:200], fix=fix)]
    )


def _vertices(vertex: Columns, path: Path) -> Floats:
    vertices_mm = _stacked(vertex, ("x", "y", "z"))
    if vertices_mm is None:
        got = ", ".join(vertex) or "no properties"
        _fail(path, "vertices have no coordinates", "properties x, y, z", got)
    if not len(vertices_mm):
        _fail(path, "the mesh is empty", "one vertex or more", "0 vertices")
    broken = np.flatnonzero(~np.isfinite(vertices_mm).all(axis=1))
    if len(broken):
        got = f"{len(broken)} others, the first is vertex {broken[0]}: {vertices_mm[broken[0]]}"
        _fail(path, "vertices that are not finite", "finite numbers", got)
    return vertices_mm


def _check_faces(faces: NDArray[np.integer[Any]], n_vertices: int, path: Path) -> None:
    broken = np.flatnonzero(((faces < 0) | (faces >= n_vertices)).any(axis=1))
    if len(broken):
        got = f"{len(broken)} others, the first is face {broken[0]}: {faces[broken[0]].tolist()}"
        expected = f"indices from 0 to {n_vertices - 1}"
        _fail(path, "faces of vertices that do not exist", expected, got)


def _stacked(columns: Columns, names: tuple[str, ...]) -> Floats | None:
    if not set(names) <= columns.keys():
        return None
    return np.stack([columns[name] for name in names], axis=1).astype(np.float64)


def _colors(vertex: Columns, path: Path) -> NDArray[np.uint8] | None:
    colors = _stacked(vertex, ("red", "green", "blue"))
    if colors is None:
        return None
    if not ((colors >= 0) & (colors <= 255) & (colors == np.floor(colors))).all():
        got = f"values from {colors.min()} to {colors.max()}"
        _fail(path, "colours are not bytes", "whole numbers from 0 to 255", got)
    return colors.astype(np.uint8)


def _narrowed(values: NDArray[Any]) -> NDArray[Any]:
    if values.dtype == np.uint8:
        return values
    with np.errstate(over="ignore"):
        narrow = values.astype(np.float32)
    same = narrow.astype(np.float64) == values
    return narrow if same.all() else values


def _read_with_trimesh(path: Path) -> Mesh:
    if not path.is_file():
        raise MissingDataError(f"mesh {path} cannot be read: no such file")
    import trimesh

    try:
        # process=False: merging vertices would change ADD, their mean.
        loaded: Any = trimesh.load(path, force="mesh", process=False, maintain_order=True)
        vertices = np.array(loaded.vertices, np.float64).reshape(-1, 3)
        faces = np.array(loaded.faces, np.int64).reshape(-1, 3)
        kind = loaded.visual.kind
        colors = np.array(loaded.visual.vertex_colors)[:, :3] if kind == "vertex" else None
        uv = loaded.visual.uv if kind == "texture" else None
    except Exception as error:  # a foreign parser: whatever it raises, the file is the cause
        _fail(path, "trimesh cannot read it", "PLY, OBJ, GLB, OFF or STL", repr(error))
    columns = dict(zip("xyz", vertices.T, strict=True))
    vertices = _vertices(columns, path)
    _check_faces(faces, len(vertices), path)
    return Mesh(vertices, faces.astype(np.int32), colors=colors, uv=uv)
