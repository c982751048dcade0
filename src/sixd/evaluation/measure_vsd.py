"""VSD of all pairs, image by image: each depth image is decoded once, each pose rendered once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sixd.datasets.truth import GroundTruth
from sixd.errors import UsageError
from sixd.evaluation.errors_table import Pairs
from sixd.evaluation.keys import row_codes
from sixd.evaluation.protocol import EvalProtocol
from sixd.evaluation.selection import Selection
from sixd.geometry.pose import Pose
from sixd.results.tables import PoseEstimates

if TYPE_CHECKING:
    from sixd.evaluation.prepared import PreparedModels

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


class VsdTask:
    """Fills the VSD column of one evaluation; each image is a piece of work for one thread."""

    def __init__(
        self,
        models: PreparedModels,
        protocol: EvalProtocol,
        selection: Selection,
        pairs: Pairs,
        estimates: PoseEstimates,
        truth: GroundTruth,
        vsd: Floats,
    ) -> None:
        self.models, self.selection, self.pairs, self.vsd = models, selection, pairs, vsd
        self.est = estimates.pose_c_m[selection.estimate_rows]
        self.gt = truth.pose_c_m[selection.truth_rows]
        self.spec = next(e for e in protocol.errors if e.name == "vsd")
        self.reach_check = protocol.reach_check
        delta_mm = models.dataset.spec.vsd_delta_mm
        if delta_mm is None:
            raise UsageError(
                f"{models.dataset.name} defines no vsd_delta_mm, so VSD is not defined on it; "
                "leave it out (--errors mssd,mspd) or set vsd_delta_mm in its dataset.toml"
            )
        self.delta_mm = delta_mm

    def images(self) -> Iterator[tuple[int, Ints]]:
        """``(group, pair rows)`` of each image that has pairs; any group of it names the image."""
        group = self.selection.estimate_group[self.pairs.estimate]
        (image,) = row_codes((self.selection.scene_id[group], self.selection.im_id[group]))
        order = np.argsort(image, kind="stable")
        _, first = np.unique(image[order], return_index=True)
        for rows in np.split(order, first[1:]):
            if len(rows):
                yield int(group[rows[0]]), rows

    def measure_image(self, group: int, rows: Ints) -> None:
        """Render the poses of one image and compare all its pairs with the depth image."""
        from sixd.metrics.vsd import vsd_pairs

        dataset = self.models.dataset
        scene_id = int(self.selection.scene_id[group])
        im_id = int(self.selection.im_id[group])
        image = dataset.cameras(scene_id)[im_id]
        if image.K is None:
            raise UsageError(
                f"scene {scene_id}, image {im_id} of {dataset.name} was taken by a camera that is "
                "not a pinhole, where VSD is not defined; leave it out: --errors mssd,mspd"
            )
        est, est_pose = np.unique(self.pairs.estimate[rows], return_inverse=True)
        gt, gt_pose = np.unique(self.pairs.truth[rows], return_inverse=True)
        groups = np.concatenate(
            [self.selection.estimate_group[est], self.selection.truth_group[gt]]
        )
        objects, mesh_index = np.unique(self.selection.obj_id[groups], return_inverse=True)
        diameters_mm = np.array([dataset.model(int(o)).diameter_mm for o in objects])
        pair_mesh = mesh_index[est_pose]
        self.vsd[rows] = vsd_pairs(
            dataset.depth_mm(scene_id, im_id),
            image.K,
            [self.models.mesh(int(o)) for o in objects],
            Pose(
                np.concatenate([self.est.R[est], self.gt.R[gt]]),
                np.concatenate([self.est.t_mm[est], self.gt.t_mm[gt]]),
            ),
            mesh_index,
            np.stack([est_pose, len(est) + gt_pose], axis=1),
            diameters_mm[pair_mesh],
            self.delta_mm,
            np.asarray(self.spec.taus),
            tau_in_mm=self.spec.tau_unit == "mm",
            sphere_check=self.reach_check,
            missing_hides=self.spec.missing_depth_hides,
        )
