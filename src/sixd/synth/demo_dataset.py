"""The demo dataset: a small tabletop benchmark in BOP layout, made on the spot."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

import numpy as np

from sixd.datasets.annotate.coco import (
    IGNORE_BELOW,
    CocoAnnotation,
    coco_annotation,
    coco_file,
)
from sixd.datasets.annotate.gt_info import GtInfo
from sixd.datasets.writing import (
    camera_entry,
    mask_name,
    new_folder,
    pose_entry,
    write_coco,
    write_depth,
    write_image,
    write_json_list,
    write_json_object,
    write_mask,
)
from sixd.errors import UsageError
from sixd.evaluation.measure import Progress, no_progress
from sixd.files import write_atomically
from sixd.geometry.mesh import Mesh, write_ply
from sixd.synth.capture import Capture, capture
from sixd.synth.creases import creased
from sixd.synth.objects import BuiltinObject, builtin_objects
from sixd.synth.scenes import Scene, View, kinect_like_camera, make_scene
from sixd.synth.sensor import DEPTH_SCALE
from sixd.synth.table import table_mesh

DEMO_NAME = "sixdemo"
"""Name of the dataset, whatever its folder is called: without ``_`` and ``-``, which result file
names are split at."""

VSD_DELTA_MM = 15.0
INSTANCES_PER_SCENE = 9

_DATASET_TOML = f"""\
name = "{DEMO_NAME}"
title = "sixd demo: six built-in objects on a table, rendered"
objects = "{{objects}}"
vsd_delta_mm = {VSD_DELTA_MM}
"""


@dataclass
class _SceneFiles:
    """What the JSON files of one scene collect, image by image."""

    cameras: dict[int, object] = field(default_factory=dict)
    poses: dict[int, object] = field(default_factory=dict)
    info: dict[int, list[GtInfo]] = field(default_factory=dict)
    coco: list[CocoAnnotation] = field(default_factory=list)


def make_demo_dataset(
    path: str | Path,
    seed: int = 0,
    scenes: int = 2,
    images_per_scene: int = 4,
    size_px: tuple[int, int] = (480, 360),
    *,
    workers: int | None = None,
    progress: Progress = no_progress,
) -> Path:
    """Make a dataset with models, images, truth, COCO annotations and target lists.

    Same arguments, same bytes, whatever the number of workers. The folder appears when it is
    complete.

    Args:
        path: folder to make; must not exist.
        seed: of everything that varies.
        scenes: number of scenes; in each, one object is absent and some occur twice.
        images_per_scene: number of views of each.
        size_px: ``(w, h)``.
        workers: threads; by default one for each core, at most four.
        progress: told of every image.

    Returns:
        ``path``.

    Raises:
        UsageError: the folder exists, or a number is not positive.
    """
    path = Path(path)
    workers = workers or min(4, os.cpu_count() or 1)
    if min(scenes, images_per_scene, *size_px) < 1:
        raise UsageError("scenes, images_per_scene and size_px must be positive")
    objects = builtin_objects()
    made = count(1)

    def image_done() -> None:
        progress("demo images", next(made), scenes * images_per_scene)

    with new_folder(path) as folder, ThreadPoolExecutor(workers) as pool:
        _write_models(folder, objects, size_px)
        targets: list[dict[str, int]] = []
        for scene_id in range(1, scenes + 1):
            scene = make_scene(
                objects,
                np.random.default_rng([seed, scene_id]),
                n_instances=INSTANCES_PER_SCENE,
                n_views=images_per_scene,
                size_px=size_px,
                absent=list(objects)[(scene_id - 1) % len(objects)],
            )
            scene_dir = folder / "test" / f"{scene_id:06d}"
            info = _write_scene(scene_dir, objects, scene, (seed, scene_id), pool, image_done)
            targets += _targets(scene_id, scene, info)
        _write_targets(folder, targets, scenes, images_per_scene)
    return path


def _write_models(
    folder: Path, objects: Mapping[int, BuiltinObject], size_px: tuple[int, int]
) -> None:
    for name in ("models", "models_eval"):
        (folder / name).mkdir()
        for obj_id, item in objects.items():
            # Errors depend on shape alone, so the evaluation models carry no colours.
            bare = Mesh(item.mesh.vertices_mm, item.mesh.faces)
            mesh = item.mesh if name == "models" else bare
            write_ply(folder / name / f"obj_{obj_id:06d}.ply", mesh)
        info = {obj_id: item.models_info() for obj_id, item in objects.items()}
        write_json_object(folder / name / "models_info.json", info)
    ids = ",".join(map(str, objects))
    write_atomically(folder / "dataset.toml", _DATASET_TOML.format(objects=ids).encode())
    K = kinect_like_camera(size_px)
    camera = {
        "cx": K[0, 2],
        "cy": K[1, 2],
        "depth_scale": DEPTH_SCALE,
        "fx": K[0, 0],
        "fy": K[1, 1],
        "height": size_px[1],
        "width": size_px[0],
    }
    write_json_object(folder / "camera.json", camera)


def _write_scene(
    folder: Path,
    objects: Mapping[int, BuiltinObject],
    scene: Scene,
    seed: Sequence[int],
    pool: Executor,
    image_done: Callable[[], None],
) -> Mapping[int, list[GtInfo]]:
    """All files of a scene; gives its gt info by image."""
    meshes = {obj_id: creased(item.mesh) for obj_id, item in objects.items()}
    table = creased(table_mesh(np.random.default_rng([*seed, 0])))

    def take(im_id: int) -> Capture:
        # Each image has its own source of noise: none depends on those made before it.
        rng = np.random.default_rng([*seed, 1 + im_id])
        taken = capture(meshes, table, scene.placements, scene.views[im_id], rng)
        _write_image(folder, im_id, taken)
        return taken

    files = _SceneFiles()
    for im_id, taken in enumerate(pool.map(take, range(len(scene.views)))):
        _note(files, im_id, scene, scene.views[im_id], taken)
        image_done()
    write_json_object(folder / "scene_camera.json", files.cameras)
    write_json_object(folder / "scene_gt.json", files.poses)
    write_json_object(folder / "scene_gt_info.json", files.info)
    images = [(im_id, f"rgb/{im_id:06d}.png") for im_id in files.cameras]
    size_px = scene.views[0].size_px
    coco = coco_file(f"{DEMO_NAME} scene {folder.name}", objects, images, size_px, files.coco)
    write_coco(folder / "scene_gt_coco.json", coco)
    return files.info


def _write_image(folder: Path, im_id: int, taken: Capture) -> None:
    write_image(folder / "rgb" / f"{im_id:06d}.png", taken.rgb)
    write_depth(folder / "depth" / f"{im_id:06d}.png", taken.depth_mm, DEPTH_SCALE)
    for gt_id, instance in enumerate(taken.instances):
        write_mask(folder / "mask" / mask_name(im_id, gt_id), instance.mask)
        write_mask(folder / "mask_visib" / mask_name(im_id, gt_id), instance.visible)


def _note(files: _SceneFiles, im_id: int, scene: Scene, view: View, taken: Capture) -> None:
    """Enter one image into the scene's JSON files."""
    files.cameras[im_id] = {
        **camera_entry(view.K, DEPTH_SCALE),
        "cam_R_w2c": view.pose_c_w.R.reshape(-1).tolist(),
        "cam_t_w2c": view.pose_c_w.t_mm.tolist(),
    }
    files.poses[im_id] = [
        pose_entry(placement.obj_id, pose.R, pose.t_mm)
        for placement, pose in zip(scene.placements, taken.poses_c_m, strict=True)
    ]
    files.info[im_id] = [instance.info for instance in taken.instances]
    for placement, instance in zip(scene.placements, taken.instances, strict=True):
        annotation = coco_annotation(
            len(files.coco) + 1,
            im_id,
            placement.obj_id,
            instance.mask,
            instance.visible,
            instance.info["visib_fract"],
        )
        if annotation is not None:
            files.coco.append(annotation)


def _targets(scene_id: int, scene: Scene, info: Mapping[int, list[GtInfo]]) -> list[dict[str, int]]:
    """Entries of the bop19 list: instances of which a tenth is visible, counted by object."""
    targets = []
    for im_id, rows in info.items():
        seen = [
            placement.obj_id
            for placement, row in zip(scene.placements, rows, strict=True)
            if row["visib_fract"] >= IGNORE_BELOW
        ]
        targets += [
            {
                "im_id": im_id,
                "inst_count": seen.count(obj_id),
                "obj_id": obj_id,
                "scene_id": scene_id,
            }
            for obj_id in sorted(set(seen))
        ]
    return targets


def _write_targets(
    folder: Path, targets: list[dict[str, int]], scenes: int, images_per_scene: int
) -> None:
    write_json_list(folder / "test_targets_bop19.json", targets)
    images = [
        {"im_id": im_id, "scene_id": scene_id}
        for scene_id in range(1, scenes + 1)
        for im_id in range(images_per_scene)
    ]
    write_json_list(folder / "test_targets_bop24.json", images)
