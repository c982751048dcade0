"""VSD of all pairs, image by image: each depth image is decoded once, each pose rendered once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sixd.datasets.truth import GroundTruth
from sixd.evaluation.errors_table import Pairs
from sixd.evaluation.protocol import EvalProtocol
from sixd.evaluation.selection import Selection
from sixd.geometry.pose import Pose
from sixd.results.tables import PoseEstimates
from sixd.rows import row_codes, rows_of_each

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
        assert models.dataset.spec.vsd_delta_mm is not None  # read_inputs refused it
        self.delta_mm = models.dataset.spec.vsd_delta_mm

    def images(self) -> Iterator[tuple[int, Ints]]:
        """``(group, pair rows)`` of each image that has pairs; any group of it names the image."""
        group = self.selection.estimate_group[self.pairs.estimate]
        (image,) = row_codes((self.selection.scene_id[group], self.selection.im_id[group]))
        for _, rows in rows_of_each(image):
            yield int(group[rows[0]]), rows

    def measure_image(self, group: int, rows: Ints) -> None:
        """Render the poses of one image and compare all its pairs with the depth image."""
        from sixd.metrics.vsd import vsd_pairs

        dataset = self.models.dataset
        scene_id = int(self.selection.scene_id[group])
        im_id = int(self.selection.im_id[group])
        image = dataset.cameras(scene_id)[im_id]
        assert image.K is not None  # read_inputs refused other cameras
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
