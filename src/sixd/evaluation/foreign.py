"""Results for another dataset are refused, not scored: a low number would hide the mix-up."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from sixd.datasets.dataset import Dataset
from sixd.datasets.ids import some
from sixd.datasets.spec import known_datasets
from sixd.datasets.targets import Targets
from sixd.errors import MissingDataError, UsageError
from sixd.results.tables import Table
from sixd.rows import find_rows

MOST_UNKNOWN = 0.5
"""Results with a larger share of unknown scenes or objects are taken to be for another dataset."""


def refuse_foreign_name(path: Path, dataset: Dataset) -> None:
    """Refuse a file that is not there, or whose BOP-style name is of another known dataset.

    Raises:
        MissingDataError: there is no such file.
        UsageError: it is named after another dataset.
    """
    if not path.is_file():
        raise MissingDataError(f"no results file at {path}")
    named = re.match(r"[^_]*_([a-z0-9]+)-", path.name)
    known = known_datasets()
    if named and dataset.name in known and named[1] in set(known) - {dataset.name}:
        raise UsageError(
            f"{path.name} is named as results for {named[1]}, not for {dataset.name}\n"
            f"    fix: give --dataset {named[1]}, or rename the file if its name is wrong"
        )


def refuse_foreign_rows(
    table: Table, dataset: Dataset, targets: Targets, objects: tuple[int, ...], file: str
) -> None:
    """Refuse results that are in no target image, or mostly name what the dataset does not have.

    Args:
        table: the results.
        dataset: its scenes are known.
        targets: the images that are scored.
        objects: ids of the objects that are known.
        file: named in the message.

    Raises:
        UsageError: the results are for another dataset.
    """
    if not len(table):
        return
    images = (targets.scene_id, targets.im_id)
    on_target = find_rows((table.scene_id, table.im_id), images) >= 0
    is_unknown = ~np.isin(table.scene_id, dataset.scene_ids) | ~np.isin(table.obj_id, objects)
    if on_target.any() and is_unknown.mean() <= MOST_UNKNOWN:
        return
    if on_target.any():
        what = f"{is_unknown.sum()} of {len(table)} rows name a scene or object that is not in"
    else:
        what = f"none of {len(table)} rows is in a target image of"
    raise UsageError(
        f"{file or 'the results'}: {what} {dataset.name} ({dataset.split}); "
        "are they for another dataset or split?\n"
        f"    expected: scenes {some(dataset.scene_ids)}; objects {some(objects)}\n"
        f"    got: scenes {some(sorted(set(table.scene_id.tolist())))}; "
        f"objects {some(sorted(set(table.obj_id.tolist())))}"
    )
