"""Rigid transforms, batched."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sixd.errors import ShapeError, check_shape

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pose:
    """Rigid transform(s) ``dst <- src``; leading axes are batch axes.

    A variable that holds one is named ``pose_<dst>_<src>``: ``pose_c_m`` maps model to camera.
    """

    R: Floats
    """``(..., 3, 3)`` rotations."""
    t_mm: Floats
    """``(..., 3)`` translations, millimetres."""

    def __post_init__(self) -> None:
        check_shape("Pose.R", self.R, (3, 3))
        check_shape("Pose.t_mm", self.t_mm, (3,))
        if self.R.shape[:-2] != self.t_mm.shape[:-1]:
            raise ShapeError(
                f"Pose.R and Pose.t_mm must have the same batch shape, "
                f"got {self.R.shape[:-2]} and {self.t_mm.shape[:-1]}"
            )

    @classmethod
    def identity(cls, *batch: int) -> Pose:
        """The transform that moves nothing, repeated to the batch shape."""
        return cls(np.broadcast_to(np.eye(3), (*batch, 3, 3)).copy(), np.zeros((*batch, 3)))

    @property
    def batch_shape(self) -> tuple[int, ...]:
        """Shape of the leading axes."""
        return self.t_mm.shape[:-1]

    def __len__(self) -> int:
        return len(self.t_mm)

    def __getitem__(self, index: Any) -> Pose:
        return Pose(self.R[index], self.t_mm[index])

    def __matmul__(self, other: Pose) -> Pose:
        """Compose: ``pose_c_m = pose_c_w @ pose_w_m``."""
        return Pose(self.R @ other.R, (self.R @ other.t_mm[..., None])[..., 0] + self.t_mm)

    def inverse(self) -> Pose:
        """``src <- dst``; exact for rotations."""
        R = np.swapaxes(self.R, -1, -2)
        return Pose(R, -(R @ self.t_mm[..., None])[..., 0])

    def apply(self, points_mm: Floats) -> Floats:
        """Map points ``(P, 3)`` in src to ``(..., P, 3)`` in dst, millimetres."""
        moved: Floats = points_mm @ np.swapaxes(self.R, -1, -2) + self.t_mm[..., None, :]
        return moved


def rotations_about(axes: Floats, angles_rad: Floats) -> Floats:
    """Rotations ``(N, 3, 3)`` about axes ``(N, 3)`` or ``(3,)``, any length but 0 (Rodrigues)."""
    unit = axes / np.linalg.norm(axes, axis=-1, keepdims=True)
    x, y, z = np.moveaxis(unit, -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1)
    cos, sin = np.cos(angles_rad)[..., None, None], np.sin(angles_rad)[..., None, None]
    outer = unit[..., :, None] * unit[..., None, :]
    R: Floats = cos * np.eye(3) + (1 - cos) * outer + sin * cross.reshape(*unit.shape, 3)
    return R


def camera_pose(eye_mm: Floats, forward: Floats, right: Floats) -> Pose:
    """Camera from world of a camera at a point; its z and x axes are given as unit vectors."""
    R = np.stack([right, np.cross(forward, right), forward])
    return Pose(R, -R @ eye_mm)
