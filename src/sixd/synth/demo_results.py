"""Results for the demo: the truth, perturbed at three strengths, and named as such."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sixd.datasets import Dataset, open_dataset
from sixd.errors import MissingDataError
from sixd.evaluation.truth_results import detections_from_truth, poses_from_truth
from sixd.results.coco_json import write_coco_json
from sixd.results.pose_csv import write_pose_csv
from sixd.results.tables import Detections, PoseEstimates
from sixd.synth.perturb import STRENGTHS, Perturbation, Strength
from sixd.synth.perturb_2d import box_detections, mask_detections
from sixd.synth.perturb_poses import detection_estimates, localization_estimates

TASKS = {
    "localization": ".csv",
    "detection": ".csv",
    "detection2d": ".json",
    "segmentation2d": ".json.gz",
}
"""Task and extension of the files that `write_demo_results` writes for each strength."""


def write_demo_results(dataset_dir: str | Path, out_dir: str | Path, seed: int = 0) -> list[Path]:
    """Write perturbed truth as results files, one for each of `STRENGTHS` and `TASKS`.

    The names are ``<strength>_<dataset>-<split>_<task>.<ext>``. The 6D detection files hold
    duplicates and objects that are absent from the image. Same seed, same bytes.

    Args:
        dataset_dir: a dataset of `make_demo_dataset` (or any whose COCO masks are uncompressed).
        out_dir: made if it is not there; files of the same names are replaced.
        seed: of all perturbations.

    Raises:
        MissingDataError: truth, target list or image size of the dataset are missing.
    """
    dataset = open_dataset(dataset_dir)
    out_dir = Path(out_dir)
    out_dir.mkdir(parents=True, exist_ok=True)
    paths = []
    for k, strength in enumerate(STRENGTHS):
        tables = perturbed_results(dataset, strength, np.random.default_rng([seed, k]))
        for task, table in tables.items():
            name = f"{strength.name}_{dataset.name}-{dataset.split}_{task}{TASKS[task]}"
            paths.append(out_dir / name)
            if isinstance(table, PoseEstimates):
                write_pose_csv(paths[-1], table)
            else:
                write_coco_json(paths[-1], table)
    return paths


def perturbed_results(
    dataset: Dataset, strength: Strength, rng: np.random.Generator
) -> dict[str, PoseEstimates | Detections]:
    """Tables of all `TASKS`.

    Raises:
        MissingDataError: truth, target list or image size of the dataset are missing.
    """
    if dataset.image_size_px is None:
        raise MissingDataError(f"{dataset.path}: its images have no one size, which boxes need")
    targets = dataset.targets(f"{dataset.split}_targets_bop19.json")
    how = Perturbation.of(dataset, targets, strength, rng)
    wanted = poses_from_truth(dataset, targets)
    visible = poses_from_truth(dataset, targets, all_visible=True)
    boxes = detections_from_truth(dataset, targets, masks=False)
    masks = detections_from_truth(dataset, targets, masks=True)
    return {
        "localization": localization_estimates(wanted, how),
        "detection": detection_estimates(visible, how),
        "detection2d": box_detections(boxes, dataset.image_size_px, how),
        "segmentation2d": mask_detections(masks, how),
    }
