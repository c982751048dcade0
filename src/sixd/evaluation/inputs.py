"""All that an evaluation needs of a dataset, read and complete before any error is measured."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from sixd.datasets.dataset import Dataset
from sixd.datasets.preflight import Need, find_missing
from sixd.datasets.targets import Targets
from sixd.datasets.truth import (
    GroundTruth,
    coco_truth_path,
    dataset_hash,
    hash_of_files,
    read_truth,
)
from sixd.errors import MissingDataError, Problem, UsageError
from sixd.evaluation.coco_truth import CocoTruth, read_coco_truth
from sixd.evaluation.protocol import EvalProtocol
from sixd.rows import find_rows


@dataclass(frozen=True, eq=False)
class PoseInputs:
    """What 6D protocols compare with."""

    dataset: Dataset
    targets: Targets
    truth: GroundTruth
    """All instances of the target scenes."""
    sha256: str
    """Of truth, targets, model information and meshes."""


@dataclass(frozen=True, eq=False)
class CocoInputs:
    """What 2D protocols compare with."""

    dataset: Dataset
    targets: Targets
    truth: CocoTruth
    sha256: str
    """Of the COCO truth and the targets."""


def read_inputs(
    dataset: Dataset, protocol: EvalProtocol, targets: str | Path | Targets | None
) -> PoseInputs | CocoInputs:
    """Read targets and truth; name everything that is missing, at once.

    Args:
        dataset: the split.
        protocol: says what is needed.
        targets: a list, its path, a file of the dataset, or None for the protocol's own.

    Raises:
        MissingDataError: files, images or objects are missing; all of them are named.
        UsageError: the protocol's errors are not defined on this dataset.
        FormatError: files are broken.
    """
    if not isinstance(targets, Targets):
        targets = dataset.targets(targets or protocol.targets_file_of(dataset.split))
    if protocol.kind == "pose":
        return _read_pose_inputs(dataset, protocol, targets)
    truth = read_coco_truth(dataset, targets, masks=protocol.kind == "segm")
    paths = [coco_truth_path(dataset, s) for s in sorted(set(targets.scene_id.tolist()))]
    return CocoInputs(dataset, targets, truth, hash_of_files(dataset, paths, targets))


def _read_pose_inputs(dataset: Dataset, protocol: EvalProtocol, targets: Targets) -> PoseInputs:
    scene_id, im_id = targets.images[:, 0], targets.images[:, 1]
    scenes = sorted(set(scene_id.tolist()))
    needs: list[Need] = ["camera", "truth", "gt_info"]
    if protocol.needs_depth:
        _require_vsd(dataset)
        needs.append("depth")
    problems = find_missing(dataset, scene_id, im_id, (), needs)
    truth = None if problems else read_truth(dataset, scenes)
    obj_ids = _objects(protocol, targets, truth)
    none = scene_id[:0]
    problems += find_missing(dataset, none, none, obj_ids, ("models_info", "meshes"))
    if truth is None or problems:
        raise MissingDataError.of(problems)
    truth.require_images(scene_id, im_id)
    if protocol.needs_depth:
        _require_pinholes(dataset, targets)
    sha256 = dataset_hash(dataset, scenes, obj_ids=obj_ids, targets=targets)
    return PoseInputs(dataset, targets, truth, sha256)


def _objects(protocol: EvalProtocol, targets: Targets, truth: GroundTruth | None) -> set[int]:
    """Objects whose models are needed, as far as it can be told yet."""
    if targets.obj_id is not None and protocol.task != "detection":
        return set(targets.obj_id.tolist())
    if truth is None:
        return set()
    images = (targets.scene_id, targets.im_id)
    on_target = find_rows((truth.scene_id, truth.im_id), images) >= 0
    return set(truth.obj_id[on_target].tolist())


def _require_vsd(dataset: Dataset) -> None:
    if dataset.spec.vsd_delta_mm is None:
        raise UsageError(
            f"VSD is not defined on {dataset.name}, which has no vsd_delta_mm\n"
            "    fix: leave VSD out: --errors mssd,mspd; or set vsd_delta_mm in a dataset.toml"
        )


def _require_pinholes(dataset: Dataset, targets: Targets) -> None:
    bent = [
        (scene_id, im_id)
        for scene_id, im_id in targets.images.tolist()
        if dataset.cameras(scene_id)[im_id].K is None
    ]
    if bent:
        problem = Problem(
            "no-pinhole",
            f"VSD is defined for pinhole cameras; {len(bent)} target images have another one, "
            f"the first is scene {bent[0][0]}, image {bent[0][1]}",
            fix="leave VSD out: --errors mssd,mspd",
        )
        raise UsageError(str(problem))
