"""The ground truth: evaluation only. Nothing that a method can reach imports this module."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from sixd.datasets.dataset import Annotation, Dataset
from sixd.datasets.ids import some
from sixd.datasets.jsonfiles import Id, Vector3, Vector9, decode, read_bytes, repeated_keys
from sixd.datasets.preflight import Need, find_missing
from sixd.datasets.spec import OWN_SPEC
from sixd.datasets.targets import Targets
from sixd.errors import FormatError, MissingDataError, Problem
from sixd.geometry import Pose
from sixd.geometry.pose import Floats

Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class GroundTruth:
    """One row for each annotated instance, by scene, image and place in the image's list."""

    scene_id: Ints
    """``(N,)``"""
    im_id: Ints
    """``(N,)``"""
    obj_id: Ints
    """``(N,)``"""
    gt_id: Ints
    """``(N,)`` place in the image's list of ``scene_gt.json``, which names the masks too."""
    R: Floats
    """``(N, 3, 3)`` model to camera."""
    t_mm: Floats
    """``(N, 3)``; (-1, -1, -1) is BOP's placeholder for an instance nobody could annotate."""
    visib_fract: Floats
    """``(N,)`` visible part of the silhouette; NaN where there is no ``scene_gt_info.json``."""
    images: Ints
    """``(M, 2)`` scene and image of all annotated images, those without instances included."""

    def __len__(self) -> int:
        return len(self.scene_id)

    @property
    def pose_c_m(self) -> Pose:
        """Model to camera, batch shape ``(N,)``."""
        return Pose(self.R, self.t_mm)

    def require_images(self, scene_id: Ints, im_id: Ints) -> None:
        """Raise unless all these images are annotated.

        Raises:
            MissingDataError: some are not; names them.
        """
        annotated = set(map(tuple, self.images.tolist()))
        wanted = dict.fromkeys(zip(scene_id.tolist(), im_id.tolist(), strict=True))
        missing = [f"{s}/{i}" for s, i in wanted if (s, i) not in annotated]
        if missing:
            raise MissingDataError(
                f"{len(missing)} of {len(wanted)} images (scene/image) have no truth: "
                f"{some(missing)}"
            )


class _Instance(msgspec.Struct, gc=False):
    obj_id: Id
    cam_R_m2c: Vector9
    cam_t_m2c: Vector3


class _InstanceInfo(msgspec.Struct, gc=False):
    visib_fract: float


def read_truth(dataset: Dataset, scene_ids: Iterable[int] | None = None) -> GroundTruth:
    """The truth of some scenes, or of all.

    Args:
        dataset: the split.
        scene_ids: by default all of the split.

    Raises:
        MissingDataError: files are missing; all of them are named.
        FormatError: files are broken, or gt and gt_info disagree; names every wrong entry.
    """
    scenes = sorted(set(dataset.scene_ids if scene_ids is None else scene_ids))
    _require_files(dataset, scenes)
    parts: list[GroundTruth] = []
    problems: list[Problem] = []
    for scene_id in scenes:
        try:
            parts.append(_read_scene(dataset, scene_id))
        except FormatError as error:
            problems += error.problems
    if problems:
        raise FormatError(problems)
    return _concatenate(parts)


def coco_truth_path(dataset: Dataset, scene_id: int, modal: bool = False) -> Path:
    """The COCO annotations of a scene; with ``modal``, those with boxes of the visible part."""
    return dataset.annotation_path("gt_coco_modal" if modal else "gt_coco", scene_id)


def dataset_hash(
    dataset: Dataset,
    scene_ids: Iterable[int],
    *,
    obj_ids: Collection[int] | None = None,
    targets: str | Path | Targets | None = None,
) -> str:
    """SHA-256 over all files that scores of these scenes depend on, but for the images.

    These are, of each scene, camera, truth and gt info; ``models_info.json``, the meshes of
    ``obj_ids`` (all by default), the target list (a file, or the rows of a table, whatever file
    they came from) and the folder's ``dataset.toml``. See `hash_of_files`.

    Raises:
        MissingDataError: camera or truth of a scene are missing.
    """
    files: list[Path] = []
    for scene_id in sorted(set(scene_ids)):
        kinds: tuple[Annotation, ...] = ("camera", "gt", "gt_info")
        for kind in kinds:
            path = dataset.annotation_path(kind, scene_id)
            if kind != "gt_info" or path.is_file():
                files.append(path)
    meshes = dataset.model_files
    files += [meshes[i] for i in sorted(meshes if obj_ids is None else obj_ids) if i in meshes]
    files += [p for p in (dataset.models_info_path, dataset.path / OWN_SPEC) if p.is_file()]
    if isinstance(targets, Targets):
        return hash_of_files(dataset, files, targets)
    if targets is not None:
        files.append(dataset.path / targets)
    return hash_of_files(dataset, files)


def hash_of_files(dataset: Dataset, paths: Iterable[Path], targets: Targets | None = None) -> str:
    """SHA-256 over files of a dataset, and over the rows of a target list.

    Each file enters with its path inside the dataset and its size, so two different sets of files
    cannot agree; likewise each column of the targets with its name and length.

    Raises:
        MissingDataError: one of the files is not there.
    """
    digest = hashlib.sha256()
    for path in paths:
        content = read_bytes(path)
        inside = path.is_relative_to(dataset.path)
        name = path.relative_to(dataset.path).as_posix() if inside else path.name
        digest.update(f"{name}\0{len(content)}\0".encode())
        digest.update(content)
    for name in ("scene_id", "im_id", "obj_id", "inst_count", "group", "sensor"):
        column = None if targets is None else getattr(targets, name)
        if column is not None:
            content = (
                "\0".join(column).encode()
                if isinstance(column, tuple)
                else np.ascontiguousarray(column, "<i8").tobytes()
            )
            digest.update(f"targets.{name}\0{len(content)}\0".encode())
            digest.update(content)
    return digest.hexdigest()


def _require_files(dataset: Dataset, scenes: list[int]) -> None:
    wanted = np.array(scenes, np.int64)
    needs: tuple[Need, ...] = ("truth",)
    problems = find_missing(dataset, wanted, np.zeros_like(wanted), (), needs)
    if problems:
        raise MissingDataError.of(problems)


def _read_scene(dataset: Dataset, scene_id: int) -> GroundTruth:
    path = dataset.annotation_path("gt", scene_id)
    raw = read_bytes(path)
    instances = decode(path, raw, dict[Id, list[_Instance]])
    im_ids = np.array(sorted(instances), np.int64)
    rows = [e for im_id in im_ids.tolist() for e in instances[im_id]]
    if raw.count(b'"cam_R_m2c"') != len(rows) and (problems := repeated_keys(path, raw)):
        raise FormatError(problems)
    n = len(rows)
    per_image = np.array([len(instances[i]) for i in im_ids.tolist()], np.int64)
    first = np.cumsum(per_image) - per_image
    return GroundTruth(
        scene_id=np.full(n, scene_id, np.int64),
        im_id=np.repeat(im_ids, per_image),
        obj_id=np.array([e.obj_id for e in rows], np.int64),
        gt_id=np.arange(n) - np.repeat(first, per_image),
        R=np.array([e.cam_R_m2c for e in rows], np.float64).reshape(n, 3, 3),
        t_mm=np.array([e.cam_t_m2c for e in rows], np.float64).reshape(n, 3),
        visib_fract=_read_visibility(dataset, scene_id, instances),
        images=np.stack([np.full_like(im_ids, scene_id), im_ids], axis=1),
    )


def _read_visibility(
    dataset: Dataset, scene_id: int, instances: dict[int, list[_Instance]]
) -> Floats:
    path = dataset.annotation_path("gt_info", scene_id)
    if not path.is_file():
        return np.full(sum(map(len, instances.values())), np.nan)
    info = decode(path, read_bytes(path), dict[Id, list[_InstanceInfo]])
    problems = [
        Problem(
            "gt-info-mismatch",
            "does not describe the same instances as scene_gt.json",
            file=str(path),
            field=f'$["{im_id}"]',
            expected=f"{len(entries)} instances",
            got=f"{len(info[im_id])}" if im_id in info else "no such image",
            fix="compute it anew",
        )
        for im_id, entries in instances.items()
        if len(info.get(im_id, ())) != len(entries)
    ]
    if problems:
        raise FormatError(problems)
    return np.array([e.visib_fract for im_id in sorted(instances) for e in info[im_id]], np.float64)


def _concatenate(parts: list[GroundTruth]) -> GroundTruth:
    none = np.zeros(0, np.int64)
    nothing = GroundTruth(
        none, none, none, none,
        R=np.zeros((0, 3, 3)), t_mm=np.zeros((0, 3)), visib_fract=np.zeros(0),
        images=none.reshape(0, 2),
    )  # fmt: skip
    columns: dict[str, Any] = {
        c.name: np.concatenate([getattr(p, c.name) for p in (nothing, *parts)])
        for c in fields(GroundTruth)
    }
    return GroundTruth(**columns)
