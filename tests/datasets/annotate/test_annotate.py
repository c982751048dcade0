from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from sixd.datasets.annotate.coco import coco_annotation, coco_file
from sixd.datasets.annotate.gt_info import canvas_camera, measure_instance, span_box_px
from sixd.datasets.annotate.rle import decode_rle, encode_rle
from sixd.errors import FormatError
from sixd.render.visibility import distance_image_mm, visible_mask

K = np.array([[50.0, 0, 8.0], [0, 50.0, 6.0], [0, 0, 1]])
masks = arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=12))
depths = arrays(np.float32, (12, 16), elements=st.sampled_from([0.0, 500.0, 512.0, 520.0, 900.0]))


@given(mask=masks)
def test_run_lengths_give_the_mask_back(mask):
    rle = encode_rle(mask)
    assert np.array_equal(decode_rle(rle), mask)
    assert sum(rle["counts"]) == mask.size
    assert 0 not in rle["counts"][1:]


def test_a_mask_that_holds_the_first_pixel_is_not_inverted():
    mask = np.zeros((3, 4), dtype=bool)
    mask[0, 0] = mask[2, 3] = True
    assert encode_rle(mask) == {"counts": [0, 1, 10, 1], "size": [3, 4]}


def test_runs_go_down_the_columns():
    mask = np.zeros((3, 4), dtype=bool)
    mask[:, 1] = True
    assert encode_rle(mask)["counts"] == [3, 3, 6]


@given(mask=masks)
def test_run_lengths_are_those_of_the_coco_library(mask):
    coco_mask = pytest.importorskip("hotcoco").mask
    compressed = coco_mask.fr_py_objects(dict(encode_rle(mask)), *mask.shape)
    assert np.array_equal(np.asarray(coco_mask.decode(compressed), dtype=bool), mask)


@pytest.mark.parametrize(
    "rle",
    [
        {},
        {"size": [2, 2]},
        {"counts": [4]},
        {"counts": [5], "size": [2, 2]},
        {"counts": [3], "size": [2, 2]},
        {"counts": [-1, 5], "size": [2, 2]},
        {"counts": [2.0, 2.0], "size": [2, 2]},
        {"counts": [True, 3], "size": [2, 2]},
        {"counts": "abc", "size": [2, 2]},
        {"counts": [4], "size": [2, 2, 1]},
        {"counts": [4], "size": "22"},
        {"counts": [10**10], "size": [10**5, 10**5]},
        {"counts": [2**62, 2**62, 2**62], "size": [2**31, 2**31]},
    ],
)
def test_bad_run_lengths_are_refused(rle):
    with pytest.raises(FormatError, match="run-length"):
        decode_rle(rle)


@given(depth=depths)
def test_an_object_is_visible_where_it_is_itself_measured(depth):
    assert np.array_equal(visible_mask(depth, depth, K), depth > 0)


@given(model=depths, measured=depths)
def test_an_object_is_visible_where_nothing_was_measured_and_only_where_it_is(model, measured):
    visible = visible_mask(model, measured, K)
    assert not (visible & (model == 0)).any()
    assert visible[(measured == 0) & (model > 0)].all()


@given(model=depths, measured=depths, near=st.floats(0, 20), far=st.floats(0, 20))
def test_a_larger_tolerance_never_hides_a_pixel(model, measured, near, far):
    low, high = sorted([near, far])
    seen = visible_mask(model, measured, K, low)
    assert not (seen & ~visible_mask(model, measured, K, high)).any()


def test_tolerance_is_measured_along_the_ray_with_integer_pixel_coordinates():
    flat = np.full((12, 16), 1000.0)
    distance_mm = distance_image_mm(flat, K)
    assert distance_mm[6, 8] == 1000.0
    assert distance_mm[6, 13] == pytest.approx(1000.0 * np.hypot(1, 5 / 50))
    assert np.array_equal(distance_image_mm(flat[2:7, 3:9], K, (3, 2)), distance_mm[2:7, 3:9])


@given(
    silhouette=arrays(bool, (36, 48)),
    measured=depths,
    top=st.integers(0, 12),
    left=st.integers(0, 16),
)
def test_counts_boxes_and_masks_of_an_instance_agree(silhouette, measured, top, left):
    canvas = np.where(silhouette, 510.0, 0.0)
    crop = canvas[top : 36 - top, left : 48 - left]
    found = measure_instance(crop, (left - 16, top - 12), measured, K)
    info = found.info
    inside = canvas[12:24, 16:32] > 0
    inside[: max(top - 12, 0)] = inside[:, : max(left - 16, 0)] = False
    assert np.array_equal(found.mask, inside)
    assert not (found.visible & ~found.mask).any()
    assert info["px_count_all"] == np.count_nonzero(crop)
    assert info["px_count_valid"] == np.count_nonzero(found.mask & (measured > 0))
    assert info["px_count_visib"] == np.count_nonzero(found.visible)
    assert info["px_count_visib"] <= found.mask.sum() <= info["px_count_all"]
    assert 0.0 <= info["visib_fract"] <= 1.0
    annotation = coco_annotation(7, 3, 5, found.mask, found.visible, info["visib_fract"])
    if annotation is None:
        assert info["bbox_obj"] == info["bbox_visib"] == [-1] * 4
        return
    assert annotation["ignore"] == (info["visib_fract"] < 0.1)
    assert annotation["area"] == info["px_count_visib"]
    assert np.array_equal(decode_rle(annotation["segmentation"]), found.visible)
    x, y, w, h = annotation["bbox"]
    assert found.mask[y : y + h, x : x + w].sum() == found.mask.sum()
    assert info["bbox_visib"][2:] == span_box_px(found.visible)[2:]
    x0, y0, w0, h0 = info["bbox_obj"]
    assert x0 <= x
    assert y0 <= y
    # gt info counts differences, COCO counts pixels.
    assert x0 + w0 + 1 >= x + w
    assert y0 + h0 + 1 >= y + h


def test_an_object_cut_off_by_the_border_counts_whole():
    model = np.full((4, 6), 500.0)
    found = measure_instance(model, (-3, 4), np.zeros((12, 16), np.float32), K)
    assert found.info["px_count_all"] == 24
    assert found.info["px_count_visib"] == 12
    assert found.info["visib_fract"] == 0.5
    assert found.info["bbox_obj"] == [-3, 4, 5, 3]
    assert found.info["bbox_visib"] == [0, 4, 2, 3]


def test_an_object_outside_the_image_has_no_box():
    found = measure_instance(np.full((4, 6), 500.0), (20, 4), np.zeros((12, 16)), K)
    assert found.info["visib_fract"] == 0.0
    assert found.info["px_count_all"] == 24
    assert found.info["bbox_obj"] == [-1, -1, -1, -1]
    assert not found.mask.any()


def test_an_object_that_is_nowhere_has_no_visible_part():
    found = measure_instance(np.zeros((0, 0)), (-16, -12), np.zeros((12, 16)), K)
    assert found.info["px_count_all"] == 0
    assert found.info["visib_fract"] == 0.0


def test_the_canvas_shows_the_image_in_its_middle():
    canvas_K, size_px = canvas_camera(K, (16, 12))
    assert size_px == (48, 36)
    point = np.array([10.0, -20.0, 400.0])
    on_image, on_canvas = (k @ point / point[2] for k in (K, canvas_K))
    np.testing.assert_allclose(on_canvas[:2] - on_image[:2], [16, 12], atol=1e-12)


def test_a_coco_file_lists_objects_that_are_not_in_the_scene():
    coco = coco_file("x", [1, 4], [(0, "rgb/000000.png")], (16, 12), [])
    assert [c["id"] for c in coco["categories"]] == [1, 4]
    assert coco["images"][0] == {
        "id": 0, "file_name": "rgb/000000.png", "width": 16, "height": 12,
    }  # fmt: skip
