"""Taking a picture of a scene: colour, measured depth, and the masks of every instance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sixd.datasets.annotate.gt_info import InstanceMasks, canvas_camera, measure_instance
from sixd.geometry.mesh import Mesh
from sixd.geometry.pose import Floats, Pose
from sixd.render.raster import Crop, render_crop, render_depth
from sixd.synth.scenes import Placement, View
from sixd.synth.sensor import sense_depth_mm


@dataclass(frozen=True, eq=False)
class Capture:
    """One image with its annotations."""

    rgb: NDArray[np.uint8]
    """``(H, W, 3)``."""
    depth_mm: NDArray[np.float32]
    """``(H, W)`` as the sensor gives it."""
    poses_c_m: tuple[Pose, ...]
    """One for each placement."""
    instances: tuple[InstanceMasks, ...]
    """One for each placement."""


def capture(
    meshes: Mapping[int, Mesh],
    table: Mesh,
    placements: Sequence[Placement],
    view: View,
    rng: np.random.Generator,
) -> Capture:
    """Render a view, let a sensor measure its depth, and annotate what the sensor saw.

    Args:
        meshes: by object id.
        table: in the world frame.
        placements: what stands on it.
        view: the camera.
        rng: of the sensor's noise.
    """
    poses = tuple(view.pose_c_w @ p.pose_w_m for p in placements)
    canvas_K, canvas_px = canvas_camera(view.K, view.size_px)
    crops = []
    for placement, pose in zip(placements, poses, strict=True):
        crop = render_crop(meshes[placement.obj_id], pose, canvas_K, canvas_px)
        crops.append(Crop(crop.x0 - view.size_px[0], crop.y0 - view.size_px[1], crop.depth_mm))
    depth_mm = sense_depth_mm(
        _nearest_mm(crops, render_depth(table, view.pose_c_w, view.K, view.size_px)), rng
    )
    instances = [
        measure_instance(crop.depth_mm, (crop.x0, crop.y0), depth_mm, view.K) for crop in crops
    ]
    rgb = photograph(
        [*(meshes[p.obj_id] for p in placements), table], [*poses, view.pose_c_w], view
    )
    return Capture(rgb, depth_mm, poses, tuple(instances))


def photograph(meshes: Sequence[Mesh], poses_c_m: Sequence[Pose], view: View) -> NDArray[np.uint8]:
    """Colour image ``(H, W, 3)``."""
    return np.zeros((view.size_px[1], view.size_px[0], 3), np.uint8)


def _nearest_mm(crops: Sequence[Crop], background_mm: Floats) -> Floats:
    """Depth image of everything together, 0 where there is nothing."""
    nearest = np.where(background_mm > 0, background_mm, np.inf)
    height, width = nearest.shape
    for crop in crops:
        rows, columns = crop.depth_mm.shape
        top, bottom = np.clip([crop.y0, crop.y0 + rows], 0, height)
        left, right = np.clip([crop.x0, crop.x0 + columns], 0, width)
        part = crop.depth_mm[top - crop.y0 : bottom - crop.y0, left - crop.x0 : right - crop.x0]
        region = nearest[top:bottom, left:right]
        np.minimum(region, np.where(part > 0, part, np.inf), out=region)
    return np.where(np.isfinite(nearest), nearest, 0.0)
