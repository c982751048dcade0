"""How results are perturbed: strengths, times and scores, and what is wrongly seen.

Perturbed truth is no method's result. It shows what result files look like, and how scores fall
with errors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sixd.datasets import Dataset, Targets
from sixd.geometry.pose import Floats
from sixd.results.tables import Detections, PoseEstimates

Ints = NDArray[np.int64]
Image = tuple[int, int]


@dataclass(frozen=True)
class Strength:
    """How far results are from the truth; deviations are standard deviations."""

    name: str
    rotation_deg: float
    lateral_mm: float
    depth_mm: float
    """Along the viewing ray, where estimates from one image are least sure."""
    border_px: float
    """Of boxes and masks, at 640 px image width."""
    missed: float
    """Share of instances without an estimate."""
    doubled: float
    """Share of instances with a second, worse estimate (detection only)."""
    n_false: int
    """Estimates per image of things that are not there (detection only)."""
    time_s: float
    """Time per image that is written down; the better the slower."""


STRENGTHS = (
    Strength("perturbed-slightly", 1.5, 0.7, 2.0, 1.0, 0.03, 0.2, 2, 1.8),
    Strength("perturbed-moderately", 5.0, 2.5, 7.0, 3.5, 0.12, 0.4, 4, 0.6),
    Strength("perturbed-strongly", 12.0, 7.0, 20.0, 9.0, 0.25, 0.6, 8, 0.2),
)


@dataclass(frozen=True, eq=False)
class Perturbation:
    """One strength at work on one dataset."""

    dataset: Dataset
    strength: Strength
    rng: np.random.Generator
    time_s_of_image: dict[Image, float]
    """For each image (scene id, image id) that results are made for."""

    @classmethod
    def of(
        cls, dataset: Dataset, targets: Targets, strength: Strength, rng: np.random.Generator
    ) -> Perturbation:
        """Draw the times of the target images."""
        images: list[Image] = [(s, i) for s, i in targets.images.tolist()]
        times_s = np.round(strength.time_s * rng.uniform(0.8, 1.2, len(images)), 3).tolist()
        return cls(dataset, strength, rng, dict(zip(images, times_s, strict=True)))

    def times_s(self, scene_id: Ints, im_id: Ints) -> Floats:
        """The time of each row's image: the same in all its rows (BOP rules 1)."""
        keys = zip(scene_id.tolist(), im_id.tolist(), strict=True)
        return np.array([self.time_s_of_image[key] for key in keys], np.float64)

    def found(self, n: int) -> Ints:
        """Indices of the instances that are not missed."""
        return np.flatnonzero(self.rng.random(n) >= self.strength.missed)

    def doubled(self, rows: Ints) -> Ints:
        """Those of the rows that get a second estimate."""
        return rows[self.rng.random(len(rows)) < self.strength.doubled]

    def scores(self, size: Floats) -> Floats:
        """Confidence that falls with the size of the perturbation, as a good method's would."""
        score: Floats = 0.95 * np.exp(-0.25 * size) + self.rng.normal(0.0, 0.03, size.shape)
        return np.clip(score, 0.01, 0.99).round(4)

    def false_scores(self, n: int) -> Floats:
        """Confidence in things that are not there."""
        return self.rng.uniform(0.02, 0.6, n).round(4)

    def false_objects(self, table: PoseEstimates | Detections, image: Image) -> list[int]:
        """Objects wrongly seen in an image: every second one is absent from it, if any is."""
        here = (table.scene_id == image[0]) & (table.im_id == image[1])
        known = self.dataset.object_ids
        absent = sorted(set(known) - set(table.obj_id[here].tolist()))
        pools = [absent or known, known]
        return [int(self.rng.choice(pools[k % 2])) for k in range(self.strength.n_false)]
