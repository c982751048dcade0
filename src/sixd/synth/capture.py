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
from sixd.render.scene import SceneObject
from sixd.render.shading import Light, render_scene
from sixd.synth.scenes import Placement, View
from sixd.synth.sensor import sense_depth_mm

TO_LAMP_W = np.array([-0.35, 0.45, 1.0])
"""Direction to the lamp, world frame."""


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
    """Colour image ``(H, W, 3)``, under a lamp that stands still while the camera moves."""
    lamp = view.pose_c_w.R @ TO_LAMP_W
    items = [SceneObject(mesh, pose) for mesh, pose in zip(meshes, poses_c_m, strict=True)]
    light = Light(to_light_c=(float(lamp[0]), float(lamp[1]), float(lamp[2])))
    return render_scene(items, view.K, view.size_px, light=light, background=_wall(view)).rgb


def _wall(view: View) -> NDArray[np.uint8]:
    """A wall behind the table, darker towards the floor."""
    width, height = view.size_px
    brightness = np.linspace(1.0, 0.72, height)[:, None, None]
    wall = np.broadcast_to(np.array([206.0, 210.0, 212.0]) * brightness, (height, width, 3))
    return wall.astype(np.uint8)


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
