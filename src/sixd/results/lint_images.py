"""What may be wrong with ids, times and counts, of poses and detections alike."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sixd.errors import Problem
from sixd.results.findings import Findings
from sixd.results.row_places import other_place, place_of
from sixd.results.tables import Detections, Table
from sixd.rows import best_first, first_of_each, first_with_code, rank_in_group, row_codes

TIME_TOLERANCE_S = 0.001
"""Times of one image may differ by this much (BOP rules 1)."""


def check_images(table: Table, found: Findings) -> None:
    """Look at ids and times."""
    _check_ids(table, found)
    _check_times(table, found)


def column_names(table: Table) -> dict[str, str]:
    """Names of the id columns as the table's file has them."""
    if isinstance(table, Detections):
        return {"scene_id": "scene_id", "im_id": "image_id", "obj_id": "category_id"}
    return {"scene_id": "scene_id", "im_id": "im_id", "obj_id": "obj_id"}


def images_of(table: Table) -> NDArray[np.int64]:
    """``(N,)`` image of each row, numbered from 0 without gaps."""
    (image,) = row_codes((table.scene_id, table.im_id))
    return image


def count_images(table: Table) -> int:
    """How many images have rows."""
    return int(images_of(table).max(initial=-1)) + 1


def image_name(table: Table, row: int) -> str:
    """The image of a row, for messages."""
    return f"scene {table.scene_id[row]}, image {table.im_id[row]}"


def _check_ids(table: Table, found: Findings) -> None:
    for column, name in column_names(table).items():
        values = getattr(table, column)

        def negative(row: int, name: str = name, values: NDArray[np.int64] = values) -> Problem:
            line, field = place_of(table, row, name)
            return Problem(
                code="negative-id",
                what=f"{name} is negative",
                line=line,
                field=field,
                expected="0 or more",
                got=str(values[row]),
                fix="write the id of the dataset",
            )

        found.each(np.flatnonzero(values < 0), negative)


def wrong_times(table: Table) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows whose time differs from that of their image, and the first row that has one.

    Missing times are no times.
    """
    timed = np.flatnonzero(~np.isnan(table.time_s))
    (image,) = row_codes((table.scene_id[timed], table.im_id[timed]))
    leader = timed[first_with_code(image)[image]]
    gaps = np.abs(table.time_s[timed] - table.time_s[leader])
    wrong = gaps > TIME_TOLERANCE_S
    return timed[wrong], leader[wrong]


def _check_times(table: Table, found: Findings) -> None:
    rows, leaders = wrong_times(table)
    leader_of = dict(zip(rows.tolist(), leaders.tolist(), strict=True))
    missing = np.flatnonzero(np.isnan(table.time_s))
    # One missing time makes the average unknown, and then no times are compared (BOP rules 1).
    severity: Literal["error", "warning"] = "warning" if len(missing) else "error"

    def inconsistent(row: int) -> Problem:
        line, field = place_of(table, row, "time")
        leader = leader_of[row]
        return Problem(
            code="inconsistent-time",
            what="the time is that of the whole image, so all its rows must agree",
            line=line,
            field=field,
            expected=f"{table.time_s[leader]!s} as in {other_place(table, leader)}, "
            f"within {TIME_TOLERANCE_S:g} s",
            got=f"{table.time_s[row]!s} ({image_name(table, row)})",
            fix="write the image's time in each of its rows, or: sixd check --fix OUT",
            severity=severity,
        )

    found.each(rows, inconsistent)
    if len(missing):
        line, field = place_of(table, int(missing[0]), "time")
        found.add(
            Problem(
                code="missing-time",
                what="times are missing, so the average time per image is not known",
                line=line,
                field=field,
                expected="seconds spent on the image, in every row",
                got=f"none in {len(missing):,} of {len(table):,} rows, this one first",
                fix="measure the time of each image and write it in all its rows",
                severity="warning",
            )
        )


def check_cap(table: Table, cap: int, found: Findings) -> None:
    """More estimates of an image than are scored."""
    image = images_of(table)
    rank = rank_in_group(image, best_first(table.score))
    dropped = np.flatnonzero(rank >= cap)
    n_rows = np.bincount(image)
    last_score, next_score = np.full((2, len(n_rows)), np.nan)
    for score, place in ((last_score, cap - 1), (next_score, cap)):
        score[image[rank == place]] = table.score[rank == place]
    for first in dropped[first_of_each((image[dropped],))].tolist():
        n, is_tie = n_rows[image[first]], (last_score == next_score)[image[first]]
        line, field = place_of(table, first, "score")
        found.add(
            Problem(
                code="over-cap",
                what="an image has more estimates than are scored; the lowest scores are left out",
                line=line,
                field=field,
                expected=f"at most {cap} estimates in an image",
                got=f"{n} in {image_name(table, first)}: {n - cap} not scored"
                + (", by their order in the file where scores are equal" if is_tie else ""),
                fix="write the best estimates only",
                severity="warning",
            )
        )
