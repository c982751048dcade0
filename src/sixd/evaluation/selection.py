"""Which estimates and which instances count: the rules that come before any error."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sixd.datasets.targets import Targets
from sixd.datasets.truth import GroundTruth
from sixd.errors import MissingDataError
from sixd.evaluation.protocol import EvalProtocol
from sixd.results.tables import PoseEstimates
from sixd.rows import best_first, find_rows, first_of_each, rank_in_group

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Selection:
    """Groups (an object in an image), and the estimates and instances that belong to them.

    Rows of estimates and truths are indices into the tables that were given to `select`.
    """

    scene_id: Ints
    im_id: Ints
    obj_id: Ints
    """``(G,)`` groups, in the order the toolkit processes them; it decides ties of score."""
    n_wanted: Ints
    """``(G,)`` instances of the group that are to be found."""
    estimate_rows: Ints
    """``(E,)`` ordered by group, then best score first."""
    estimate_group: Ints
    truth_rows: Ints
    """``(T,)`` ordered by group, then gt_id."""
    truth_group: Ints
    truth_matchable: Bools
    truth_counted: Bools
    """Instances that must be found. A match with another one is ignored."""
    within_cap: Bools
    """``(N,)`` of all estimates: those that the cap leaves; averages of time are over them."""
    ignored: Mapping[str, int]
    """Estimates that play no part, by reason."""

    @property
    def n_targets(self) -> int:
        """Instances to be found."""
        return int(self.n_wanted.sum())

    @property
    def n_without_estimate(self) -> int:
        """Instances to be found for which their image has no estimate left."""
        n_estimates = np.bincount(self.estimate_group, minlength=len(self.obj_id))
        return int(np.maximum(self.n_wanted - n_estimates, 0).sum())


def keep_best_per_image(estimates: PoseEstimates, cap: int) -> Bools:
    """Mask of the ``cap`` best-scored estimates of each image, over all objects (BOP24)."""
    _, image = np.unique(
        np.stack([estimates.scene_id, estimates.im_id]), axis=1, return_inverse=True
    )
    return rank_in_group(image.reshape(-1), best_first(estimates.score)) < cap


def select(
    estimates: PoseEstimates,
    truth: GroundTruth,
    targets: Targets,
    protocol: EvalProtocol,
    cap: int | None = None,
) -> Selection:
    """Apply a protocol's rules (BOP rules 2 and 3; ``docs/protocols.md``).

    Args:
        estimates: all estimates of a submission.
        truth: all instances of the target scenes.
        targets: the official list; for detection only its images are used.
        protocol: task and visibility rule.
        cap: estimates scored per image, where the protocol caps them.

    Raises:
        MissingDataError: visibility is needed and not annotated.
    """
    if np.isnan(truth.visib_fract).any():
        raise MissingDataError(
            "this protocol needs the visible fraction of every instance; scene_gt_info.json is "
            "missing or incomplete"
        )
    if protocol.task == "detection":
        return _select_detection(estimates, truth, targets, protocol, cap)
    return _select_localization(estimates, truth, targets, protocol)


def _select_localization(
    estimates: PoseEstimates, truth: GroundTruth, targets: Targets, protocol: EvalProtocol
) -> Selection:
    if targets.obj_id is None or targets.inst_count is None:
        raise MissingDataError(
            f"{protocol.name} needs obj_id and inst_count of every target; the targets file "
            "lists images only (a bop24 list?)"
        )
    groups = (targets.scene_id, targets.im_id, targets.obj_id)
    truth_group = find_rows((truth.scene_id, truth.im_id, truth.obj_id), groups)
    if protocol.task == "single-instance":
        matchable = truth.visib_fract >= (protocol.visib_min or 0.0)
        n_allowed = np.ones(len(targets), np.int64)
    else:
        # The most visible instances are the targets; the rest may not be matched.
        n_allowed = targets.inst_count
        rank = rank_in_group(truth_group, best_first(truth.visib_fract))
        matchable = rank < np.append(n_allowed, 0)[truth_group]
    n_matchable = np.bincount(truth_group[(truth_group >= 0) & matchable], minlength=len(targets))
    n_wanted = np.minimum(n_matchable, n_allowed)
    estimate_group = find_rows((estimates.scene_id, estimates.im_id, estimates.obj_id), groups)
    rank = rank_in_group(estimate_group, best_first(estimates.score))
    on_target = estimate_group >= 0
    kept = on_target & (rank < np.append(n_allowed, 0)[estimate_group])
    ignored = {
        "not_a_target": int((~on_target).sum()),
        "beyond_instance_count": int((on_target & ~kept).sum()),
    }
    everything = np.ones(len(estimates), bool)
    return _build(groups, n_wanted, estimates, estimate_group, kept, truth, truth_group, matchable,
                  matchable, everything, ignored)  # fmt: skip


def _select_detection(
    estimates: PoseEstimates,
    truth: GroundTruth,
    targets: Targets,
    protocol: EvalProtocol,
    cap: int | None,
) -> Selection:
    images = _in_scene_order(targets)
    within_cap = np.ones(len(estimates), bool)
    if protocol.cap_estimates and cap is not None:
        within_cap = keep_best_per_image(estimates, cap)
    truth_image = find_rows((truth.scene_id, truth.im_id), images)
    estimate_image = find_rows((estimates.scene_id, estimates.im_id), images)
    on_target = estimate_image >= 0
    # Groups in the order of images, within an image in the order its truth names the objects;
    # objects that only estimates name come last.
    image = np.concatenate([truth_image, estimate_image])
    obj_id = np.concatenate([truth.obj_id, estimates.obj_id])
    known = np.concatenate([truth_image >= 0, on_target & protocol.absent_objects_count])
    named = first_of_each((image[known], obj_id[known]))
    named = named[np.argsort(image[known][named], kind="stable")]
    group_image, group_obj = image[known][named], obj_id[known][named]
    keys = (group_image, group_obj)
    truth_group = find_rows((truth_image, truth.obj_id), keys)
    estimate_group = find_rows((estimate_image, estimates.obj_id), keys)
    counted = truth.visib_fract >= (protocol.visib_min or 0.0)
    kept = within_cap & (estimate_group >= 0)
    ignored = {
        "over_cap": int((~within_cap).sum()),
        "not_a_target_image": int((within_cap & ~on_target).sum()),
        "object_absent_from_image": int((within_cap & on_target & (estimate_group < 0)).sum()),
    }
    n_wanted = np.bincount(truth_group[(truth_group >= 0) & counted], minlength=len(group_obj))
    groups = (images[0][group_image], images[1][group_image], group_obj)
    return _build(groups, n_wanted, estimates, estimate_group, kept, truth, truth_group,
                  np.ones(len(truth), bool), counted, within_cap, ignored)  # fmt: skip


def _in_scene_order(targets: Targets) -> tuple[Ints, Ints]:
    """Target images without repeats: scenes in order of first mention, images likewise."""
    first = first_of_each((targets.scene_id, targets.im_id))
    scene_id, im_id = targets.scene_id[first], targets.im_id[first]
    _, first_mention, scene = np.unique(scene_id, return_index=True, return_inverse=True)
    order = np.argsort(first_mention[scene], kind="stable")
    return scene_id[order], im_id[order]


def _build(
    groups: tuple[Ints, Ints, Ints],
    n_wanted: Ints,
    estimates: PoseEstimates,
    estimate_group: Ints,
    kept: Bools,
    truth: GroundTruth,
    truth_group: Ints,
    matchable: Bools,
    counted: Bools,
    within_cap: Bools,
    ignored: Mapping[str, int],
) -> Selection:
    estimate_rows = np.flatnonzero(kept)
    order = np.lexsort((-estimates.score[estimate_rows], estimate_group[estimate_rows]))
    estimate_rows = estimate_rows[order]
    truth_rows = np.flatnonzero(truth_group >= 0)
    truth_rows = truth_rows[np.lexsort((truth.gt_id[truth_rows], truth_group[truth_rows]))]
    return Selection(
        *groups,
        n_wanted=n_wanted.astype(np.int64),
        estimate_rows=estimate_rows,
        estimate_group=estimate_group[estimate_rows],
        truth_rows=truth_rows,
        truth_group=truth_group[truth_rows],
        truth_matchable=matchable[truth_rows],
        truth_counted=counted[truth_rows],
        within_cap=within_cap,
        ignored=ignored,
    )
