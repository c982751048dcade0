"""Symmetries of an object, and their discretised sets as BOP evaluates them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from sixd.errors import FormatError, Problem, UsageError, check_shape
from sixd.geometry.pose import Floats, Pose, rotations_about

# models_info.json is written by hand, often with few digits; beyond this it is a mistake.
_ROTATION_TOLERANCE = 1e-2


@dataclass(frozen=True, eq=False)
class SymmetryAxis:
    """A line about which the model may be turned by any angle."""

    axis: Floats
    """``(3,)`` direction in the model frame, any length but zero."""
    offset_mm: Floats
    """``(3,)`` a point of the line, model frame."""

    def __post_init__(self) -> None:
        check_shape("SymmetryAxis.axis", self.axis, (3,))
        check_shape("SymmetryAxis.offset_mm", self.offset_mm, (3,))
        if not np.linalg.norm(self.axis) > 0:
            raise UsageError("SymmetryAxis.axis must not be the zero vector: it has no direction")

    def rotations(self, count: int) -> Pose:
        """``count`` turns by ``i * 2 pi / count``, the first by zero; batch shape ``(count,)``."""
        angles_rad = np.arange(count, dtype=np.float64) * (2.0 * np.pi / count)
        R = rotations_about(self.axis, angles_rad)
        return Pose(R, self.offset_mm - R @ self.offset_mm)


@dataclass(frozen=True, eq=False)
class Symmetries:
    """All symmetries of one object."""

    discrete: Pose = field(default_factory=lambda: Pose.identity(0))
    """Batch shape ``(D,)``, model to model, without the identity."""
    axes: tuple[SymmetryAxis, ...] = ()

    def transforms(self, max_step: float = 0.01) -> Pose:
        """The discretised set, batch shape ``(S,)``; the identity comes first.

        Several axes are concatenated, not composed; every discrete symmetry (and the identity)
        is followed by every rotation of every axis. Order and counts: BOP rules
        (``max_sym_disc_step``).

        Args:
            max_step: the longest way of any vertex between two rotations, over the diameter.
        """
        if not 0 < max_step <= math.pi:
            raise UsageError(f"max_step must be in (0, pi], got {max_step}")
        identity = Pose.identity(1)
        listed = _stack([identity, self.discrete])
        if not self.axes:
            return listed
        turns = _stack([axis.rotations(math.ceil(math.pi / max_step)) for axis in self.axes])
        # turn @ discrete, the discrete one in the outer loop.
        every = turns[None, :] @ listed[:, None]
        return Pose(every.R.reshape(-1, 3, 3), every.t_mm.reshape(-1, 3))

    @classmethod
    def from_models_info(cls, entry: Mapping[str, Any], *, file: str = "") -> Symmetries:
        """Read ``symmetries_discrete`` and ``symmetries_continuous`` of one models_info entry.

        Args:
            entry: the decoded JSON object of one model; absent keys mean no symmetry.
            file: where it was read, for messages.

        Raises:
            FormatError: all entries that are not 16 numbers of a rigid transform, or not an axis.
        """
        problems: list[Problem] = []
        matrices = [
            _matrix(item, f"symmetries_discrete[{i}]", file, problems)
            for i, item in enumerate(_items(entry, "symmetries_discrete", file, problems))
        ]
        axes = [
            _axis(item, f"symmetries_continuous[{i}]", file, problems)
            for i, item in enumerate(_items(entry, "symmetries_continuous", file, problems))
        ]
        if problems:
            raise FormatError(problems)
        stacked = np.array(matrices, np.float64).reshape(-1, 4, 4)
        discrete = Pose(stacked[:, :3, :3].copy(), stacked[:, :3, 3].copy())
        return cls(discrete, tuple(axis for axis in axes if axis is not None))

    def to_models_info(self) -> dict[str, Any]:
        """The two keys of a models_info entry; a kind that is absent has no key."""
        matrices = np.tile(np.eye(4), (len(self.discrete), 1, 1))
        matrices[:, :3, :3], matrices[:, :3, 3] = self.discrete.R, self.discrete.t_mm
        axes = [{"axis": a.axis.tolist(), "offset": a.offset_mm.tolist()} for a in self.axes]
        entry: dict[str, Any] = {}
        if len(matrices):
            entry["symmetries_discrete"] = matrices.reshape(-1, 16).tolist()
        if axes:
            entry["symmetries_continuous"] = axes
        return entry


def _stack(poses: list[Pose]) -> Pose:
    return Pose(np.concatenate([p.R for p in poses]), np.concatenate([p.t_mm for p in poses]))


def _items(entry: Mapping[str, Any], key: str, file: str, problems: list[Problem]) -> list[Any]:
    items = entry.get(key, [])
    if isinstance(items, list):
        return items
    problems.append(_problem(file, key, "not a list", "a list", repr(items)[:120]))
    return []


def _matrix(item: Any, where: str, file: str, problems: list[Problem]) -> Floats:
    values = _floats(item, 16)
    if values is None:
        problems.append(
            _problem(
                file, where, "not a 4x4 matrix", "16 finite numbers, row by row", repr(item)[:200]
            )
        )
        return np.eye(4)
    matrix = values.reshape(4, 4)
    R = matrix[:3, :3]
    defect = np.abs(R @ R.T - np.eye(3)).max()
    if defect > _ROTATION_TOLERANCE or np.linalg.det(R) < 0 or matrix[3].tolist() != [0, 0, 0, 1]:
        got = f"det {np.linalg.det(R):.3f}, |R R^T - I| {defect:.3g}, last row {matrix[3].tolist()}"
        expected = "a rotation (det 1), translation in the fourth column, last row 0 0 0 1"
        problems.append(_problem(file, where, "not a rigid transform", expected, got))
    return matrix


def _axis(item: Any, where: str, file: str, problems: list[Problem]) -> SymmetryAxis | None:
    known = item if isinstance(item, Mapping) else {}
    axis, offset = _floats(known.get("axis"), 3), _floats(known.get("offset"), 3)
    if axis is None or offset is None or not np.linalg.norm(axis) > 0:
        expected = '{"axis": [x, y, z], "offset": [x, y, z]}, axis not zero'
        problems.append(_problem(file, where, "not an axis", expected, repr(item)[:200]))
        return None
    return SymmetryAxis(axis, offset)


def _floats(values: Any, count: int) -> Floats | None:
    try:
        array = np.asarray(values, np.float64).ravel()
    except (TypeError, ValueError):
        return None
    return array if len(array) == count and np.isfinite(array).all() else None


def _problem(file: str, where: str, what: str, expected: str, got: str) -> Problem:
    fix = "see the BOP format of models_info.json"
    return Problem(
        "bad-symmetry", what, file=file, field=where, expected=expected, got=got, fix=fix
    )
