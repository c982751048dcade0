"""What may be wrong with boxes and masks that can be read."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from sixd.errors import MissingDataError, Problem
from sixd.results.findings import Findings
from sixd.results.row_places import place_of
from sixd.results.run_lengths import measure_runs
from sixd.results.tables import Detections, Floats, Rle
from sixd.rows import first_with_code, row_codes

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


@dataclass(frozen=True)
class _BoxFault:
    """One way in which a box can be wrong."""

    code: str
    what: str
    expected: str
    fix: str
    severity: Literal["error", "warning"]


_INVERTED = _BoxFault(
    "inverted-box",
    "the box has a negative width or height",
    "[left, top, width, height], the last two above 0",
    "are these corners? width = right - left, height = bottom - top",
    "error",
)
_EMPTY = _BoxFault(
    "empty-box",
    "the box has no area",
    "[left, top, width, height], the last two above 0",
    "leave the detection out",
    "warning",
)
_OUTSIDE = _BoxFault(
    "box-outside",
    "the box lies outside the image",
    "[left, top, width, height] in pixels of the image",
    "check the image size the detector saw, and the order of the numbers",
    "error",
)
_BEYOND = _BoxFault(
    "box-beyond",
    f"the box reaches more than {OUTSIDE_TOLERANCE_PX:g} px out of the image",
    "a box within the image: true boxes end at its border",
    "clip the box to the image",
    "warning",
)


def _check_boxes(table: Detections, size_px: Floats, found: Findings) -> None:
    boxes = table.bbox_xywh_px
    known = np.asarray(np.isfinite(boxes).all(axis=1))
    if _tell_normalised(table, known, found):
        return
    low, high = boxes[:, :2], boxes[:, :2] + boxes[:, 2:]
    inverted = known & (boxes[:, 2:] < 0).any(axis=1)
    empty = known & ~inverted & (boxes[:, 2:] == 0).any(axis=1)
    outside = known & ~inverted & ((low >= size_px) | (high <= 0)).any(axis=1)
    outside &= np.isfinite(size_px).all(axis=1)
    reach = np.maximum(-low, high - size_px).max(axis=1)
    beyond = known & ~inverted & ~outside & (reach > OUTSIDE_TOLERANCE_PX)
    faults = ((_INVERTED, inverted), (_EMPTY, empty), (_OUTSIDE, outside), (_BEYOND, beyond))
    for fault, rows in faults:
        found.each(np.flatnonzero(rows), partial(_box_problem, table, size_px, fault))


def _tell_normalised(table: Detections, known: NDArray[np.bool_], found: Findings) -> bool:
    """Whether the boxes look like fractions of the image, which is told once."""
    largest = np.sort(np.abs(table.bbox_xywh_px[known]).max(axis=1))
    if not largest.any() or (middle := largest[len(largest) // 2]) > _LARGEST_NORMALISED:
        return False
    line, field = place_of(table, int(np.flatnonzero(known)[0]), "bbox")
    found.add(
        Problem(
            code="normalised-boxes",
            what="boxes look like fractions of the image; they must be in pixels",
            line=line,
            field=field,
            expected="[left, top, width, height] in pixels",
            got=f"numbers up to {middle:.3g} in half of {len(largest):,} boxes",
            fix="multiply by the width and the height of the image",
        )
    )
    return True


def _box_problem(table: Detections, size_px: Floats, fault: _BoxFault, row: int) -> Problem:
    line, field = place_of(table, row, "bbox")
    got = str(table.bbox_xywh_px[row].tolist())
    if fault in (_OUTSIDE, _BEYOND) and not np.isnan(size_px[row, 0]):
        got += " in {:.0f} x {:.0f} px".format(*size_px[row])
    return Problem(
        fault.code,
        fault.what,
        line=line,
        field=field,
        expected=fault.expected,
        got=got,
        fix=fault.fix,
        severity=fault.severity,
    )


def _check_masks(table: Detections, size_px: Floats, found: Findings) -> None:
    rows = np.flatnonzero(table.has_mask)
    if not len(rows):
        return
    masks = [mask for mask in table.segmentation if mask is not None]
    _check_runs(table, rows, masks, found)
    heights_widths = np.array([mask.size for mask in masks], np.float64)
    image = size_px[rows][:, ::-1]
    other_size = np.isfinite(image).all(axis=1) & (heights_widths != image).any(axis=1)

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


def _check_runs(
    table: Detections, rows: NDArray[np.intp], masks: list[Rle], found: Findings
) -> None:
    """Whether the counts of each mask add up to an image; ``rows`` are those of the masks."""
    runs = measure_runs(masks)
    pixels = np.array([float(mask.size[0]) * mask.size[1] for mask in masks])

    def bad(k: int) -> Problem:
        line, field = place_of(table, int(rows[k]), "segmentation")
        height, width = masks[k].size
        if np.isnan(runs.total[k]):
            what, got = "counts cannot be decoded", _shown_counts(masks[k])
            expected = "COCO's compressed string, or a list of integers"
            fix = "write what a COCO library's encode returns, decoded from bytes to text"
        elif runs.shortest[k] < 0:
            what, got = "counts contain negative runs", f"a run of {runs.shortest[k]:.0f}"
            expected, fix = "runs of 0 or more pixels", "write the mask again"
        else:
            what, got = "counts do not fill the image", f"{runs.total[k]:.0f}"
            expected = f"height x width = {height} x {width} = {pixels[k]:.0f} pixels"
            fix = "size is [height, width], and the runs go on to the last pixel"
        return Problem("bad-rle", what, line=line, field=field, expected=expected, got=got, fix=fix)

    # NaN, where the counts cannot be decoded, differs from everything.
    found.each(np.flatnonzero((runs.shortest < 0) | (runs.total != pixels)), bad)


def _shown_counts(mask: Rle) -> str:
    text = str(mask.counts)
    return repr(text if len(text) <= 40 else text[:40] + "...")


def _check_duplicates(table: Detections, found: Findings) -> None:
    rows = np.flatnonzero(table.has_bbox)
    ids = (table.scene_id[rows], table.im_id[rows], table.obj_id[rows])
    (group,) = row_codes((*ids, *table.bbox_xywh_px[rows].T))
    original = rows[first_with_code(group)[group]]
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
