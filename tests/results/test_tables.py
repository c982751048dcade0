from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given

from sixd.errors import ShapeError
from sixd.results import Detections, PoseEstimates, Rle
from tests.results.makers import bits, detection_tables, pose_tables, random_rotations


@given(pose_tables())
def test_a_table_is_the_concatenation_of_its_parts(table: PoseEstimates) -> None:
    parts = [table.where(slice(0, 2)), table.where(slice(2, None))]
    assert bits(PoseEstimates.concatenate(parts)) == bits(table)


@given(detection_tables())
def test_mask_indices_and_slice_select_the_same_rows(table: Detections) -> None:
    every_second = np.arange(len(table)) % 2 == 0
    by_mask = bits(table.where(every_second))
    assert by_mask == bits(table.where(np.flatnonzero(every_second)))
    assert by_mask == bits(table.where(slice(None, None, 2)))


def test_a_training_loop_gives_arrays_of_any_kind() -> None:
    table = PoseEstimates.from_arrays(
        scene_id=2,
        im_id=[1, 1, 2],
        obj_id=np.array([5, 6, 5], np.int32),
        score=np.ones(3, np.float32),
        R=random_rotations(3).astype(np.float32),
        t_mm=[[0, 0, 500.0]] * 3,
        time_s=[0.5, 0.5, -1],
    )
    assert len(table) == len(table.pose_c_m) == 3
    assert table.scene_id.tolist() == [2, 2, 2]
    assert table.R.dtype == np.float64
    assert np.isnan(table.time_s).tolist() == [False, False, True]


def test_arrays_that_are_given_are_not_shared() -> None:
    t_mm = np.full((2, 3), 500.0)
    table = PoseEstimates.from_arrays(
        scene_id=1, im_id=1, obj_id=1, score=1, R=[np.eye(3)] * 2, t_mm=t_mm
    )
    t_mm[:] = 0
    assert (table.t_mm == 500).all()


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"score": [1.0]}, r"score must have shape \(2,\)"),
        ({"obj_id": [1.5, 2.0]}, "obj_id must hold integers"),
        ({"R": np.eye(3)}, r"R must have shape \(2, 3, 3\)"),
        ({"t_mm": np.zeros((2, 4))}, r"t_mm must have shape \(2, 3\)"),
        ({"t_mm": np.zeros((3, 2))}, "shape"),
    ],
)
def test_columns_that_do_not_go_together_are_refused(wrong: dict, message: str) -> None:
    right = {"scene_id": 1, "im_id": 1, "obj_id": 1, "score": 1.0}
    right |= {"R": [np.eye(3)] * 2, "t_mm": np.zeros((2, 3))}
    with pytest.raises(ShapeError, match=message):
        PoseEstimates.from_arrays(**(right | wrong))


def test_the_constructor_takes_exact_types_only() -> None:
    n = np.zeros(1, np.int64)
    x = np.zeros(1)
    with pytest.raises(ShapeError, match=r"obj_id must be of shape \(1,\) and type int64"):
        PoseEstimates(n, n, x, x, np.zeros((1, 3, 3)), np.zeros((1, 3)), x)  # type: ignore[arg-type]
    with pytest.raises(ShapeError, match="segmentation"):
        Detections(n, n, n, x, np.zeros((1, 4)), (None, None), x)


def test_detections_know_which_rows_have_a_box_and_which_a_mask() -> None:
    mask = Rle((2, 2), [4])
    table = Detections.from_arrays(
        scene_id=1,
        im_id=1,
        obj_id=[1, 2],
        score=1,
        bbox_xywh_px=[[0, 0, 1, 1], [np.nan] * 4],
        segmentation=[None, mask],
    )
    assert table.has_bbox.tolist() == [True, False]
    assert table.has_mask.tolist() == [False, True]
    assert mask.as_coco() == {"size": [2, 2], "counts": [4]}


def test_nothing_cannot_be_concatenated() -> None:
    with pytest.raises(ShapeError):
        PoseEstimates.concatenate([])
