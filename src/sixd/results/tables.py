"""Results as columns: 6D pose estimates, and 2D detections and segmentations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import chain
from typing import Annotated, Any, ClassVar, Self

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from sixd.errors import ShapeError
from sixd.geometry.pose import Pose

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

INT64 = range(-(2**63), 2**63)
Int64 = Annotated[int, msgspec.Meta(ge=INT64.start, le=INT64.stop - 1)]
_Size = Annotated[int, msgspec.Meta(ge=0, le=2**31 - 1)]


class Rle(msgspec.Struct, frozen=True, gc=False):
    """A mask as run lengths, column by column, beginning with the background (COCO)."""

    size: tuple[_Size, _Size]
    """``(height, width)``, pixels."""
    counts: str | list[Int64]
    """Run lengths: COCO's compressed string, or plain numbers."""

    def as_coco(self) -> dict[str, Any]:
        """The dict ``{"size": [h, w], "counts": ...}`` that COCO libraries take."""
        return {"size": list(self.size), "counts": self.counts}


_INTEGERS = ("scene_id", "im_id", "obj_id", "line", "entry")


class _Columns:
    """What both tables can do: be counted, filtered and joined, row by row."""

    _shape_of_row: ClassVar[dict[str, tuple[int, ...]]] = {}
    scene_id: Ints

    def __len__(self) -> int:
        return len(self.scene_id)

    def where(self, rows: Bools | NDArray[np.intp] | slice) -> Self:
        """Some rows: a boolean mask ``(N,)``, indices, or a slice."""
        taken: dict[str, Any] = {}
        for name, column in self._columns():
            if isinstance(column, tuple):
                taken[name] = tuple(column[i] for i in np.arange(len(column))[rows])
            else:
                taken[name] = None if column is None else column[rows]
        return type(self)(**taken)

    @classmethod
    def concatenate(cls, tables: Sequence[Self]) -> Self:
        """Rows of all tables, in order; line numbers stay only if all tables have them.

        Raises:
            ShapeError: there is no table.
        """
        if not tables:
            raise ShapeError(f"{cls.__name__}.concatenate needs at least one table")
        joined: dict[str, Any] = {}
        for name, first in tables[0]._columns():
            columns = [getattr(table, name) for table in tables]
            if isinstance(first, tuple):
                joined[name] = tuple(chain.from_iterable(columns))
            else:
                has_all = all(column is not None for column in columns)
                joined[name] = np.concatenate(columns) if has_all else None
        return cls(**joined)

    def _columns(self) -> list[tuple[str, Any]]:
        return [(f.name, getattr(self, f.name)) for f in fields(self)]  # type: ignore[arg-type]

    def __post_init__(self) -> None:
        n = len(self.scene_id)
        for name, column in self._columns():
            if column is None or (isinstance(column, tuple) and len(column) == n):
                continue
            shape = (n, *self._shape_of_row.get(name, ()))
            dtype = np.int64 if name in _INTEGERS else np.float64
            got = (getattr(column, "shape", None), getattr(column, "dtype", type(column)))
            if got != (shape, dtype):
                raise ShapeError(
                    f"{type(self).__name__}.{name} must be of shape {shape} and type "
                    f"{dtype.__name__}, got {got[0]} of {got[1]}; from_arrays converts"
                )


@dataclass(frozen=True, eq=False)
class PoseEstimates(_Columns):
    """6D pose estimates, one row each, in the order of their file.

    Raises:
        ShapeError: a column has the wrong shape or type.
    """

    _shape_of_row: ClassVar = {"R": (3, 3), "t_mm": (3,)}

    scene_id: Ints
    im_id: Ints
    obj_id: Ints
    score: Floats
    """``(N,)``, higher is surer."""
    R: Floats
    """``(N, 3, 3)``, model to camera."""
    t_mm: Floats
    """``(N, 3)``, model to camera, millimetres."""
    time_s: Floats
    """``(N,)`` seconds spent on the whole image; NaN where the file has none (BOP writes -1)."""
    line: Ints | None = None
    """``(N,)`` line of the file each row was read from; None for a table made in memory."""

    @classmethod
    def from_arrays(
        cls,
        *,
        scene_id: ArrayLike,
        im_id: ArrayLike,
        obj_id: ArrayLike,
        score: ArrayLike,
        R: ArrayLike,
        t_mm: ArrayLike,
        time_s: ArrayLike = np.nan,
    ) -> PoseEstimates:
        """Build a table from anything NumPy understands, as a training loop has it.

        Args:
            scene_id: ``(N,)`` integers, or one for all rows.
            im_id: likewise.
            obj_id: likewise.
            score: ``(N,)``, or one for all rows; higher is surer.
            R: ``(N, 3, 3)`` or ``(N, 9)`` row-major, model to camera.
            t_mm: ``(N, 3)``, model to camera, millimetres.
            time_s: seconds spent on the image; NaN or negative where not measured.

        Raises:
            ShapeError: the columns do not go together.
        """
        t_mm = np.array(t_mm, dtype=np.float64)
        n = len(t_mm) if t_mm.ndim else 0
        return cls(
            scene_id=_ids("scene_id", scene_id, n),
            im_id=_ids("im_id", im_id, n),
            obj_id=_ids("obj_id", obj_id, n),
            score=_numbers("score", score, n),
            R=_blocks("R", R, (n, 3, 3)),
            t_mm=_blocks("t_mm", t_mm, (n, 3)),
            time_s=times_of_file(_numbers("time_s", time_s, n)),
        )

    @property
    def pose_c_m(self) -> Pose:
        """The poses, model to camera, ``(N,)``."""
        return Pose(self.R, self.t_mm)


@dataclass(frozen=True, eq=False)
class Detections(_Columns):
    """2D detections and segmentations, one row each, in the order of their file.

    Raises:
        ShapeError: a column has the wrong shape or type.
    """

    _shape_of_row: ClassVar = {"bbox_xywh_px": (4,)}

    scene_id: Ints
    im_id: Ints
    obj_id: Ints
    """``category_id`` of the file."""
    score: Floats
    """``(N,)``, higher is surer."""
    bbox_xywh_px: Floats
    """``(N, 4)``: left, top, width, height; a row of NaN where the file has none."""
    segmentation: tuple[Rle | None, ...]
    """``(N,)``: a mask or None for each row."""
    time_s: Floats
    """``(N,)`` seconds spent on the whole image; NaN where the file has none."""
    line: Ints | None = None
    """``(N,)`` line of the file on which each entry begins; None for a table made in memory."""
    entry: Ints | None = None
    """``(N,)`` index of each entry in the file's list, from 0; None likewise."""

    @classmethod
    def from_arrays(
        cls,
        *,
        scene_id: ArrayLike,
        im_id: ArrayLike,
        obj_id: ArrayLike,
        score: ArrayLike,
        bbox_xywh_px: ArrayLike | None = None,
        segmentation: Sequence[Rle | None] | None = None,
        time_s: ArrayLike = np.nan,
    ) -> Detections:
        """Build a table from anything NumPy understands, as a training loop has it.

        Args:
            scene_id: ``(N,)`` integers, or one for all rows.
            im_id: likewise.
            obj_id: ``(N,)`` integers: the category.
            score: ``(N,)``, or one for all rows; higher is surer.
            bbox_xywh_px: ``(N, 4)``: left, top, width, height.
            segmentation: a mask or None for each row.
            time_s: seconds spent on the image; NaN or negative where not measured.

        Raises:
            ShapeError: the columns do not go together.
        """
        n = np.asarray(obj_id).size
        boxes = np.full((n, 4), np.nan) if bbox_xywh_px is None else bbox_xywh_px
        return cls(
            scene_id=_ids("scene_id", scene_id, n),
            im_id=_ids("im_id", im_id, n),
            obj_id=_ids("obj_id", obj_id, n),
            score=_numbers("score", score, n),
            bbox_xywh_px=_blocks("bbox_xywh_px", boxes, (n, 4)),
            segmentation=(None,) * n if segmentation is None else tuple(segmentation),
            time_s=times_of_file(_numbers("time_s", time_s, n)),
        )

    @property
    def has_bbox(self) -> Bools:
        """``(N,)``: which rows have a box."""
        return np.logical_not(np.isnan(self.bbox_xywh_px).any(axis=1))

    @property
    def has_mask(self) -> Bools:
        """``(N,)``: which rows have a mask."""
        return np.fromiter((mask is not None for mask in self.segmentation), bool, len(self))


Table = PoseEstimates | Detections


def times_of_file(time_s: Floats) -> Floats:
    """NaN for every negative time: BOP files write -1 for "not measured"."""
    return np.where(time_s < 0, np.nan, time_s)


def _ids(name: str, values: ArrayLike, n: int) -> Ints:
    column = np.asarray(values)
    if column.size and column.dtype.kind not in "iu":
        raise ShapeError(f"{name} must hold integers, got {column.dtype}")
    return _one_each(name, column, n).astype(np.int64)


def _numbers(name: str, values: ArrayLike, n: int) -> Floats:
    return _one_each(name, np.asarray(values, dtype=np.float64), n).copy()


def _one_each(name: str, column: NDArray[Any], n: int) -> NDArray[Any]:
    if column.ndim and column.shape != (n,):
        raise ShapeError(f"{name} must have shape ({n},) or be one number, got {column.shape}")
    return np.broadcast_to(column, (n,))


def _blocks(name: str, values: ArrayLike, shape: tuple[int, ...]) -> Floats:
    array = np.array(values, dtype=np.float64)
    flat = (shape[0], int(np.prod(shape[1:])))
    if array.shape not in (shape, flat) and array.size + shape[0]:
        raise ShapeError(f"{name} must have shape {shape}, got {array.shape}")
    return array.reshape(shape)
