"""All that is missing for a task, found before any computing starts."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from sixd.datasets.ids import some
from sixd.datasets.structure import names_in
from sixd.errors import FormatError, MissingDataError, Problem

if TYPE_CHECKING:
    from sixd.datasets.dataset import Annotation, Dataset

Need = Literal["camera", "truth", "gt_info", "models_info", "meshes", "depth"]

_FILES: dict[str, Annotation] = {
    "camera": "camera",
    "truth": "gt",
    "gt_info": "gt_info",
}
_FIXES = {
    "gt_info": "compute it with the full models, or download it with the annotations",
    "depth": "download the depth images, or leave VSD out if the protocol has other errors: "
    "--errors mssd,mspd",
}


def find_missing(
    dataset: Dataset,
    scene_id: NDArray[np.int64],
    im_id: NDArray[np.int64],
    obj_ids: Collection[int],
    needs: Collection[Need],
) -> list[Problem]:
    """One problem for every file, image and object that is needed and not there.

    Folders are listed once each, so a thousand images cost about as much as one.

    Args:
        dataset: the split.
        scene_id: scenes of the needed images, ``(N,)``, repeats allowed.
        im_id: ids of the needed images, ``(N,)``.
        obj_ids: needed objects.
        needs: what is needed of them.

    Returns:
        The problems, by scene; empty if nothing is missing.
    """
    images: dict[int, set[int]] = defaultdict(set)
    for scene, image in zip(scene_id.tolist(), im_id.tolist(), strict=True):
        images[scene].add(image)
    problems: list[Problem] = []
    scenes = names_in(dataset.folder)
    for scene in sorted(images):
        if f"{scene:06d}" in scenes:
            problems += _in_scene(dataset, scene, images[scene], needs)
        else:
            fix = f"the split has scenes {some(dataset.scene_ids)}"
            problems.append(_missing("no such scene folder", dataset.scene_dir(scene), fix))
    problems += _in_models(dataset, set(obj_ids), needs)
    return problems


def _in_scene(
    dataset: Dataset, scene: int, images: set[int], needs: Collection[Need]
) -> Iterator[Problem]:
    try:
        dataset.view(scene)
    except MissingDataError as error:
        yield Problem("missing-sensor", str(error), file=str(dataset.scene_dir(scene)))
        return
    names = names_in(dataset.scene_dir(scene))
    for need, kind in _FILES.items():
        path = dataset.annotation_path(kind, scene)
        if need not in needs:
            continue
        if path.name not in names:
            yield _missing("no such file", path, _fix(dataset, need))
        elif need == "camera":
            yield from _without_camera(dataset, scene, images)
    if "depth" in needs:
        for image in sorted(images - dataset.listed_images(scene, "depth").keys()):
            yield _without_depth(dataset, scene, image)


def _without_camera(dataset: Dataset, scene: int, images: set[int]) -> Iterator[Problem]:
    try:
        cameras = dataset.cameras(scene)
    except FormatError as error:
        yield from error.problems
        return
    path = str(dataset.annotation_path("camera", scene))
    for image in sorted(images - cameras.keys()):
        what = "has no such image"
        yield Problem(
            "missing-image", what, file=path, field=f'$["{image}"]', fix=f"it has {some(cameras)}"
        )


def _without_depth(dataset: Dataset, scene: int, image: int) -> Problem:
    try:
        path = dataset.image_path(scene, image, "depth")
    except MissingDataError as error:
        return Problem("missing-file", str(error), file=str(dataset.scene_dir(scene)))
    return _missing("no such file", path, _FIXES["depth"])


def _in_models(dataset: Dataset, obj_ids: set[int], needs: Collection[Need]) -> Iterator[Problem]:
    if "models_info" in needs:
        path = dataset.models_info_path
        try:
            missing = sorted(obj_ids - dataset.models_info.keys())
        except FormatError as error:
            yield from error.problems
        except MissingDataError:
            yield _missing("no such file", path, "download the dataset's models")
        else:
            for obj_id in missing:
                fix = f"it has {some(sorted(dataset.models_info))}"
                yield Problem("missing-object", "has no such object", file=str(path),
                              field=f'$["{obj_id}"]', fix=fix)  # fmt: skip
    if "meshes" in needs:
        for obj_id in sorted(obj_ids - dataset.model_files.keys()):
            path = dataset.models_dir / f"obj_{obj_id:06d}.ply"
            yield _missing("no such file", path, "download the dataset's models")


def _fix(dataset: Dataset, need: str) -> str:
    if need in ("truth", "gt_info") and not dataset.truth_is_public:
        return (
            f"the truth of {dataset.spec.title or dataset.name} {dataset.split} is private: "
            "only the BOP server can score it; use a split with public truth"
        )
    return _FIXES.get(need, "download the split's annotations")


def _missing(what: str, path: Path, fix: str) -> Problem:
    return Problem("missing-file", what, file=str(path), fix=fix)
