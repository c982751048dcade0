"""What may be wrong with results for a certain dataset: ids it does not have, targets left out."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sixd.errors import MissingDataError, Problem
from sixd.results.findings import Findings
from sixd.results.groups import group_rows, is_in
from sixd.results.lint_images import column_names, image_name, images_of
from sixd.results.places import place_of
from sixd.results.tables import Table

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
    scenes, objects = dataset.scene_ids, dataset.object_ids
    no_scene = ~np.isin(table.scene_id, scenes)
    no_object = ~np.isin(table.obj_id, objects)
    no_image = ~no_scene & ~_has_image(table, dataset, targets, ~no_scene)
    names = column_names(table)
    unknown = (
        ("unknown-scene", "scene_id", no_scene, lambda row: _some(scenes)),
        (
            "unknown-image",
            "im_id",
            no_image,
            lambda row: f"an image of scene {table.scene_id[row]}",
        ),
        ("unknown-object", "obj_id", no_object, lambda row: _some(objects)),
    )
    for code, column, rows, expected in unknown:
        much = rows.mean() > _WRONG_DATASET if len(rows) else False

        def problem(
            row: int,
            code: str = code,
            column: str = column,
            expected: object = expected,
            much: bool = bool(much),
        ) -> Problem:
            line, field = place_of(table, row, names[column])
            return Problem(
                code=code,
                what=f"{dataset.name} {dataset.split} has no such {code.removeprefix('unknown-')}",
                line=line,
                field=field,
                expected=expected(row),  # type: ignore[operator]
                got=str(getattr(table, column)[row]),
                fix="is this the results file of another dataset or split?"
                if much
                else f"write the {names[column]} of the dataset",
            )

        found.each(np.flatnonzero(rows), problem)


def _has_image(table: Table, dataset: Dataset, targets: Targets | None, rows: Bools) -> Bools:
    has = ~rows
    if targets is not None:
        has |= is_in((table.scene_id, table.im_id), (targets.scene_id, targets.im_id))
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
    in_image = is_in((rows[0], rows[1]), (wanted[0], wanted[1]))
    with_object = every_object and targets.obj_id is not None
    if targets.obj_id is not None and with_object:
        rows.append(table.obj_id)
        wanted.append(targets.obj_id)
        other = in_image & ~is_in(tuple(rows), tuple(wanted))
        _tell_no_target(table, other, "non-target-object", "obj_id", "objects", targets, found)
    _tell_no_target(table, ~in_image, "non-target-image", "im_id", "images", targets, found)
    first, _ = group_rows(*wanted)
    first = np.sort(first)  # in the order of the list
    columns = tuple(column[first] for column in wanted)
    lacking = np.flatnonzero(~is_in(columns, tuple(rows)))
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
    n_images = len(images_of(table.where(rows))[0])
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


def _some(ids: Iterable[int]) -> str:
    """Ids as a message lists them, the first dozen."""
    known = sorted(ids)
    return f"one of {', '.join(map(str, known[:12]))}" + (", ..." if len(known) > 12 else "")
