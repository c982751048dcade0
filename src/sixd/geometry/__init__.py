"""Poses, cameras, symmetries, meshes: the nouns every other room speaks in."""

from sixd.geometry.camera import (
    Camera,
    Fisheye624Camera,
    KannalaBrandtCamera,
    PinholeCamera,
    camera_from_bop,
)
from sixd.geometry.mesh import (
    Mesh,
    bounding_box_mm,
    mesh_diameter_mm,
    read_mesh,
    read_vertices,
    write_ply,
)
from sixd.geometry.pose import Pose
from sixd.geometry.symmetry import Symmetries, SymmetryAxis

__all__ = [
    "Camera",
    "Fisheye624Camera",
    "KannalaBrandtCamera",
    "Mesh",
    "PinholeCamera",
    "Pose",
    "Symmetries",
    "SymmetryAxis",
    "bounding_box_mm",
    "camera_from_bop",
    "mesh_diameter_mm",
    "read_mesh",
    "read_vertices",
    "write_ply",
]
