"""2D detections and segmentations as COCO's results JSON, read and written bit for bit.

The file is one list of ``{"scene_id", "image_id", "category_id", "score", "bbox", "segmentation",
"time"}``; a detection has ``bbox`` (left, top, width, height), a segmentation has a run-length
coded mask, ``time`` may be left out.

A typed decoder reads what is plain. What it refuses goes entry by entry through
`sixd.results.coco_entries`, which defines the format.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from sixd.errors import FormatError, Problem
from sixd.results.coco_entries import NO_BBOX, Entry, read_entries_slowly
from sixd.results.findings import Findings
from sixd.results.limits import Limits
from sixd.results.pose_csv import refuse_rows, too_many_rows
from sixd.results.pose_csv_rows import bad_encoding
from sixd.results.results_text import ResultsText, read_table
from sixd.results.tables import Detections, times_of_file
from sixd.results.text_writing import write_results_text

_ENTRIES = msgspec.json.Decoder(list[Entry])
_RAW_ENTRIES = msgspec.json.Decoder(list[msgspec.Raw])


def read_coco_json(path: str | Path, *, limits: Limits | None = None) -> Detections:
    """Read a COCO results JSON, plain or gzipped, whatever its name.

    Raises:
        FormatError: carries every unreadable field, with what was expected and what came.
        MissingDataError: there is no such file.
    """
    return read_table(path, limits, parse_coco_json)


def write_coco_json(path: str | Path, detections: Detections) -> None:
    """Write a COCO results JSON, atomically, one entry a line; gzipped if named ``.gz``.

    Numbers are written with the fewest digits that read back to the same bits.

    Raises:
        UsageError: a score or box is not finite; nothing is written.
        OutputError: the file cannot be written.
    """
    boxes = detections.bbox_xywh_px
    refuse_rows(path, "score", ~np.isfinite(detections.score))
    refuse_rows(path, "bbox", ~np.isfinite(boxes).all(axis=1) & ~np.isnan(boxes).all(axis=1))
    refuse_rows(path, "time_s", np.isinf(detections.time_s))
    entries = b",\n".join(_written_entries(detections))
    write_results_text(path, b"[\n" + entries + b"\n]\n" if entries else b"[]\n")


def parse_coco_json(source: ResultsText, found: Findings, limits: Limits) -> Detections:
    """Read all entries; what is unreadable goes to ``found``.

    An entry whose ids can be read is kept, with NaN for each number that cannot; the table is of
    use only if ``found`` has no errors.

    Raises:
        FormatError: the text is that of another kind, truncated or too large.
    """
    if source.kind != "coco-json":
        raise FormatError([_not_json(source.kind)])
    data = b"".join(source.blocks)
    try:
        text = data.decode()
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        found.stop(FormatError([bad_encoding(error, source.first_byte, line)]))
        return _table([], np.zeros((0, 2), np.int64))
    try:
        entries = _ENTRIES.decode(data)
        places = _places_of_entries(data)
    except (msgspec.MsgspecError, RecursionError):
        entries, places = read_entries_slowly(text, found, limits)
    if len(entries) > limits.rows:
        found.stop(FormatError([too_many_rows(limits, int(places[limits.rows, 0]))]))
    return _table(entries, places)


def _places_of_entries(data: bytes) -> NDArray[np.int64]:
    """``(N, 2)``: line on which each entry of a valid file begins, and its index in the list."""
    newlines = np.flatnonzero(np.frombuffer(data, np.uint8) == ord("\n"))
    begins: list[int] = []
    end = 0
    for raw in _RAW_ENTRIES.decode(data):
        begin = data.index(b"{", end)  # between entries there are only blanks and commas
        begins.append(begin)
        end = begin + len(memoryview(raw))
    lines = np.searchsorted(newlines, np.array(begins, np.int64)) + 1
    return np.column_stack([lines, np.arange(len(lines))])


def _table(entries: list[Entry], places: NDArray[np.int64]) -> Detections:
    n = len(entries)
    boxes = np.array([e.bbox or NO_BBOX for e in entries], np.float64).reshape(n, 4)
    times = np.array([np.nan if e.time is None else e.time for e in entries], np.float64)
    return Detections(
        scene_id=np.fromiter((e.scene_id for e in entries), np.int64, n),
        im_id=np.fromiter((e.image_id for e in entries), np.int64, n),
        obj_id=np.fromiter((e.category_id for e in entries), np.int64, n),
        score=np.fromiter((e.score for e in entries), np.float64, n),
        bbox_xywh_px=boxes,
        segmentation=tuple([e.segmentation for e in entries]),
        time_s=times_of_file(times),
        line=places[:, 0].copy(),
        entry=places[:, 1].copy(),
    )


def _written_entries(detections: Detections) -> Iterator[bytes]:
    columns = zip(
        detections.scene_id.tolist(),
        detections.im_id.tolist(),
        detections.obj_id.tolist(),
        detections.score.tolist(),
        detections.bbox_xywh_px.tolist(),
        detections.has_bbox.tolist(),
        detections.segmentation,
        detections.time_s.tolist(),
        strict=True,
    )
    for scene_id, im_id, obj_id, score, bbox, has_bbox, segmentation, time in columns:
        yield msgspec.json.encode(
            Entry(
                scene_id=scene_id,
                image_id=im_id,
                category_id=obj_id,
                score=score,
                bbox=tuple(bbox) if has_bbox else None,
                segmentation=segmentation,
                time=None if time != time else time,
            )
        )


def _not_json(kind: str) -> Problem:
    return Problem(
        code="wrong-kind",
        what="the file is not a COCO results JSON",
        expected="a list of detections",
        got=kind,
        fix="read it with read_pose_csv, or let read_results choose",
    )
