"""Writers of BOP files: every file and folder appears whole or not at all.

JSON files hold one image (or target, or model) per line, as the published datasets do, so that
they can be read by eye and compared line by line.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sixd.errors import OutputError, ShapeError, UsageError
from sixd.files import beside, cannot_write, write_atomically
from sixd.geometry.pose import Floats

_DEPTH_MAX = np.iinfo(np.uint16).max


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """Give a temporary folder to fill; it takes the name ``path`` when the block ends well.

    After an error, or a kill that Python sees, nothing stays behind.

    Raises:
        UsageError: ``path`` is there already.
        OutputError: the folder cannot be made.
    """
    if path.exists() or path.is_symlink():
        raise UsageError(f"{path} exists already: remove it, or name another folder")
    temporary = beside(path)
    try:
        temporary.mkdir(parents=True)
    except OSError as error:
        raise cannot_write(path, error) from error
    try:
        yield temporary
        try:
            temporary.rename(path)
        except OSError as error:
            raise cannot_write(path, error) from error
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        raise


def write_json_object(path: Path, entries: Mapping[int, object] | Mapping[str, object]) -> None:
    """One entry per line: ``scene_gt.json``, ``scene_camera.json``, ``models_info.json``."""
    lines = [f'  "{key}": {_dumps(value)}' for key, value in entries.items()]
    write_atomically(path, ("{\n" + ",\n".join(lines) + "\n}\n").encode())


def write_json_list(path: Path, entries: Iterable[object]) -> None:
    """One entry per line: target lists."""
    lines = [f"  {_dumps(entry)}" for entry in entries]
    write_atomically(path, ("[\n" + ",\n".join(lines) + "\n]\n").encode())


def write_coco(path: Path, coco: Mapping[str, object]) -> None:
    """A ``scene_gt_coco.json``: one image, annotation or category per line."""
    parts = []
    for key, value in coco.items():
        if isinstance(value, list) and value:
            value_text = "[\n    " + ",\n    ".join(_dumps(item) for item in value) + "\n  ]"
        else:
            value_text = _dumps(value)
        parts.append(f'  "{key}": {value_text}')
    write_atomically(path, ("{\n" + ",\n".join(parts) + "\n}\n").encode())


def write_image(path: Path, image: NDArray[np.uint8] | NDArray[np.uint16]) -> None:
    """A grey ``(H, W)`` or RGB ``(H, W, 3)`` image, lossless unless the suffix is ``.jpg``."""
    import cv2

    stored = image[..., ::-1] if image.ndim == 3 else image
    quality = [cv2.IMWRITE_JPEG_QUALITY, 95] if path.suffix in (".jpg", ".jpeg") else []
    written, data = cv2.imencode(path.suffix, np.ascontiguousarray(stored), quality)
    if not written:
        raise OutputError(f"{path}: the image library cannot write this kind of image")
    write_atomically(path, data.tobytes())


def write_depth(path: Path, depth_mm: NDArray[np.floating], depth_scale: float) -> None:
    """A depth image ``(H, W)``, mm, as 16-bit PNG: stored value times ``depth_scale`` = mm.

    Raises:
        UsageError: a depth is negative, not finite, or does not fit into 16 bits at this scale.
    """
    if depth_mm.ndim != 2:
        raise ShapeError(f"a depth image must have shape (H, W), got {depth_mm.shape}")
    stored = np.rint(depth_mm / depth_scale)
    if not np.isfinite(stored).all() or stored.min() < 0 or stored.max() > _DEPTH_MAX:
        low, high = float(np.min(depth_mm)), float(np.max(depth_mm))
        raise UsageError(
            f"{path}: depth must be in 0 .. {_DEPTH_MAX * depth_scale:g} mm "
            f"with depth_scale {depth_scale:g}, got {low:g} .. {high:g}"
        )
    write_image(path, stored.astype(np.uint16))


def write_mask(path: Path, mask: NDArray[np.bool_]) -> None:
    """A mask ``(H, W)`` as 8-bit PNG of 0 and 255."""
    write_image(path, np.where(mask, 255, 0).astype(np.uint8))


def mask_name(im_id: int, gt_id: int) -> str:
    """File name of one instance's mask, in ``mask/`` and ``mask_visib/``."""
    return f"{im_id:06d}_{gt_id:06d}.png"


def camera_entry(K: Floats, depth_scale: float | None) -> dict[str, object]:
    """An image's entry of ``scene_camera.json``."""
    entry: dict[str, object] = {"cam_K": K.reshape(-1).tolist()}
    if depth_scale is not None:
        entry["depth_scale"] = depth_scale
    return entry


def pose_entry(obj_id: int, R: Floats, t_mm: Floats) -> dict[str, object]:
    """An instance's entry of ``scene_gt.json``."""
    return {
        "cam_R_m2c": R.reshape(-1).tolist(),
        "cam_t_m2c": t_mm.reshape(-1).tolist(),
        "obj_id": int(obj_id),
    }


def _dumps(value: object) -> str:
    return json.dumps(value, allow_nan=False)
