"""A folder that no spec describes, read by its own structure.

A split is a subfolder that holds scene folders ``NNNNNN`` with ``scene_camera*.json``. What
follows ``scene_camera`` is the suffix of a sensor's files: nothing (BOP-Classic), ``_SENSOR``
beside folders ``MODALITY_SENSOR``, or ``_MODALITY`` beside a folder ``MODALITY`` (HOT3D).
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

IMAGE_EXTENSIONS = (".png", ".jpg", ".jpeg", ".tif", ".tiff")
MESH_EXTENSIONS = (".ply", ".glb", ".gltf", ".obj", ".stl", ".off")
"""In order of preference where an object has several."""

_STREAM = "_{modality}"
_MODALITY = re.compile(r"(rgb|gray|grey|mono|ir)\d*")


def scene_folders(folder: Path) -> list[int]:
    """Ids of the scene folders ``NNNNNN`` in a split folder, sorted; none if it is not there."""
    return sorted(
        int(name)
        for name, is_dir in _entries(folder)
        if is_dir and name.isascii() and name.isdigit() and name == f"{int(name):06d}"
    )


def split_folders(dataset: Path) -> list[str]:
    """Names of the subfolders that hold at least one scene, sorted."""
    return sorted(
        name
        for name, is_dir in _entries(dataset)
        if is_dir and any(_camera_suffixes(dataset / name / f"{i:06d}")
                          for i in scene_folders(dataset / name)[:3])
    )  # fmt: skip


def model_files(folder: Path) -> dict[int, Path]:
    """Object id -> mesh file ``obj_NNNNNN.*`` of a models folder, by id."""
    found: dict[int, Path] = {}
    for name, is_dir in _entries(folder):
        match = re.fullmatch(r"obj_(\d{6,9})(\.\w+)", name)
        if is_dir or not match or match[2].lower() not in MESH_EXTENSIONS:
            continue
        obj_id, path = int(match[1]), folder / name
        if obj_id not in found or _rank(path) < _rank(found[obj_id]):
            found[obj_id] = path
    return dict(sorted(found.items()))


def names_in(folder: Path) -> set[str]:
    """Names of all entries of a folder; none if it is not there."""
    return {name for name, _ in _entries(folder)}


def read_structure(folder: Path) -> dict[str, Any]:
    """The ``[sensors]`` of a split folder, and the ``sensors`` and ``eval_sensors`` of its split.

    A sensor that did not take every scene gets its ``scenes``. ``eval_sensors`` is left out where
    one scene has several, since only people know which is scored.
    """
    sensors: dict[str, dict[str, Any]] = {}
    scenes: dict[str, list[int]] = {}
    all_scenes = scene_folders(folder)
    ambiguous = False
    for scene_id in all_scenes:
        scene = folder / f"{scene_id:06d}"
        found = _sensors_of_scene(scene)
        ambiguous |= len(found) > 1
        for name, (suffix, image_dir, image_folders) in found.items():
            sensor = sensors.setdefault(
                name, {"images": {}, "suffix": suffix, "image_dir": image_dir}
            )
            _add_images(sensor["images"], scene, image_folders)
            if suffix == _STREAM:  # its files exist even where the images were not downloaded
                sensor["images"] = dict.fromkeys(image_folders, ".png") | sensor["images"]
            scenes.setdefault(name, []).append(scene_id)
    for name, sensor in sensors.items():
        images = sensor["images"]
        sensor["images"] = {m: images[m] for m in sorted(images, key=_scored_first)}
        if len(scenes[name]) < len(all_scenes):
            sensor["scenes"] = scenes[name]
    split: dict[str, Any] = {"sensors": list(sensors)}
    if not ambiguous:
        split["eval_sensors"] = list(sensors)
    return {"sensors": sensors, "split": split}


def _sensors_of_scene(scene: Path) -> dict[str, tuple[str, str, dict[str, str]]]:
    """Sensor -> pattern of its file suffix, pattern of its image folders, modality -> folder."""
    folders = {name for name, is_dir in _entries(scene) if is_dir and not name.startswith("mask")}
    found: dict[str, tuple[str, str, dict[str, str]]] = {}
    streams: dict[str, str] = {}
    # Longest first: the folder rgb_left_a belongs to the suffix _left_a, not to _a.
    for suffix in sorted(_camera_suffixes(scene), key=len, reverse=True):
        name = suffix.lstrip("_.-")
        mark = suffix.removesuffix(name)
        own = {f.removesuffix(suffix): f for f in folders if name and f.endswith(suffix)}
        if not name:
            found["camera"] = ("", "{modality}", {f: f for f in folders})
        elif not own and (name in folders or _MODALITY.fullmatch(name)):
            streams[name] = name
        else:
            folders -= set(own.values())
            found[name] = (mark + "{sensor}", "{modality}" + mark + "{sensor}", own)
    if streams:
        # A scene with other streams was taken by another device, so the streams are its name.
        device = "-".join(sorted(streams, key=_scored_first))
        depth = {"depth": "depth"} if "depth" in folders else {}
        found[device] = (_STREAM, "{modality}", streams | depth)
    return found


def _add_images(images: dict[str, str], scene: Path, image_folders: dict[str, str]) -> None:
    """Enter the extension of each modality that is not known yet; looks into one folder each."""
    for modality, name in image_folders.items():
        if modality not in images and (extension := _extension(scene / name)):
            images[modality] = extension


def _camera_suffixes(scene: Path) -> set[str]:
    names = (re.fullmatch(r"scene_camera([\w.-]*)\.json", name) for name in names_in(scene))
    return {match[1] for match in names if match}


def _extension(folder: Path) -> str:
    """Extension of the images of a folder, by the first that is found."""
    return next(
        (suffix for name, _ in _entries(folder)
         if (suffix := Path(name).suffix.lower()) in IMAGE_EXTENSIONS), "",
    )  # fmt: skip


def _scored_first(modality: str) -> tuple[bool, bool, bool, str]:
    colour = _MODALITY.fullmatch(modality)
    return modality == "depth", colour is None, not modality.startswith("rgb"), modality


def _rank(path: Path) -> int:
    return MESH_EXTENSIONS.index(path.suffix.lower())


def _entries(folder: Path) -> list[tuple[str, bool]]:
    """Name and whether it is a folder, of all entries; none if the folder is not there."""
    try:
        with os.scandir(folder) as entries:
            return [(e.name, e.is_dir()) for e in entries]
    except OSError:
        return []
