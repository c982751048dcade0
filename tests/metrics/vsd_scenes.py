"""Small scenes with a depth image, for the tests of VSD and CUS."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sixd.geometry import Mesh, Pose
from sixd.render import RenderMesh, render_depth
from tests.render.shapes import SIZE_PX, K, blob
from tests.strategies import near_poses

DELTA_MM = 15.0
TAUS = np.arange(0.05, 0.51, 0.05)


@dataclass
class SmallScene:
    """Two objects before a wall, and estimates of their poses."""

    meshes: list[Mesh]
    diameters_mm: np.ndarray
    poses: Pose
    """``(Q,)`` estimates, then the two truths."""
    mesh_index: np.ndarray
    pairs: np.ndarray
    depth_mm: np.ndarray

    @property
    def prepared(self) -> list[RenderMesh]:
        return [RenderMesh.build(mesh) for mesh in self.meshes]

    @property
    def pair_diameters_mm(self) -> np.ndarray:
        return self.diameters_mm[self.mesh_index[self.pairs[:, 0]]]


def small_scene(rng: np.random.Generator, n_estimates: int = 3) -> SmallScene:
    meshes = [blob(rng, rng.uniform(40, 120), rings=5) for _ in range(2)]
    diameters_mm = np.array([2.2 * np.abs(mesh.vertices_mm).max() for mesh in meshes])
    t_mm = np.stack([*rng.uniform(-150, 150, (2, 2)), rng.uniform(400, 700, 2)], axis=-1)
    true = near_poses(rng, Pose(np.stack([np.eye(3)] * 2), t_mm), 180, 0)
    which = rng.integers(0, 2, n_estimates)
    est = near_poses(rng, true[which], rng.uniform(0, 60), rng.uniform(1, 80))
    poses = Pose(np.concatenate([est.R, true.R]), np.concatenate([est.t_mm, true.t_mm]))
    pairs = np.stack([np.arange(n_estimates), n_estimates + which], axis=-1)
    mesh_index = np.concatenate([which, [0, 1]])
    return SmallScene(meshes, diameters_mm, poses, mesh_index, pairs, _depth(rng, meshes, true))


def _depth(rng: np.random.Generator, meshes: list[Mesh], true: Pose) -> np.ndarray:
    depth_mm = np.full(SIZE_PX[::-1], rng.uniform(450, 900))
    for mesh, pose in zip(meshes, true, strict=True):
        seen = render_depth(mesh, pose, K, SIZE_PX)
        depth_mm = np.where((seen > 0) & (seen < depth_mm), seen, depth_mm)
    depth_mm += rng.normal(0, 8, depth_mm.shape)
    depth_mm[rng.random(depth_mm.shape) < 0.15] = 0
    return depth_mm.astype(np.float32)
