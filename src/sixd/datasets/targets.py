"""Target lists: which images, and of which objects how many instances, are to be found.

All of BOP's lists are read: ``test_targets_bop18.json`` and ``bop19`` (image, object, count),
``bop24`` (images only) and ``multiview_bop25`` (groups of views).
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

from sixd.datasets.jsonfiles import Id, read_json
from sixd.errors import FormatError, Problem
from sixd.rows import first_of_each

Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Targets:
    """One row for each target, in the order of the file."""

    scene_id: Ints
    """``(N,)``"""
    im_id: Ints
    """``(N,)``"""
    obj_id: Ints | None = None
    """``(N,)``; None for a list of images."""
    inst_count: Ints | None = None
    """``(N,)`` instances to be found; None for a list of images."""
    group: Ints | None = None
    """``(N,)`` number of the entry a view belongs to; None but for a multi-view list."""
    sensor: tuple[str, ...] | None = None
    """Sensor of each view; None but for a multi-view list that names them."""
    file: str = ""

    def __len__(self) -> int:
        return len(self.scene_id)

    @property
    def images(self) -> Ints:
        """``(M, 2)`` distinct pairs of scene and image, in the order of their first target."""
        first = first_of_each((self.scene_id, self.im_id))
        return np.stack([self.scene_id[first], self.im_id[first]], axis=1)

    def where(self, rows: NDArray[np.bool_]) -> Targets:
        """Some rows, by a mask ``(N,)``."""
        kept = {c: getattr(self, c) for c in ("obj_id", "inst_count", "group")}
        names = self.sensor
        return Targets(
            self.scene_id[rows],
            self.im_id[rows],
            **{name: None if column is None else column[rows] for name, column in kept.items()},
            sensor=None if names is None else tuple(names[i] for i in np.flatnonzero(rows)),
            file=self.file,
        )

    def of_image(self, scene_id: int, im_id: int) -> tuple[tuple[int, int | None], ...]:
        """Object and count of each target of an image; none for a list of images."""
        if self.obj_id is None:
            return ()
        rows = np.flatnonzero((self.scene_id == scene_id) & (self.im_id == im_id))
        counts = self.inst_count
        return tuple(
            (int(self.obj_id[r]), None if counts is None else int(counts[r])) for r in rows
        )


class _View(msgspec.Struct, array_like=True, forbid_unknown_fields=True):
    sensor: str
    im_id: Id


class _Target(msgspec.Struct):
    scene_id: Id
    im_id: Id | Annotated[list[_View], msgspec.Meta(min_length=1)]
    obj_id: Id | None = None
    inst_count: Id | None = None


def read_targets(path: Path) -> Targets:
    """Read a target list; fields it has beyond the known ones are ignored.

    Raises:
        MissingDataError: there is no such file.
        FormatError: it is not such a list, mixes two kinds, is empty, or lists a target twice.
    """
    entries = read_json(path, list[_Target], advice="give the list to use, or restore the file")
    problems = _check(entries, path)
    if problems:
        raise FormatError(problems)
    if isinstance(entries[0].im_id, list):
        return _multiview(entries, path)
    counts = [e.inst_count for e in entries]
    return Targets(
        scene_id=np.array([e.scene_id for e in entries], np.int64),
        im_id=np.array([e.im_id for e in entries], np.int64),
        obj_id=_column([e.obj_id for e in entries]),
        inst_count=_column(counts),
        file=path.name,
    )


def _multiview(entries: list[_Target], path: Path) -> Targets:
    rows = [
        (e.scene_id, view.im_id, group, view.sensor)
        for group, e in enumerate(entries)
        for view in (e.im_id if isinstance(e.im_id, list) else [])
    ]
    scene_id, im_id, group, sensor = zip(*rows, strict=True)
    return Targets(
        scene_id=np.array(scene_id, np.int64),
        im_id=np.array(im_id, np.int64),
        group=np.array(group, np.int64),
        sensor=sensor,
        file=path.name,
    )


def _column(values: list[int | None]) -> Ints | None:
    return None if values[0] is None else np.array(values, np.int64)


def _check(entries: list[_Target], path: Path) -> list[Problem]:
    def problem(code: str, what: str, field: str = "", fix: str = "", got: str = "") -> Problem:
        return Problem(code, what, file=str(path), field=field, fix=fix, got=got)

    if not entries:
        return [problem("no-targets", "lists no targets", fix="restore the file")]
    found = []
    for name, kind in (("obj_id", "an object"), ("inst_count", "a count"), ("im_id", "views")):
        has = [
            isinstance(e.im_id, list) if name == "im_id" else getattr(e, name) is not None
            for e in entries
        ]
        if any(has) and not all(has):
            row = has.index(not has[0])
            what = f"mixes entries with and without {kind}"
            found.append(problem("mixed-targets", what, f"$[{row}].{name}"))
    if found or isinstance(entries[0].im_id, list):
        return found
    times = Counter((e.scene_id, e.im_id, e.obj_id) for e in entries)
    for (scene_id, im_id, obj_id), n in times.items():
        if n > 1:
            target = f"scene {scene_id}, image {im_id}" + (
                "" if obj_id is None else f", object {obj_id}"
            )
            fix = "list it once, with the whole inst_count"
            found.append(problem("repeated-target", f"lists {target} {n} times", fix=fix))
    return found
