"""Perturbed 6D poses: for localization, and for detection with duplicates and false ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sixd.geometry.pose import Pose, rotations_about
from sixd.results.tables import PoseEstimates
from sixd.synth.perturb import Perturbation


def localization_estimates(true: PoseEstimates, how: Perturbation) -> PoseEstimates:
    """One estimate for each instance that is found."""
    return _in_image_order(_perturbed(true.where(how.found(len(true))), how), how)


def detection_estimates(true: PoseEstimates, how: Perturbation) -> PoseEstimates:
    """Estimates as for localization, second and worse ones, and ones of what is not there."""
    found = how.found(len(true))
    again = _perturbed(true.where(how.doubled(found)), how)
    less_sure = np.round(again.score * how.rng.uniform(0.3, 0.9, len(again)), 4)
    again = replace(again, score=less_sure)
    parts = [_perturbed(true.where(found), how), again, _false_poses(true, how)]
    return _in_image_order(PoseEstimates.concatenate(parts), how)


def _perturbed(true: PoseEstimates, how: Perturbation) -> PoseEstimates:
    """Each pose replaced by one of its symmetric copies, turned and moved a little."""
    n, rng, strength = len(true), how.rng, how.strength
    angles_deg = rng.normal(0.0, strength.rotation_deg, n)
    lateral_mm = rng.normal(0.0, strength.lateral_mm, (n, 3))
    along_mm = rng.normal(0.0, strength.depth_mm, n)
    copies = _symmetric_copies(true, how)
    ray = true.t_mm / np.linalg.norm(true.t_mm, axis=1, keepdims=True)
    # A method notices part of its own error: the score falls with it.
    size = abs(angles_deg) / 6 + np.linalg.norm(lateral_mm, axis=1) / 6 + abs(along_mm) / 15
    return PoseEstimates.from_arrays(
        scene_id=true.scene_id,
        im_id=true.im_id,
        obj_id=true.obj_id,
        R=rotations_about(rng.normal(size=(n, 3)), np.deg2rad(angles_deg)) @ copies.R,
        t_mm=np.round(copies.t_mm + lateral_mm + along_mm[:, None] * ray, 4),
        score=how.scores(size),
    )


def _symmetric_copies(true: PoseEstimates, how: Perturbation) -> Pose:
    """A random one of the equally right poses of each row."""
    R, t_mm = true.R.copy(), true.t_mm.copy()
    for obj_id in np.unique(true.obj_id).tolist():
        rows = np.flatnonzero(true.obj_id == obj_id)
        symmetries = how.dataset.model(obj_id).symmetries.transforms()
        chosen = how.rng.integers(len(symmetries), size=len(rows))
        copies = true.pose_c_m[rows] @ symmetries[chosen]
        R[rows], t_mm[rows] = copies.R, copies.t_mm
    return Pose(R, t_mm)


def _false_poses(true: PoseEstimates, how: Perturbation) -> PoseEstimates:
    """Estimates of things that are not there, near things that are."""
    ids, places_mm = [], []
    for image in how.time_s_of_image:
        near_mm = true.t_mm[(true.scene_id == image[0]) & (true.im_id == image[1])]
        if not len(near_mm):
            continue
        for false_id in how.false_objects(true, image):
            ids.append((*image, false_id))
            places_mm.append(near_mm[how.rng.integers(len(near_mm))])
    n = len(ids)
    scene_id, im_id, obj_id = np.array(ids, np.int64).reshape(-1, 3).T
    shifted_mm = np.array(places_mm).reshape(-1, 3) + how.rng.normal(0.0, 60.0, (n, 3))
    return PoseEstimates.from_arrays(
        scene_id=scene_id,
        im_id=im_id,
        obj_id=obj_id,
        R=rotations_about(how.rng.normal(size=(n, 3)), how.rng.uniform(0.0, np.pi, n)),
        t_mm=np.round(shifted_mm, 4),
        score=how.false_scores(n),
    )


def _in_image_order(table: PoseEstimates, how: Perturbation) -> PoseEstimates:
    """Rows by image, the surest first, with the image's time."""
    ordered = table.where(np.lexsort((-table.score, table.im_id, table.scene_id)))
    return replace(ordered, time_s=how.times_s(ordered.scene_id, ordered.im_id))
