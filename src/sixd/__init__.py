"""6D object pose estimation, benchmarked: datasets, results, metrics, evaluation.

The names below are the public API; each is imported when it is first used, so that
``import sixd`` is instant.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from sixd.version import __version__ as __version__

if TYPE_CHECKING:
    from sixd.datasets.dataset import Dataset as Dataset
    from sixd.datasets.opening import open_dataset as open_dataset
    from sixd.errors import Problem as Problem
    from sixd.errors import SixdError as SixdError
    from sixd.evaluation.evaluate import Evaluator as Evaluator
    from sixd.evaluation.evaluate import evaluate as evaluate
    from sixd.evaluation.evaluation import Evaluation as Evaluation
    from sixd.evaluation.evaluation import load_evaluation as load_evaluation
    from sixd.evaluation.protocol import PROTOCOLS as PROTOCOLS
    from sixd.evaluation.protocol import EvalProtocol as EvalProtocol
    from sixd.evaluation.truth_results import results_from_truth as results_from_truth
    from sixd.geometry.camera import Camera as Camera
    from sixd.geometry.mesh import Mesh as Mesh
    from sixd.geometry.mesh import read_mesh as read_mesh
    from sixd.geometry.pose import Pose as Pose
    from sixd.geometry.symmetry import Symmetries as Symmetries
    from sixd.results.fix import fix_file as fix_file
    from sixd.results.lint import check_file as check_file
    from sixd.results.reading import read_results as read_results
    from sixd.results.tables import Detections as Detections
    from sixd.results.tables import PoseEstimates as PoseEstimates
    from sixd.results.writing import write_results as write_results

_HOME = {
    "Camera": "geometry.camera",
    "Dataset": "datasets.dataset",
    "Detections": "results.tables",
    "EvalProtocol": "evaluation.protocol",
    "Evaluation": "evaluation.evaluation",
    "Evaluator": "evaluation.evaluate",
    "Mesh": "geometry.mesh",
    "PROTOCOLS": "evaluation.protocol",
    "Pose": "geometry.pose",
    "PoseEstimates": "results.tables",
    "Problem": "errors",
    "SixdError": "errors",
    "Symmetries": "geometry.symmetry",
    "check_file": "results.lint",
    "evaluate": "evaluation.evaluate",
    "fix_file": "results.fix",
    "load_evaluation": "evaluation.evaluation",
    "open_dataset": "datasets.opening",
    "read_mesh": "geometry.mesh",
    "read_results": "results.reading",
    "write_results": "results.writing",
    "results_from_truth": "evaluation.truth_results",
}

__all__ = ["__version__", *_HOME]  # noqa: PLE0604 (ruff does not follow the star)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'sixd' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"sixd.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
