"""The cameras of a scene, from ``scene_camera.json``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np

from sixd.datasets.frames import ImageCamera
from sixd.datasets.jsonfiles import Id, Vector3, Vector9, decode, read_bytes, repeated_keys
from sixd.datasets.spec import Size
from sixd.errors import FormatError, Problem
from sixd.geometry import PinholeCamera, Pose, camera_from_bop


class _CamModel(msgspec.Struct):
    projection_model_type: str
    projection_params: list[float]
    image_width: int | None = None
    image_height: int | None = None


class _CameraEntry(msgspec.Struct, gc=False):
    cam_K: Vector9 | None = None
    cam_model: _CamModel | None = None
    depth_scale: float | None = None
    cam_R_w2c: Vector9 | None = None
    cam_t_w2c: Vector3 | None = None


def read_cameras(path: Path) -> dict[int, ImageCamera]:
    """Camera of each image of a scene, by image id in increasing order.

    Raises:
        MissingDataError: there is no such file.
        FormatError: entries are broken; all of them are named.
    """
    raw = read_bytes(path, advice="is the split complete? every scene folder must have it")
    entries = decode(path, raw, dict[Id, _CameraEntry])
    if raw.count(b'"cam_K"') + raw.count(b'"cam_model"') != len(entries) and (
        repeated := repeated_keys(path, raw)
    ):
        raise FormatError(repeated)
    problems: list[Problem] = []
    cameras: dict[int, ImageCamera] = {}
    # Most images of a scene share one K: they share one camera too.
    shared: dict[Vector9, PinholeCamera] = {}
    for im_id in sorted(entries):
        try:
            cameras[im_id] = _camera(entries[im_id], shared, str(path))
        except FormatError as error:
            place = f'$["{im_id}"].'
            problems += [replace(p, field=place + p.field) for p in error.problems]
    if problems:
        raise FormatError(problems)
    return cameras


def size_in_cam_models(path: Path) -> Size | None:
    """``(width, height)`` where all images have a ``cam_model`` and it tells one size."""
    entries = decode(path, read_bytes(path), dict[Id, _CameraEntry])
    sizes = {
        (e.cam_model.image_width, e.cam_model.image_height) if e.cam_model else (None, None)
        for e in entries.values()
    }
    width, height = sizes.pop() if len(sizes) == 1 else (None, None)
    return (width, height) if width and height else None


def _camera(entry: _CameraEntry, shared: dict[Vector9, PinholeCamera], file: str) -> ImageCamera:
    given = {
        key: msgspec.to_builtins(value)
        for key in ("cam_K", "cam_model")
        if (value := getattr(entry, key)) is not None
    }
    known = shared.get(entry.cam_K) if entry.cam_K and entry.cam_model is None else None
    camera = known or camera_from_bop(given, file=file)
    K = None
    if isinstance(camera, PinholeCamera):
        K = camera.K
        if entry.cam_K:
            shared[entry.cam_K] = camera
    pose_c_w = None
    if entry.cam_R_w2c is not None and entry.cam_t_w2c is not None:
        pose_c_w = Pose(np.array(entry.cam_R_w2c).reshape(3, 3), np.array(entry.cam_t_w2c))
    return ImageCamera(camera, K, entry.depth_scale, pose_c_w)
