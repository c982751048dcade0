"""What may be wrong with boxes and masks that can be read."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from sixd.errors import MissingDataError, Problem
from sixd.results.findings import Findings
from sixd.results.groups import group_rows
from sixd.results.places import place_of
from sixd.results.rle import measure_runs
from sixd.results.tables import Detections, Floats, Rle

if TYPE_CHECKING:
    from sixd.datasets.dataset import Dataset

OUTSIDE_TOLERANCE_PX = 1.0
"""Boxes may stand this far out of the image before it is told."""
_LARGEST_NORMALISED = 1.5


def check_detections(
    table: Detections,
    dataset: Dataset | None,
    wanted: Literal["bbox", "segm"] | None,
    found: Findings,
) -> None:
    """Look at each box and mask; ``wanted`` says which of them is scored, None if not known."""
    size_px = _image_sizes(table, dataset)
    _check_presence(table, wanted, found)
    _check_boxes(table, size_px, found)
    _check_masks(table, size_px, found)
    _check_duplicates(table, found)


def _image_sizes(table: Detections, dataset: Dataset | None) -> Floats:
    """``(N, 2)`` width and height of each row's image; NaN where it cannot be told."""
    size_px = np.full((len(table), 2), np.nan)
    if dataset is None:
        return size_px
    known = set(dataset.scene_ids)
    for scene_id in set(table.scene_id.tolist()) & known:
        try:
            size_px[table.scene_id == scene_id] = dataset.image_size_of(scene_id)
        except MissingDataError:
            continue
    return size_px


def _check_presence(
    table: Detections, wanted: Literal["bbox", "segm"] | None, found: Findings
) -> None:
    # A box with NaN has been told already; only a row that is all NaN has none.
    has_bbox = ~np.isnan(table.bbox_xywh_px).all(axis=1)
    lacking, name = {
        "bbox": (~has_bbox, "bbox"),
        "segm": (~table.has_mask, "segmentation"),
        None: (~has_bbox & ~table.has_mask, "bbox or segmentation"),
    }[wanted]

    def missing(row: int) -> Problem:
        line, field = place_of(table, row, name)
        return Problem(
            code="missing-field",
            what=f"{name} is missing",
            line=line,
            field=field,
            expected=f"{name} in every entry" + (", since it is scored" if wanted else ""),
            got="none",
            fix=f"write the {name}, or leave the entry out",
        )

    found.each(np.flatnonzero(lacking), missing)


def _check_boxes(table: Detections, size_px: Floats, found: Findings) -> None:
    boxes = table.bbox_xywh_px
    known = np.isfinite(boxes).all(axis=1)
    largest = np.abs(boxes[known]).max(axis=1)
    if known.any() and np.median(largest) <= _LARGEST_NORMALISED and largest.any():
        line, field = place_of(table, int(np.flatnonzero(known)[0]), "bbox")
        found.add(
            Problem(
                code="normalised-boxes",
                what="boxes look like fractions of the image; they must be in pixels",
                line=line,
                field=field,
                expected="[left, top, width, height] in pixels",
                got=f"numbers up to {np.median(largest):.3g} in half of {known.sum():,} boxes",
                fix="multiply by the width and the height of the image",
            )
        )
        return
    low, high = boxes[:, :2], boxes[:, :2] + boxes[:, 2:]
    inverted = known & (boxes[:, 2:] < 0).any(axis=1)
    empty = known & ~inverted & (boxes[:, 2:] == 0).any(axis=1)
    outside = known & ~inverted & ((low >= size_px) | (high <= 0)).any(axis=1)
    outside &= np.isfinite(size_px).all(axis=1)
    reach = np.maximum(-low, high - size_px).max(axis=1)
    beyond = known & ~inverted & ~outside & (reach > OUTSIDE_TOLERANCE_PX)

    def problem(row: int, code: str, what: str, expected: str, fix: str) -> Problem:
        line, field = place_of(table, row, "bbox")
        size = "" if np.isnan(size_px[row, 0]) else " in {:.0f} x {:.0f} px".format(*size_px[row])
        got = str(boxes[row].tolist()) + (size if code.startswith("box-") else "")
        severity: Literal["error", "warning"] = (
            "error" if code in ("inverted-box", "box-outside") else "warning"
        )
        return Problem(code, what, "", line, field, expected, got, fix, severity)

    found.each(
        np.flatnonzero(inverted),
        lambda row: problem(
            row,
            "inverted-box",
            "the box has a negative width or height",
            "[left, top, width, height], the last two above 0",
            "are these corners? width = right - left, height = bottom - top",
        ),
    )
    found.each(
        np.flatnonzero(empty),
        lambda row: problem(
            row,
            "empty-box",
            "the box has no area",
            "[left, top, width, height], the last two above 0",
            "leave the detection out",
        ),
    )
    found.each(
        np.flatnonzero(outside),
        lambda row: problem(
            row,
            "box-outside",
            "the box lies outside the image",
            "[left, top, width, height] in pixels of the image",
            "check the image size the detector saw, and the order of the numbers",
        ),
    )
    found.each(
        np.flatnonzero(beyond),
        lambda row: problem(
            row,
            "box-beyond",
            f"the box reaches more than {OUTSIDE_TOLERANCE_PX:g} px out of the image",
            "a box within the image: true boxes end at its border",
            "clip the box to the image",
        ),
    )


def _check_masks(table: Detections, size_px: Floats, found: Findings) -> None:
    rows = np.flatnonzero(table.has_mask)
    if not len(rows):
        return
    masks = [mask for mask in table.segmentation if mask is not None]
    runs = measure_runs(masks)
    pixels = np.array([float(mask.size[0]) * mask.size[1] for mask in masks])
    heights_widths = np.array([mask.size for mask in masks], np.float64)
    image = size_px[rows][:, ::-1]
    undecodable = np.isnan(runs.total)
    negative = runs.shortest < 0
    short = ~undecodable & ~negative & (runs.total != pixels)
    other_size = np.isfinite(image).all(axis=1) & (heights_widths != image).any(axis=1)

    def bad(k: int, what: str, expected: str, got: str, fix: str) -> Problem:
        line, field = place_of(table, int(rows[k]), "segmentation")
        return Problem("bad-rle", what, "", line, field, expected, got, fix)

    found.each(
        np.flatnonzero(undecodable),
        lambda k: bad(
            k,
            "counts cannot be decoded",
            "COCO's compressed string, or a list of integers",
            _shown_counts(masks[k]),
            "write what a COCO library's encode returns, decoded from bytes to text",
        ),
    )
    found.each(
        np.flatnonzero(negative),
        lambda k: bad(
            k,
            "counts contain negative runs",
            "runs of 0 or more pixels",
            f"a run of {runs.shortest[k]:.0f}",
            "write the mask again",
        ),
    )
    found.each(
        np.flatnonzero(short),
        lambda k: bad(
            k,
            "counts do not fill the image",
            f"height x width = {masks[k].size[0]} x {masks[k].size[1]} = {pixels[k]:.0f} pixels",
            f"{runs.total[k]:.0f}",
            "size is [height, width], and the runs go on to the last pixel",
        ),
    )

    def wrong_size(k: int) -> Problem:
        line, field = place_of(table, int(rows[k]), "segmentation.size")
        is_swapped = (heights_widths[k, ::-1] == image[k]).all()
        return Problem(
            code="mask-size",
            what="the mask is not of the size of the image",
            line=line,
            field=field,
            expected="[{:.0f}, {:.0f}], height and width".format(*image[k]),
            got=str(list(masks[k].size)),
            fix="swap height and width, also when the runs are made"
            if is_swapped
            else "scale the mask to the image before it is coded",
        )

    found.each(np.flatnonzero(other_size), wrong_size)


def _shown_counts(mask: Rle) -> str:
    text = str(mask.counts)
    return repr(text if len(text) <= 40 else text[:40] + "...")


def _check_duplicates(table: Detections, found: Findings) -> None:
    rows = np.flatnonzero(table.has_bbox)
    ids = (table.scene_id[rows], table.im_id[rows], table.obj_id[rows])
    first, group = group_rows(*ids, *table.bbox_xywh_px[rows].T)
    original: NDArray[np.intp] = rows[first[group]]
    counts = [None if mask is None else mask.counts for mask in table.segmentation]
    copies = [
        k
        for k in np.flatnonzero(original != rows).tolist()
        if counts[rows[k]] == counts[original[k]]
    ]

    def duplicate(k: int) -> Problem:
        line, field = place_of(table, int(rows[k]), "bbox")
        _, other = place_of(table, int(original[k]), "bbox")
        return Problem(
            code="duplicate",
            what="the same detection of the same object in the same image, again",
            line=line,
            field=field,
            expected="each detection once; a second one is a false positive",
            got=f"that of {other}",
            fix="keep the one with the higher score",
            severity="warning",
        )

    found.each(copies, duplicate)
