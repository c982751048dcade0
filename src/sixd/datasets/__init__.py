"""Datasets: specs as data, one reader for all BOP layouts.

The truth is not exported here: evaluation imports `sixd.datasets.truth`, methods must not.
"""

from sixd.datasets.dataset import Dataset
from sixd.datasets.frames import Frame, ImageCamera, Target
from sixd.datasets.models import ObjectModel
from sixd.datasets.opening import open_dataset
from sixd.datasets.spec import DatasetSpec, known_datasets, load_spec
from sixd.datasets.targets import Targets

__all__ = [
    "Dataset",
    "DatasetSpec",
    "Frame",
    "ImageCamera",
    "ObjectModel",
    "Target",
    "Targets",
    "known_datasets",
    "load_spec",
    "open_dataset",
]
