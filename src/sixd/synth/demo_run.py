"""The demo from end to end: make a dataset and results, check them, score them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from sixd.datasets.opening import open_dataset
from sixd.evaluation.evaluate import evaluate_all
from sixd.evaluation.evaluation import Evaluation
from sixd.evaluation.measure import Progress, no_progress
from sixd.results.lint import check_file
from sixd.synth.demo_dataset import make_demo_dataset
from sixd.synth.demo_results import write_demo_results

PROTOCOL_OF_TASK = {
    "localization": "bop19-localization",
    "detection": "bop24-detection",
    "detection2d": "bop22-detection2d",
    "segmentation2d": "bop22-segmentation2d",
}


@dataclass(frozen=True)
class DemoRun:
    """Where everything lies, and what came out."""

    dataset: Path
    results: tuple[Path, ...]
    evaluations: tuple[Evaluation, ...]
    saved: tuple[Path, ...]
    n_problems: int
    """Errors the checker found in the results: none, or the demo is broken."""


def run_demo(out: str | Path, *, seed: int = 0, progress: Progress = no_progress) -> DemoRun:
    """Make the demo dataset (once), its results, check them and score them.

    Args:
        out: folder; gets ``sixdemo/`` (the dataset; another seed, another folder), ``results/``
            and ``evaluations/``.
        seed: of scenes, noise and perturbations.
        progress: told (what, done, total).
    """
    out = Path(out)
    dataset_dir = out / ("sixdemo" if seed == 0 else f"sixdemo-{seed}")
    if not dataset_dir.is_dir():
        make_demo_dataset(dataset_dir, seed=seed, progress=progress)
    dataset = open_dataset(dataset_dir)
    results = tuple(write_demo_results(dataset_dir, out / "results", seed=seed))
    n_problems = sum(
        problem.severity == "error"
        for path in results
        for problem in check_file(path, dataset).problems
    )
    evaluations: list[Evaluation] = []
    saved: list[Path] = []
    for task, protocol in PROTOCOL_OF_TASK.items():
        files = [p for p in results if p.name.partition(".")[0].endswith(f"_{task}")]
        for evaluation in evaluate_all(files, dataset, protocol, progress=progress):
            name = Path(evaluation.provenance.results_file).name.partition(".")[0]
            saved.append(evaluation.save(out / "evaluations" / f"{name}.sixd"))
            evaluations.append(evaluation)
    return DemoRun(dataset_dir, results, tuple(evaluations), tuple(saved), n_problems)
