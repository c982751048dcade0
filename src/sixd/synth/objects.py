"""The built-in objects of the demo: meshes, exact diameters, declared symmetries, ways to rest."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from sixd.geometry.mesh import Mesh, bounding_box_mm, mesh_diameter_mm
from sixd.geometry.pose import Floats, Pose
from sixd.geometry.symmetry import Symmetries, SymmetryAxis
from sixd.synth import shapes


@dataclass(frozen=True, eq=False)
class BuiltinObject:
    """One object that is made, not read."""

    obj_id: int
    name: str
    mesh: Mesh
    """Closed, outward, coloured; origin at the centre of the bounding box."""
    diameter_mm: float
    symmetries: Symmetries
    rests: Floats
    """``(K, 3, 3)`` rotations world from model in which it stands or lies on a table (z up)."""

    def models_info(self) -> dict[str, object]:
        """Its entry of ``models_info.json``."""
        low_mm, size_mm = bounding_box_mm(self.mesh.vertices_mm)
        low = {f"min_{axis}": float(low_mm[k]) for k, axis in enumerate("xyz")}
        size = {f"size_{axis}": float(size_mm[k]) for k, axis in enumerate("xyz")}
        return {"diameter": self.diameter_mm, **low, **size, **self.symmetries.to_models_info()}


@dataclass(frozen=True)
class _Recipe:
    name: str
    shape: Callable[[], shapes.Painted]
    fold: int = 1
    """Turns about z that map the object to itself; 0 = any."""
    rests_deg: tuple[tuple[str, float], ...] = ()
    """Ways to rest besides upright: turned about an axis."""


_RECIPES: Mapping[int, _Recipe] = {
    1: _Recipe("tea carton", shapes.carton, rests_deg=(("x", 90.0), ("y", 90.0), ("x", -90.0))),
    2: _Recipe("toy brick", shapes.brick, fold=2, rests_deg=(("x", 90.0),)),
    3: _Recipe("flange nut", shapes.nut, fold=6),
    4: _Recipe("sauce bottle", shapes.bottle, fold=0, rests_deg=(("x", 90.0),)),
    5: _Recipe("mug", shapes.mug, rests_deg=(("x", 180.0),)),
    6: _Recipe("angle bracket", shapes.bracket, rests_deg=(("y", -90.0), ("x", 90.0))),
}


def builtin_objects() -> dict[int, BuiltinObject]:
    """All built-in objects by object id: carton, brick, nut, bottle, mug, bracket."""
    return {obj_id: _make(obj_id, recipe) for obj_id, recipe in _RECIPES.items()}


def turn_matrix(axis: str, angle_deg: float) -> Floats:
    """Rotation ``(3, 3)`` about the x, y or z axis; quarter turns are exact."""
    quarters = angle_deg / 90.0
    if quarters == round(quarters):
        cos, sin = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[round(quarters) % 4]
    else:
        cos, sin = float(np.cos(np.deg2rad(angle_deg))), float(np.sin(np.deg2rad(angle_deg)))
    k = "xyz".index(axis)
    i, j = (k + 1) % 3, (k + 2) % 3
    R = np.zeros((3, 3))
    R[k, k], R[i, i], R[j, j], R[i, j], R[j, i] = 1.0, cos, cos, -sin, sin
    return R


def _make(obj_id: int, recipe: _Recipe) -> BuiltinObject:
    surface, colours = recipe.shape()
    low_mm, size_mm = bounding_box_mm(surface.vertices_mm)
    centred_mm = surface.vertices_mm - (low_mm + size_mm / 2)
    # PLY keeps float32: rounding here makes the mesh in memory the mesh on disk.
    vertices_mm = centred_mm.astype(np.float32).astype(np.float64)
    mesh = Mesh(vertices_mm, surface.faces, colors=colours)
    rests = [np.eye(3), *(turn_matrix(axis, angle) for axis, angle in recipe.rests_deg)]
    return BuiltinObject(
        obj_id,
        recipe.name,
        mesh,
        mesh_diameter_mm(mesh.vertices_mm),
        _turns_about_z(recipe.fold),
        np.stack(rests),
    )


def _turns_about_z(fold: int) -> Symmetries:
    if fold == 0:
        return Symmetries(axes=(SymmetryAxis(np.array([0.0, 0.0, 1.0]), np.zeros(3)),))
    turns = [turn_matrix("z", 360.0 * k / fold) for k in range(1, fold)]
    return Symmetries(Pose(np.array(turns).reshape(-1, 3, 3), np.zeros((fold - 1, 3))))
