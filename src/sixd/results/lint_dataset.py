"""What may be wrong with results for a certain dataset: ids it does not have, targets left out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from sixd.datasets.ids import some
from sixd.errors import MissingDataError, Problem
from sixd.results.findings import Findings
from sixd.results.lint_images import column_names, count_images, image_name
from sixd.results.row_places import place_of
from sixd.results.tables import Table
from sixd.rows import find_rows, first_of_each

if TYPE_CHECKING:
    from sixd.datasets.dataset import Dataset
    from sixd.datasets.targets import Targets

Bools = NDArray[np.bool_]
_NAMED = 5
_WRONG_DATASET = 0.5


def check_known_ids(
    table: Table, dataset: Dataset, targets: Targets | None, found: Findings
) -> None:
    """Scenes, images and objects that the dataset does not have.

    Target images are known without their scene's files being read.
    """
    has_scene = np.isin(table.scene_id, dataset.scene_ids)
    has_object = np.isin(table.obj_id, dataset.object_ids)
    has_image = _has_image(table, dataset, targets, has_scene)
    _tell_unknown(table, dataset, "scene", has_scene, found)
    _tell_unknown(table, dataset, "image", has_image, found)
    _tell_unknown(table, dataset, "object", has_object, found)


def _tell_unknown(
    table: Table,
    dataset: Dataset,
    noun: Literal["scene", "image", "object"],
    known: Bools,
    found: Findings,
) -> None:
    code, column = {
        "scene": ("unknown-scene", "scene_id"),
        "image": ("unknown-image", "im_id"),
        "object": ("unknown-object", "obj_id"),
    }[noun]
    name, ids = column_names(table)[column], getattr(table, column)
    is_foreign = len(known) and 1 - known.mean() > _WRONG_DATASET

    def unknown(row: int) -> Problem:
        line, field = place_of(table, row, name)
        expected = {
            "scene": f"one of {some(dataset.scene_ids)}",
            "image": f"an image of scene {table.scene_id[row]}",
            "object": f"one of {some(dataset.object_ids)}",
        }[noun]
        return Problem(
            code=code,
            what=f"{dataset.name} {dataset.split} has no such {noun}",
            line=line,
            field=field,
            expected=expected,
            got=str(ids[row]),
            fix="is this the results file of another dataset or split?"
            if is_foreign
            else f"write the {name} of the dataset",
        )

    found.each(np.flatnonzero(~known), unknown)


def _has_image(table: Table, dataset: Dataset, targets: Targets | None, rows: Bools) -> Bools:
    has = ~rows
    if targets is not None:
        has |= find_rows((table.scene_id, table.im_id), (targets.scene_id, targets.im_id)) >= 0
    for scene_id in np.unique(table.scene_id[~has]).tolist():
        here = table.scene_id == scene_id
        try:
            has |= here & np.isin(table.im_id, dataset.image_ids(scene_id))
        except MissingDataError:  # without the scene's files only targets can be told
            has |= here
    return has


def check_targets(
    table: Table, targets: Targets, every_object: bool, complete: bool, found: Findings
) -> None:
    """Targets without estimates, and estimates that are no targets.

    Args:
        table: the results.
        targets: the list of the protocol.
        every_object: a target is an object in an image, not an image.
        complete: the file was read to its end.
        found: takes the problems.
    """
    rows = [table.scene_id, table.im_id]
    wanted = [targets.scene_id, targets.im_id]
    in_image = find_rows((rows[0], rows[1]), (wanted[0], wanted[1])) >= 0
    with_object = every_object and targets.obj_id is not None
    if targets.obj_id is not None and with_object:
        rows.append(table.obj_id)
        wanted.append(targets.obj_id)
        other = in_image & (find_rows(tuple(rows), tuple(wanted)) < 0)
        _tell_no_target(table, other, "non-target-object", "obj_id", "objects", targets, found)
    _tell_no_target(table, ~in_image, "non-target-image", "im_id", "images", targets, found)
    first = first_of_each(tuple(wanted))
    columns = tuple(column[first] for column in wanted)
    lacking = np.flatnonzero(find_rows(columns, tuple(rows)) < 0)
    if len(lacking) and complete:
        named = [_target_name([int(column[k]) for column in columns]) for k in lacking[:_NAMED]]
        more = f"; and {len(lacking) - _NAMED:,} more" if len(lacking) > _NAMED else ""
        found.add(
            Problem(
                code="missing-targets",
                what="targets have no estimate; they count as missed",
                expected=f"an estimate for each of {len(first):,} "
                + ("targets" if with_object else "target images"),
                got=f"none for {len(lacking):,}: {'; '.join(named)}{more}",
                fix="run the method on all targets of the list",
                severity="warning",
            )
        )


def _tell_no_target(
    table: Table, rows: Bools, code: str, column: str, noun: str, targets: Targets, found: Findings
) -> None:
    if not rows.any():
        return
    first = int(np.flatnonzero(rows)[0])
    line, field = place_of(table, first, column_names(table)[column])
    n_images = count_images(table.where(rows))
    found.add(
        Problem(
            code=code,
            what=f"estimates of {noun} that are no targets; they are not scored",
            line=line,
            field=field,
            expected=f"{noun} of {targets.file or 'the list of targets'}",
            got=f"{rows.sum():,} estimates in {n_images:,} images; first "
            f"{image_name(table, first)}, object {table.obj_id[first]}",
            fix="leave them out",
            severity="warning",
        )
    )


def _target_name(ids: list[int]) -> str:
    return ", ".join(f"{n} {i}" for n, i in zip(("scene", "image", "object"), ids, strict=False))
