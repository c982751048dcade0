"""Truth of 2D detection and segmentation: the ``scene_gt_coco.json`` files of the target images."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypedDict

import msgspec
import numpy as np
from numpy.typing import NDArray

from sixd.datasets.ids import some
from sixd.datasets.jsonfiles import Id, read_json
from sixd.datasets.truth import coco_truth_path
from sixd.errors import FormatError, MissingDataError, Problem

if TYPE_CHECKING:
    from sixd.datasets.dataset import Dataset
    from sixd.datasets.targets import Targets

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

Segmentation: TypeAlias = "dict[str, Any] | list[list[float]]"
"""A mask as COCO writes it: run lengths (``size`` [h, w], ``counts``) or polygons."""


@dataclass(frozen=True)
class CocoTruth:
    """Target images, in the order in which BOP evaluates them, and their annotated instances."""

    scene_id: Ints
    """``(I,)`` images: scenes as the targets name them first, within a scene by im_id."""
    im_id: Ints
    size_px: Ints
    """``(I, 2)`` width, height."""
    category_id: Ints
    """``(K,)`` ascending; detections of other categories play no part."""
    image: Ints
    """``(G,)`` instances: index of their image."""
    obj_id: Ints
    """``(G,)`` category."""
    bbox_xywh_px: Floats
    """``(G, 4)`` amodal, or modal where read so."""
    area_px: Floats
    """``(G,)`` visible pixels; decides small, medium, large."""
    ignored: Bools
    """``(G,)`` neither to be found nor, where found, a mistake (BOP: visible less than 10 %)."""
    crowd: Bools
    """``(G,)`` COCO's crowd regions, which may be found any number of times; none in BOP."""
    segmentation: tuple[Segmentation, ...] | None
    """``(G,)`` masks, or None where they were not read."""

    def __len__(self) -> int:
        return len(self.obj_id)


class _Rle(TypedDict):
    size: tuple[int, int]
    counts: str | list[int]


class _Image(msgspec.Struct):
    id: int
    width: int
    height: int


class _Category(msgspec.Struct):
    id: Id


class _Box(msgspec.Struct):
    """An annotation without its mask, which decodes ten times as fast."""

    image_id: int
    category_id: int
    bbox: tuple[float, float, float, float]
    area: float
    ignore: bool | int | None = False
    iscrowd: bool | int | None = False


class _Mask(_Box, kw_only=True):
    segmentation: _Rle | list[list[float]]


class _BoxFile(msgspec.Struct):
    images: list[_Image]
    categories: list[_Category]
    annotations: list[_Box]


class _MaskFile(msgspec.Struct):
    images: list[_Image]
    categories: list[_Category]
    annotations: list[_Mask]


def read_coco_truth(
    dataset: Dataset, targets: Targets, *, modal: bool = False, masks: bool = True
) -> CocoTruth:
    """The 2D truth of a dataset's target images (BOP rules 8, "COCO").

    Args:
        dataset: where the scenes are.
        targets: only their images are used.
        modal: boxes of the visible part (``scene_gt_coco_modal.json``), not of the whole object.
        masks: also read the masks, which only ``segm`` needs.

    Raises:
        MissingDataError: a scene has no such file (all of them are named), or a file lacks a
            target image.
        FormatError: a file is not a COCO annotation file.
    """
    scene_ids = dict.fromkeys(targets.scene_id.tolist())
    paths = {s: coco_truth_path(dataset, s, modal=modal) for s in scene_ids}
    return read_coco_files(paths, targets.scene_id, targets.im_id, masks=masks)


def read_coco_files(
    paths: Mapping[int, Path], scene_id: Ints, im_id: Ints, *, masks: bool = True
) -> CocoTruth:
    """`read_coco_truth` from explicit files, one per scene, in the order of evaluation.

    Args:
        paths: annotation file of each scene.
        scene_id: scenes of the target images, ``(N,)``, repeats allowed.
        im_id: the images, ``(N,)``.
        masks: also read the masks.

    Raises:
        MissingDataError: files or target images are not there; all of them are named.
        FormatError: a file is not a COCO annotation file.
    """
    missing = [str(p) for p in paths.values() if not p.is_file()]
    if missing:
        raise MissingDataError(
            f"2D scores need the COCO annotations of every target scene; {len(missing)} of "
            f"{len(paths)} files are missing:\n    " + "\n    ".join(missing)
        )
    # Sets, since a plain np.unique imports numpy.ma, which takes longer than all the rest here.
    scenes = [
        _read_scene(path, s, sorted(set(im_id[scene_id == s].tolist())), masks)
        for s, path in paths.items()
    ]
    return _merge(scenes, masks)


def _read_scene(path: Path, scene_id: int, im_ids: list[int], masks: bool) -> CocoTruth:
    file: _MaskFile | _BoxFile
    file = read_json(path, _MaskFile) if masks else read_json(path, _BoxFile)
    size_px = {i.id: (i.width, i.height) for i in file.images}
    unlisted = [i for i in im_ids if i not in size_px]
    if unlisted:
        raise MissingDataError(f"{path} does not list the target images {some(unlisted)}")
    category_ids = {c.id for c in file.categories}
    image_of = {i: n for n, i in enumerate(im_ids)}
    rows: Sequence[_Box] = [a for a in file.annotations if a.image_id in image_of]
    stray = {a.category_id for a in rows} - category_ids
    if stray:
        what = f"instances have categories that the file does not list: {some(sorted(stray))}"
        raise FormatError([Problem("unlisted-category", what, file=str(path))])
    return CocoTruth(
        scene_id=np.full(len(im_ids), scene_id, np.int64),
        im_id=np.array(im_ids, np.int64),
        size_px=np.array([size_px[i] for i in im_ids], np.int64).reshape(-1, 2),
        category_id=np.array(sorted(category_ids), np.int64),
        image=np.array([image_of[a.image_id] for a in rows], np.int64),
        obj_id=np.array([a.category_id for a in rows], np.int64),
        bbox_xywh_px=np.array([a.bbox for a in rows], np.float64).reshape(-1, 4),
        area_px=np.array([a.area for a in rows], np.float64),
        ignored=np.array([bool(a.ignore or a.iscrowd) for a in rows], bool),
        crowd=np.array([bool(a.iscrowd) for a in rows], bool),
        segmentation=_compressed(rows, path) if masks else None,
    )


def _compressed(rows: Sequence[_Box], path: Path) -> tuple[Segmentation, ...]:
    """Masks as COCO's short strings: lists of run lengths would take fifty times the memory."""
    from hotcoco import mask

    found: list[Segmentation] = []
    problems = []
    for row in rows:
        segmentation = row.segmentation  # type: ignore[attr-defined]
        if isinstance(segmentation, dict):
            try:
                segmentation = mask.fr_py_objects(segmentation, *segmentation["size"])
            except (ValueError, TypeError, OverflowError) as error:
                what = f"image {row.image_id}, category {row.category_id}: {error}"
                problems.append(Problem("bad-rle", what, file=str(path), field="segmentation"))
        found.append(segmentation)
    if problems:
        raise FormatError(problems)
    return tuple(found)


def _merge(scenes: Sequence[CocoTruth], masks: bool) -> CocoTruth:
    if not scenes:
        raise MissingDataError("there are no target images")

    def joined(name: str) -> Any:
        return np.concatenate([getattr(s, name) for s in scenes])

    first_image = np.cumsum([0, *(len(s.im_id) for s in scenes)])
    return CocoTruth(
        scene_id=joined("scene_id"),
        im_id=joined("im_id"),
        size_px=joined("size_px"),
        category_id=np.array(sorted({*joined("category_id").tolist()}), np.int64),
        image=np.concatenate([s.image + n for s, n in zip(scenes, first_image, strict=False)]),
        obj_id=joined("obj_id"),
        bbox_xywh_px=joined("bbox_xywh_px"),
        area_px=joined("area_px"),
        ignored=joined("ignored"),
        crowd=joined("crowd"),
        segmentation=tuple(m for s in scenes for m in s.segmentation or ()) if masks else None,
    )
