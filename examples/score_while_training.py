"""Score a validation set inside a training loop, in batches, without writing a file.

python examples/score_while_training.py DATASET
"""

from __future__ import annotations

import sys

import numpy as np

import sixd


def main(folder: str) -> None:
    dataset = sixd.open_dataset(folder)
    evaluator = sixd.Evaluator(dataset, "bop19-localization", errors=["mssd", "mspd"])
    truth = sixd.results_from_truth(dataset, "localization")
    for epoch, error_mm in enumerate((30.0, 10.0, 3.0)):  # a network would get better, too
        rng = np.random.default_rng(epoch)
        for rows in np.array_split(np.arange(len(truth)), 4):
            batch = truth.where(rows)
            evaluator.add(
                sixd.PoseEstimates.from_arrays(
                    scene_id=batch.scene_id,
                    im_id=batch.im_id,
                    obj_id=batch.obj_id,
                    score=batch.score,
                    R=batch.R,
                    t_mm=batch.t_mm + rng.normal(0, error_mm, batch.t_mm.shape),
                )
            )
        print(f"epoch {epoch}: AR_mssd {evaluator.compute().scores['AR_mssd']:.3f}")
        evaluator.reset()


if __name__ == "__main__":
    main(sys.argv[1])
