"""What a method may see of a dataset: images, camera, targets. Never the truth.

This module must not reach `sixd.datasets.truth`, not even through another module: a method that
holds a `Frame` cannot look up the answer. Tests hold it to that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from sixd.geometry import Camera, Pose
    from sixd.geometry.pose import Floats


@dataclass(frozen=True, eq=False)
class ImageCamera:
    """The camera of one image."""

    camera: Camera
    K: Floats | None
    """``(3, 3)`` intrinsics; None where the camera is not a pinhole."""
    depth_scale: float | None
    """Millimetres of one unit of the depth image; None where there is no depth."""
    pose_c_w: Pose | None = None
    """Camera from world, where the dataset tells it."""


@dataclass(frozen=True)
class Target:
    """An object to be found in an image."""

    obj_id: int
    inst_count: int | None = None
    """How many instances; None where the task does not tell."""


@dataclass(frozen=True, eq=False)
class Frame:
    """One image as a method gets it; images are decoded when they are first looked at."""

    scene_id: int
    im_id: int
    camera: ImageCamera
    targets: tuple[Target, ...] = ()
    _read_rgb: Callable[[], NDArray[np.uint8]] | None = field(default=None, repr=False)
    _read_depth_mm: Callable[[], NDArray[np.float32]] | None = field(default=None, repr=False)

    @cached_property
    def rgb(self) -> NDArray[np.uint8] | None:
        """``(H, W, 3)`` RGB or ``(H, W)`` grey; None where there is no such image."""
        return self._read_rgb() if self._read_rgb else None

    @cached_property
    def depth_mm(self) -> NDArray[np.float32] | None:
        """``(H, W)``, 0 = no reading; None where there is no such image."""
        return self._read_depth_mm() if self._read_depth_mm else None
