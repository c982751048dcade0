"""Laws of the 2D scores, parity with their definition, and input that is wrong."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sixd.errors import FormatError, MissingDataError, UsageError
from sixd.evaluation.coco_curves import Candidates, coco_curves
from sixd.evaluation.coco_reference import reference_curves
from sixd.evaluation.coco_truth import CocoTruth, read_coco_files
from sixd.evaluation.detection2d import CocoScores, coco_breakdowns, coco_scores
from sixd.results.tables import Detections, Rle

CANVAS_PX = 64
CATEGORIES = (1, 7)
SCENE = 3
INSTANCE_COLUMNS = ("image", "obj_id", "bbox_xywh_px", "area_px", "ignored", "crowd")
NOTHING = Detections.from_arrays(scene_id=[], im_id=[], obj_id=[], score=[])


def rectangle_mask(box_xywh_px: np.ndarray) -> Rle:
    """The pixels of a box with whole coordinates, as plain run lengths."""
    x, y, w, h = (int(v) for v in box_xywh_px)
    pixels = np.zeros((CANVAS_PX, CANVAS_PX), bool)
    pixels[y : y + h, x : x + w] = True
    flat = np.concatenate([[False], pixels.ravel(order="F"), [False]])
    edges = np.flatnonzero(flat[1:] != flat[:-1])
    bounds = [0, *edges.tolist(), CANVAS_PX**2]
    return Rle((CANVAS_PX, CANVAS_PX), np.diff(bounds).tolist())


def make_truth(rows: list[tuple[int, int, tuple[float, ...]]], n_images: int = 3) -> CocoTruth:
    """Truths (image, category, box), none ignored, areas those of the boxes."""
    boxes = np.array([b for _, _, b in rows], float).reshape(-1, 4)
    return CocoTruth(
        scene_id=np.full(n_images, SCENE),
        im_id=np.arange(n_images) * 10,
        size_px=np.full((n_images, 2), CANVAS_PX),
        category_id=np.array(CATEGORIES),
        image=np.array([i for i, _, _ in rows], np.int64),
        obj_id=np.array([k for _, k, _ in rows], np.int64),
        bbox_xywh_px=boxes,
        area_px=boxes[:, 2] * boxes[:, 3],
        ignored=np.zeros(len(rows), bool),
        crowd=np.zeros(len(rows), bool),
        segmentation=tuple(rectangle_mask(b).as_coco() for b in boxes),
    )


def detect(truth: CocoTruth, rows: np.ndarray, score: float | np.ndarray = 1.0) -> Detections:
    """Perfect detections of some truths."""
    image = truth.image[rows]
    boxes = truth.bbox_xywh_px[rows]
    return Detections.from_arrays(
        scene_id=truth.scene_id[image],
        im_id=truth.im_id[image],
        obj_id=truth.obj_id[rows],
        score=score,
        bbox_xywh_px=boxes,
        segmentation=[rectangle_mask(b) for b in boxes],
    )


boxes = st.tuples(
    st.sampled_from((0, 5, 10, 20)),
    st.sampled_from((0, 5, 20)),
    st.sampled_from((0, 5, 10, 20, 40)),
    st.sampled_from((5, 10, 40)),
)
truth_rows = st.lists(
    st.tuples(st.integers(0, 2), st.sampled_from(CATEGORIES), boxes), min_size=1, max_size=6
)
areas_px = st.sampled_from((None, 0.0, 32.0**2, 96.0**2, 20000.0))


@st.composite
def truths(draw: st.DrawFn, crowds: bool = True) -> CocoTruth:
    """Few coordinates and areas on the borders, so that ties and edges are common."""
    truth = make_truth(draw(truth_rows))
    n = len(truth)
    flags = st.lists(st.sampled_from((False, False, True)), min_size=n, max_size=n)
    crowd = np.array(draw(flags)) if crowds and draw(st.booleans()) else truth.crowd
    areas = draw(st.lists(areas_px, min_size=n, max_size=n))
    own = truth.area_px.tolist()
    return replace(
        truth,
        ignored=np.array(draw(flags)) | crowd,
        crowd=crowd,
        area_px=np.array([o if a is None else a for a, o in zip(areas, own, strict=True)]),
    )


@st.composite
def problems(draw: st.DrawFn) -> tuple[Candidates, CocoTruth]:
    truth = draw(truths())
    free = st.tuples(st.integers(0, 2), st.sampled_from(CATEGORIES), boxes)
    own = [
        (int(i), int(k), tuple(b))
        for i, k, b in zip(truth.image, truth.obj_id, truth.bbox_xywh_px.tolist(), strict=True)
    ]
    rows = draw(st.lists(st.one_of(free, st.sampled_from(own)), max_size=8))
    n = len(rows)
    found = make_truth(rows)
    score = draw(st.lists(st.sampled_from((0.2, 0.5, 0.8)), min_size=n, max_size=n))
    area = draw(st.lists(areas_px, min_size=n, max_size=n))
    areas = [o if a is None else a for a, o in zip(area, found.area_px.tolist(), strict=True)]
    candidates = Candidates(
        image=found.image,
        obj_id=found.obj_id,
        score=np.array(score, float),
        bbox_xywh_px=found.bbox_xywh_px,
        area_px=np.array(areas, float),
        segmentation=found.segmentation,
    )
    return candidates, truth


@pytest.mark.parametrize("iou_type", ["bbox", "segm"])
@settings(max_examples=40)
@given(problem=problems())
def test_the_curves_are_those_of_the_definition(iou_type, problem):
    curves = coco_curves(*problem, iou_type)
    expected = reference_curves(*problem, iou_type)
    np.testing.assert_array_equal(curves.precision, expected.precision)
    np.testing.assert_array_equal(curves.recall, expected.recall)


@pytest.mark.parametrize("iou_type", ["bbox", "segm"])
@given(truth=truths(crowds=False))
def test_the_truth_to_be_found_scores_exactly_one(iou_type, truth):
    to_find = ~truth.ignored & (truth.bbox_xywh_px[:, 2] > 0)
    truth = replace(truth, ignored=~to_find)
    scores = coco_scores(detect(truth, np.flatnonzero(to_find)), truth, iou_type)
    assert {scores.AP, scores.AP50, scores.AR100} == {1.0 if to_find.any() else -1.0}
    assert set(scores.AP_of_category.values()) <= {1.0}


@given(problem=problems(), order=st.permutations(range(3)), swap=st.booleans())
def test_names_and_order_of_images_and_categories_do_not_matter(problem, order, swap):
    candidates, truth = problem
    # Equal scores are ranked by image, so they would matter.
    candidates = replace(candidates, score=np.arange(len(candidates), dtype=float))
    names = np.array([0, 7, 0, 0, 0, 0, 0, 1] if swap else [0, 1, 0, 0, 0, 0, 0, 7])
    new = [
        replace(table, image=np.array(order)[table.image], obj_id=names[table.obj_id])
        for table in (candidates, truth)
    ]
    before, after = coco_curves(candidates, truth, "bbox"), coco_curves(*new, "bbox")
    step = -1 if swap else 1
    np.testing.assert_array_equal(before.precision, after.precision[:, :, ::step])
    np.testing.assert_array_equal(before.recall, after.recall[:, ::step])


def apart(n: int) -> CocoTruth:
    """Truths of one category, three an image, so far apart that a detection meets one only."""
    return make_truth([(i // 3, 1, (20.0 * (i % 3), 5, 10, 10)) for i in range(n)])


@given(
    found=st.lists(st.integers(0, 7), min_size=1, max_size=8, unique=True),
    shifts=st.lists(st.integers(0, 6), min_size=8, max_size=8),
    again=st.integers(0, 7),
    ignored=st.lists(st.booleans(), min_size=8, max_size=8),
)
def test_repeating_a_detection_never_raises_a_score(found, shifts, again, ignored):
    truth = replace(apart(8), ignored=np.array(ignored))
    detections = detect(truth, np.array(found), np.linspace(1, 0.1, len(found)))
    detections.bbox_xywh_px[:, 0] += np.array(shifts)[: len(found)]
    once = coco_scores(detections, truth)
    repeated = detections.where(np.array([again % len(found)]))
    twice = coco_scores(Detections.concatenate([detections, repeated]), truth)
    for name, score in once.scores.items():
        assert twice.scores[name] <= score


@pytest.mark.parametrize("iou_type", ["bbox", "segm"])
@given(found=st.lists(st.integers(0, 4), max_size=5, unique=True), wrong=st.booleans())
def test_detections_of_ignored_truths_change_nothing(iou_type, found, wrong):
    truth = replace(apart(8), ignored=np.arange(8) >= 5)
    detections = detect(truth, np.array(found, int), 0.5)
    if wrong:
        detections = Detections.concatenate([detections, detect(truth, np.array([0]), 0.9)])
    on_ignored = detect(truth, np.arange(5, 8), 0.7)
    more = Detections.concatenate([detections, on_ignored])
    without, with_them = (coco_scores(d, truth, iou_type).scores for d in (detections, more))
    # AR1 looks at the best detection of an image, which may now be one of an ignored truth.
    assert without | {"AR1": 0} == with_them | {"AR1": 0}


def test_an_ignored_truth_takes_one_detection_and_a_crowd_takes_all():
    truth = replace(apart(2), ignored=np.array([False, True]))
    detections = detect(truth, np.array([1, 1, 0]), np.array([0.9, 0.8, 0.7]))
    # The second detection of the ignored truth is a mistake above the right one: precision 1/2.
    assert coco_scores(detections, truth).AP == 0.5
    assert coco_scores(detections, replace(truth, crowd=truth.ignored)).AP == 1.0


def test_a_detection_prefers_a_truth_to_be_found_over_a_better_ignored_one():
    truth = make_truth([(0, 1, (0, 0, 10, 10)), (0, 1, (0, 0, 10, 8))])
    truth = replace(truth, ignored=np.array([True, False]))
    scores = coco_scores(detect(truth, np.array([0])), truth)
    assert (scores.AP50, scores.AR1) == (1.0, 0.7)  # IoU 0.8 reaches 7 of the 10 thresholds


def test_no_detections_score_zero_and_no_truth_scores_minus_one():
    truth = apart(3)
    nothing = coco_scores(NOTHING, truth)
    assert (nothing.AP, nothing.AR100, nothing.AP_large) == (0.0, 0.0, -1.0)
    assert nothing.average_time_per_image_s == -1.0
    assert nothing.n_truths_without_detection == 3
    all_ignored = replace(truth, ignored=np.ones(3, bool))
    assert set(coco_scores(detect(truth, np.arange(3)), all_ignored).scores.values()) == {-1.0}
    assert coco_scores(detect(truth, np.arange(3)), make_truth([])).AP == -1.0


def test_absent_objects_cost_precision_and_categories_without_truth_are_left_out():
    truth = make_truth([(0, 1, (0, 0, 10, 10))])
    in_other_image = replace(truth, image=np.array([1]))
    of_other_category = replace(truth, obj_id=np.array([7]))
    right = detect(truth, np.array([0]), 0.5)
    wrong = detect(in_other_image, np.array([0]), 0.9)
    harmless = detect(of_other_category, np.array([0]), 0.9)
    scores = coco_scores(Detections.concatenate([right, wrong, harmless]), truth)
    assert scores.AP == 0.5
    assert scores.AP_of_category == {1: 0.5}


def test_rows_that_play_no_part_are_counted():
    truth = apart(1)
    rows = [detect(truth, np.zeros(102, int))]
    for change in ({"im_id": 5}, {"scene_id": 4}, {"obj_id": 2}):
        row = detect(truth, np.array([0]))
        rows.append(replace(row, **{k: np.array([v]) for k, v in change.items()}))
    rows.append(replace(detect(truth, np.array([0])), bbox_xywh_px=np.full((1, 4), np.nan)))
    scores = coco_scores(Detections.concatenate(rows), truth)
    assert (scores.n_detections, scores.n_beyond_100) == (102, 2)
    assert (scores.n_off_target, scores.n_unknown_category, scores.n_without_shape) == (2, 1, 1)
    assert (scores.n_truths, scores.n_ignored_truths) == (1, 0)
    assert scores.AP == 1.0


def test_times_are_averaged_over_the_images_of_the_file_and_over_all_target_images():
    truth = apart(7)
    detections = detect(truth, np.array([0, 1, 3]))
    timed = replace(detections, time_s=np.array([0.25, 0.25, 0.5]))
    scores = coco_scores(timed, truth)
    assert scores.average_time_per_image_s == 0.375
    assert scores.average_time_per_target_image_s == 0.25
    partly = replace(detections, time_s=np.array([0.25, 0.25, np.nan]))
    assert coco_scores(partly, truth).average_time_per_image_s == -1.0


def test_the_first_detection_decides_whether_boxes_or_masks_give_areas():
    truth = make_truth([(0, 1, (0, 0, 60, 60)), (1, 1, (0, 0, 10, 10))])  # medium and small
    hit = detect(truth, np.array([0, 1]), 0.5)
    # A false alarm with a small mask in a box of medium size.
    alarm = detect(truth, np.array([1]), 0.9)
    alarm = replace(alarm, im_id=np.array([20]), bbox_xywh_px=np.array([[0.0, 0, 40, 40]]))
    with_boxes = coco_scores(Detections.concatenate([hit, alarm]), truth, "segm")
    assert (with_boxes.AP_small, with_boxes.AP_medium) == (1.0, 0.5)
    unboxed = replace(hit, bbox_xywh_px=np.full((2, 4), np.nan))
    without = coco_scores(Detections.concatenate([unboxed, alarm]), truth, "segm")
    assert (without.AP_small, without.AP_medium) == (0.5, 1.0)


@pytest.mark.parametrize("iou_type", ["bbox", "segm"])
@settings(max_examples=20)
@given(truth=truths(), data=st.data())
def test_a_scene_scores_what_it_scores_alone(iou_type, truth, data):
    truth = replace(truth, scene_id=np.array([3, 3, 1]))
    n = len(truth)
    rows = np.array(data.draw(st.lists(st.integers(0, n - 1), max_size=6)), int)
    detections = detect(truth, rows, np.linspace(1, 0.5, len(rows)))
    together = coco_scores(detections, truth, iou_type)
    for scene, score in zip(together.scenes.scene_id, together.scenes.AP, strict=True):
        images, own = truth.scene_id == scene, truth.scene_id[truth.image] == scene
        alone = replace(
            truth,
            **{k: getattr(truth, k)[images] for k in ("scene_id", "im_id", "size_px")},
            **{k: getattr(truth, k)[own] for k in INSTANCE_COLUMNS},
            segmentation=tuple(np.array(truth.segmentation)[own]),
        )
        alone.image[:] -= np.argmax(images)
        expected = coco_scores(detections, alone, iou_type).AP
        assert (-1.0 if np.isnan(score) else score) == pytest.approx(expected, abs=1e-12)


@given(problem=problems())
def test_the_parts_average_to_the_whole(problem):
    candidates, truth = problem
    detections = Detections.from_arrays(
        scene_id=truth.scene_id[candidates.image],
        im_id=truth.im_id[candidates.image],
        obj_id=candidates.obj_id,
        score=candidates.score,
        bbox_xywh_px=candidates.bbox_xywh_px,
    )
    scores = coco_scores(detections, truth)
    if scores.n_truths == 0 or scores.AP < 0:
        assert scores.AP_of_category == {}
        return
    assert np.mean(list(scores.AP_of_category.values())) == pytest.approx(scores.AP)
    assert scores.AP_at_iou.mean() == pytest.approx(scores.AP)
    assert scores.AP_at_iou[[0, 5]].tolist() == pytest.approx([scores.AP50, scores.AP75])
    assert scores.AR_at_iou.mean() == pytest.approx(scores.AR100)
    assert scores.categories.n_truths.sum() == scores.scenes.n_truths.sum() == scores.n_truths


def test_breakdowns_have_a_row_for_each_object_scene_and_threshold():
    parts = coco_breakdowns(coco_scores(detect(apart(4), np.arange(3)), apart(4)))
    assert {by: len(part) for by, part in parts.items()} == {
        "object": 2,
        "scene": 1,
        "threshold": 10,
    }
    assert parts["object"].columns["n_targets"].tolist() == [4, 0]
    assert parts["object"].columns["n_estimates"].tolist() == [3, 0]
    assert np.isnan(parts["object"].columns["AP"][1])


# ------------------------------------------------------------------ input that is wrong


def test_every_score_and_box_that_is_not_finite_is_named():
    truth = apart(3)
    detections = detect(truth, np.arange(3), np.array([0.5, np.nan, 0.5]))
    detections.bbox_xywh_px[2, 1] = np.inf
    with pytest.raises(FormatError) as caught:
        coco_scores(detections, truth)
    assert [p.what[:5] for p in caught.value.problems] == ["row 1", "row 2"]


def test_every_broken_mask_is_named():
    truth = apart(3)
    broken = Rle((CANVAS_PX, CANVAS_PX), [CANVAS_PX**2, CANVAS_PX])
    detections = detect(truth, np.arange(3))
    masks = (broken, rectangle_mask(truth.bbox_xywh_px[1]), broken)
    with pytest.raises(FormatError, match=r"row 0, counted from 0: .*exceed") as caught:
        coco_scores(replace(detections, segmentation=masks), truth, "segm")
    assert [p.what[:5] for p in caught.value.problems] == ["row 0", "row 2"]


def test_results_without_the_shape_to_be_scored_say_what_to_do():
    truth = apart(2)
    boxes_only = replace(detect(truth, np.array([0])), segmentation=(None,))
    with pytest.raises(FormatError, match="no detection has a segmentation") as caught:
        coco_scores(boxes_only, truth, "segm")
    assert caught.value.problems[0].fix.startswith("use --protocol bop22-detection2d")
    with pytest.raises(UsageError, match="masks=True"):
        coco_scores(detect(truth, np.array([0])), replace(truth, segmentation=None), "segm")


def write_truth(path: Path, im_ids: list[int], **changes: object) -> Path:
    annotation = {
        "id": 1,
        "image_id": im_ids[0],
        "category_id": 1,
        "bbox": [0, 0, 10, 10],
        "area": 100,
        "iscrowd": 0,
        "ignore": False,
        "segmentation": {"size": [CANVAS_PX, CANVAS_PX], "counts": [0, 10, CANVAS_PX**2 - 10]},
    }
    file = {
        "images": [{"id": i, "width": CANVAS_PX, "height": CANVAS_PX} for i in im_ids],
        "categories": [{"id": 1, "name": "1"}],
        "annotations": [annotation | changes],
    }
    path.write_text(json.dumps(file))
    return path


def test_scenes_keep_the_order_of_the_targets_and_images_their_own(tmp_path):
    paths = {s: write_truth(tmp_path / f"{s}.json", [4, 2, 9]) for s in (8, 5)}
    truth = read_coco_files(paths, np.array([8, 8, 5]), np.array([4, 2, 4]))
    assert list(zip(truth.scene_id.tolist(), truth.im_id.tolist(), strict=True)) == [
        (8, 2),
        (8, 4),
        (5, 4),
    ]
    assert truth.image.tolist() == [1, 2]
    scores = coco_scores(NOTHING, truth)
    assert scores.scenes.scene_id.tolist() == [8, 5]
    assert scores.scenes.n_images.tolist() == [2, 1]
    assert scores.scenes.n_truths.tolist() == [1, 1]


def test_all_missing_files_are_named_at_once(tmp_path):
    paths = {s: tmp_path / f"{s}.json" for s in (1, 2, 3)}
    write_truth(paths[2], [0])
    with pytest.raises(MissingDataError, match=r"2 of 3 files[\s\S]*1\.json[\s\S]*3\.json"):
        read_coco_files(paths, np.array([1, 2, 3]), np.zeros(3, int))


def test_a_target_image_that_the_file_does_not_list_is_named(tmp_path):
    path = write_truth(tmp_path / "a.json", [0])
    with pytest.raises(MissingDataError, match="does not list the target images 6, 7"):
        read_coco_files({1: path}, np.array([1, 1, 1]), np.array([0, 6, 7]))


@pytest.mark.parametrize(
    "changes",
    [
        {"bbox": [0, 0, 10]},
        {"area": "large"},
        {"category_id": 2},
        {"segmentation": {"size": [5, 5], "counts": [10, 40]}},
        {"segmentation": None},
    ],
)
def test_a_file_that_is_not_coco_truth_is_named(tmp_path, changes):
    path = write_truth(tmp_path / "odd.json", [0], **changes)
    with pytest.raises(FormatError, match=r"odd\.json"):
        read_coco_files({1: path}, np.array([1]), np.array([0]))


def test_scores_come_in_the_usual_order():
    names = "AP AP50 AP75 AP_small AP_medium AP_large AR1 AR10 AR100 AR_small AR_medium AR_large"
    scores: CocoScores = coco_scores(NOTHING, apart(1))
    assert list(scores.scores) == names.split()
