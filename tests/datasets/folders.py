"""Tiny BOP folders of every layout, written here so that nothing has to be downloaded."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np

SIZE_PX = (8, 6)
K = [500.0, 0.0, 4.0, 0.0, 510.0, 3.0, 0.0, 0.0, 1.0]
FISHEYE = {
    "projection_model_type": "CameraModelType.FISHEYE624",
    "projection_params": [300.0, 4.0, 3.0, *[0.01] * 12],
    "image_width": 8,
    "image_height": 6,
    "serial_number": "1",
}
TRIANGLE = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
3 0 0
0 4 0
3 0 1 2
"""


def write_json(path: Path, content: object) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content))


def write_image(path: Path, value: int, kind: str, size_px: tuple[int, int] = SIZE_PX) -> None:
    width, height = size_px
    shape = (height, width, 3) if kind == "rgb" else (height, width)
    image = np.full(shape, value, np.uint16 if kind == "depth" else np.uint8)
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), image)


def instance(obj_id: int, t_mm: Iterable[float] = (1.0, 2.0, 500.0)) -> dict[str, Any]:
    R = [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    return {"obj_id": obj_id, "cam_R_m2c": R, "cam_t_m2c": list(t_mm)}


def write_scene(
    scene: Path,
    *,
    im_ids: Iterable[int] = (0, 3),
    objects: Iterable[int] = (1, 2, 1),
    suffix: str = "",
    images: Mapping[str, str] | None = None,
    camera: Mapping[str, Any] | None = None,
    size_px: tuple[int, int] = SIZE_PX,
    gt_info: bool = True,
) -> None:
    """One sensor of one scene; ``images`` maps folder to extension."""
    im_ids, objects = list(im_ids), list(objects)
    entry = dict(camera) if camera else {"cam_K": K, "depth_scale": 0.5}
    write_json(scene / f"scene_camera{suffix}.json", {str(i): entry for i in im_ids})
    gt = {str(i): [instance(o, (i, n, 500.5)) for n, o in enumerate(objects)] for i in im_ids}
    write_json(scene / f"scene_gt{suffix}.json", gt)
    if gt_info:
        info = {i: [{"visib_fract": 1 / (n + 1), "px_count_all": 9} for n in range(len(objects))]
                for i in gt}  # fmt: skip
        write_json(scene / f"scene_gt_info{suffix}.json", info)
    for folder, extension in (images or {"rgb": ".png", "depth": ".png"}).items():
        kind = next((k for k in ("depth", "gray") if folder.startswith(k)), "rgb")
        for i in im_ids:
            write_image(scene / folder / f"{i:06d}{extension}", (i + 10) % 250, kind, size_px)


def write_models(folder: Path, obj_ids: Iterable[int] = (1, 2), **extra: object) -> None:
    info = {str(i): {"diameter": 5.0, "min_x": 0, "size_x": 3, **extra} for i in obj_ids}
    write_json(folder / "models_info.json", info)
    for i in obj_ids:
        (folder / f"obj_{i:06d}.ply").write_text(TRIANGLE)


def write_targets(path: Path, im_ids: Iterable[int] = (0, 3), scene_id: int = 1) -> None:
    write_json(path, [
        {"scene_id": scene_id, "im_id": i, "obj_id": o, "inst_count": n}
        for i in im_ids for o, n in ((2, 1), (1, 2))
    ])  # fmt: skip


def write_classic(dataset: Path, split: str = "test", scenes: Iterable[int] = (1,)) -> Path:
    """A dataset of one unnamed sensor: models, targets, one split."""
    for scene_id in scenes:
        write_scene(dataset / split / f"{scene_id:06d}")
    write_models(dataset / "models_eval")
    write_targets(dataset / "test_targets_bop19.json")
    return dataset
