"""What may be wrong with poses that can be read: no rotation, metres, behind the camera, twice."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sixd.errors import Problem
from sixd.results.findings import Findings
from sixd.results.row_places import other_place, place_of
from sixd.results.tables import Floats, PoseEstimates
from sixd.rows import first_with_code, row_codes

EXACT_ROTATION_ERROR = 1e-3
"""max|R R^T - I| up to which nothing is said. Numbers of float32 or with 4 digits stay below."""
ROTATION_TOLERANCE = 0.02
"""Above, a matrix is no rotation; below, a warning: official truth of BOP reaches 0.0096."""
MENDABLE_ROTATION_ERROR = 0.05
"""Below, ``--fix`` puts the nearest rotation in; no entry of R changes by more than 0.08."""
NEAREST_MM = 20.0
"""An object nearer than this (2 cm, or 20 m taken for millimetres) is not in its right unit."""
_SAME_SCALE = 0.02


def check_poses(table: PoseEstimates, found: Findings) -> None:
    """Look at each pose, and at all together for a wrong unit."""
    _check_rotations(table, found)
    _check_translations(table, found)
    _check_duplicates(table, found)


def orthogonality_error(R: Floats) -> Floats:
    """``max |R R^T - I|`` of each matrix ``(N, 3, 3)``: 0 for rotations and reflections."""
    gaps = np.abs(R @ np.swapaxes(R, -1, -2) - np.eye(3))
    error: Floats = gaps.max(axis=(-2, -1), initial=0)
    return error


def determinant(R: Floats) -> Floats:
    """Determinant of each matrix ``(N, 3, 3)``."""
    a, b, c = R[:, 0], R[:, 1], R[:, 2]
    det: Floats = (
        a[:, 0] * (b[:, 1] * c[:, 2] - b[:, 2] * c[:, 1])
        - a[:, 1] * (b[:, 0] * c[:, 2] - b[:, 2] * c[:, 0])
        + a[:, 2] * (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0])
    )
    return det


def _check_rotations(table: PoseEstimates, found: Findings) -> None:
    with np.errstate(over="ignore", invalid="ignore"):
        error = orthogonality_error(table.R)
        det = determinant(table.R)
    known = np.isfinite(table.R).all(axis=(1, 2))
    is_orthogonal = error <= ROTATION_TOLERANCE  # False where it overflowed

    def problem(row: int, code: str, what: str, fix: str = "") -> Problem:
        line, field = place_of(table, row, "R")
        return Problem(
            code=code,
            what=what,
            line=line,
            field=field,
            expected="det 1 and max|R R^T - I| near 0",
            got=f"det {det[row]:.6g}, max|R R^T - I| {error[row]:.3g}",
            fix=fix or _mend_rotation(table.R[row], float(error[row]), float(det[row])),
            severity="warning" if code == "inexact-rotation" else "error",
        )

    found.each(
        np.flatnonzero(known & ~is_orthogonal),
        lambda row: problem(row, "not-a-rotation", "R is not a rotation matrix"),
    )
    found.each(
        np.flatnonzero(known & is_orthogonal & (det < 0)),
        lambda row: problem(
            row,
            "reflection",
            "R is a reflection: it turns the object inside out",
            "look for a flipped axis or a left-handed frame; this cannot be mended here",
        ),
    )
    found.each(
        np.flatnonzero(known & is_orthogonal & (det > 0) & (error > EXACT_ROTATION_ERROR)),
        lambda row: problem(row, "inexact-rotation", "R is not quite a rotation matrix"),
    )


def _mend_rotation(R: Floats, error: float, det: float) -> str:
    if error < MENDABLE_ROTATION_ERROR and det > 0:
        return "sixd check --fix OUT puts the nearest rotation in its place"
    if not R.any():
        return "leave out estimates that do not exist"
    scale = float(np.cbrt(abs(det))) if np.isfinite(det) else 0.0
    if scale > 0 and orthogonality_error(R[None] / scale)[0] < _SAME_SCALE:
        return "R contains a scale: divide its columns by their length"
    return "write the nine numbers of the rotation row by row"


def _check_translations(table: PoseEstimates, found: Findings) -> None:
    with np.errstate(over="ignore", invalid="ignore"):
        distance_mm = np.linalg.norm(table.t_mm, axis=1)
    known = np.asarray(np.isfinite(table.t_mm).all(axis=1))
    if _tell_metres(table, distance_mm, known, found):
        return

    def near(row: int) -> Problem:
        line, field = place_of(table, row, "t")
        return Problem(
            code="near-camera",
            what="the object is within 2 cm of the camera; is t in millimetres?",
            line=line,
            field=field,
            expected=f"farther than {NEAREST_MM:g} mm",
            got=f"{distance_mm[row]:.4g} mm",
            fix="check this estimate",
            severity="warning",
        )

    def behind(row: int) -> Problem:
        line, field = place_of(table, row, "t")
        return Problem(
            code="behind-camera",
            what="the object's origin is not in front of the camera",
            line=line,
            field=field,
            expected="z > 0 (x right, y down, z forward)",
            got=f"z = {table.t_mm[row, 2]:.6g} mm",
            fix="check the camera frame: OpenGL's z points backward",
            severity="warning",
        )

    is_near = known & (distance_mm < NEAREST_MM)
    found.each(np.flatnonzero(is_near), near)
    found.each(np.flatnonzero(known & ~is_near & (table.t_mm[:, 2] <= 0)), behind)


def _tell_metres(
    table: PoseEstimates, distance_mm: Floats, known: NDArray[np.bool_], found: Findings
) -> bool:
    """Whether the middle distance looks like metres, which is told once."""
    distances = np.sort(distance_mm[known])
    if not len(distances) or not 0 < (middle := distances[len(distances) // 2]) < NEAREST_MM:
        return False
    line, field = place_of(table, int(np.flatnonzero(known)[0]), "t")
    found.add(
        Problem(
            code="metres",
            what="t looks like metres; it must be in millimetres",
            line=line,
            field=field,
            expected=f"objects farther than {NEAREST_MM:g} mm from the camera",
            got=f"median distance {middle:.4g} in {len(distances):,} rows",
            fix="multiply t by 1000 where the file is written",
        )
    )
    return True


def _check_duplicates(table: PoseEstimates, found: Findings) -> None:
    ids = (table.scene_id, table.im_id, table.obj_id)
    (group,) = row_codes((*ids, table.t_mm[:, 0]))
    suspects = np.flatnonzero(np.bincount(group, minlength=1)[group] > 1)
    numbers = np.column_stack([table.t_mm, table.R.reshape(-1, 9)])[suspects]
    (group,) = row_codes((*(column[suspects] for column in ids), *numbers.T))
    original = suspects[first_with_code(group)[group]]
    copies = np.flatnonzero(original != suspects)
    found.each(copies, lambda k: _duplicate(table, int(suspects[k]), int(original[k])))


def _duplicate(table: PoseEstimates, row: int, original: int) -> Problem:
    line, field = place_of(table, row, "R, t")
    return Problem(
        code="duplicate",
        what="the same pose of the same object in the same image, again",
        line=line,
        field=field,
        expected="each pose once; a second one is a false positive",
        got=f"the pose of {other_place(table, original)}",
        fix="keep the one with the higher score",
        severity="warning",
    )
