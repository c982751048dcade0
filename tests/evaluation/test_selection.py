"""The rules of who counts, against a brute force written from the benchmark's rules."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sixd.datasets.targets import Targets
from sixd.datasets.truth import GroundTruth
from sixd.evaluation.protocol import get_protocol
from sixd.evaluation.selection import Selection, select
from sixd.evaluation.timing import average_times_s
from sixd.results.tables import PoseEstimates

SCORES = st.sampled_from([0.1, 0.5, 0.5, 0.9])
VISIBLE = st.sampled_from([0.0, 0.05, 0.1, 0.3, 0.3, 1.0])
SMALL = st.integers(0, 2)


@dataclass(frozen=True)
class Case:
    estimates: PoseEstimates
    truth: GroundTruth
    targets: Targets


@st.composite
def cases(draw: st.DrawFn) -> Case:
    """Three images of two scenes, three objects, everything small enough to count by hand."""
    truths = draw(st.lists(st.tuples(SMALL, SMALL, VISIBLE), min_size=1, max_size=12))
    truths.sort(key=lambda t: t[0])
    image, obj_id, visib = (np.array(c) for c in zip(*truths, strict=True))
    gt_id = np.array([int((image[:i] == image[i]).sum()) for i in range(len(image))])
    n = len(image)
    truth = GroundTruth(
        scene_id=image // 2 + 1, im_id=image, obj_id=obj_id, gt_id=gt_id,
        R=np.tile(np.eye(3), (n, 1, 1)), t_mm=np.zeros((n, 3)), visib_fract=visib.astype(float),
        images=np.array([[1, 0], [1, 1], [2, 2]]),
    )  # fmt: skip
    keys = draw(st.lists(st.tuples(SMALL, SMALL), min_size=1, max_size=6, unique=True))
    counts = [draw(st.integers(1, 3)) for _ in keys]
    target_image, target_obj = (np.array(c) for c in zip(*keys, strict=True))
    targets = Targets(target_image // 2 + 1, target_image, target_obj, np.array(counts))
    rows = draw(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3), SCORES), max_size=15))
    columns = [np.array([r[k] for r in rows]) for k in range(3)]
    estimates = PoseEstimates.from_arrays(
        scene_id=(columns[0] // 2 + 1).astype(int), im_id=columns[0].astype(int),
        obj_id=columns[1].astype(int), score=columns[2].astype(float),
        R=np.tile(np.eye(3), (len(rows), 1, 1)), t_mm=np.zeros((len(rows), 3)),
        time_s=np.arange(len(rows), dtype=float),
    )  # fmt: skip
    return Case(estimates, truth, targets)


def best_rows(case: Case, image: int, obj: int, n: int | None) -> list[int]:
    e = case.estimates
    rows = [r for r in range(len(e)) if e.im_id[r] == image and e.obj_id[r] == obj]
    return sorted(rows, key=lambda r: -e.score[r])[:n]  # sorted() is stable, as the toolkit's is


def of_group(selection: Selection, group: int) -> tuple[list[int], list[int]]:
    return (
        selection.estimate_rows[selection.estimate_group == group].tolist(),
        selection.truth_rows[selection.truth_group == group].tolist(),
    )


@given(case=cases())
def test_localization_takes_the_best_estimates_and_the_most_visible_instances(
    case: Case,
) -> None:
    selection = select(case.estimates, case.truth, case.targets, get_protocol("bop19-localization"))
    truth, targets = case.truth, case.targets
    assert targets.obj_id is not None
    assert targets.inst_count is not None
    for g in range(len(targets)):
        image, obj, count = (int(c[g]) for c in (targets.im_id, targets.obj_id, targets.inst_count))
        estimates, truths = of_group(selection, g)
        assert estimates == best_rows(case, image, obj, count)
        mine = [t for t in range(len(truth)) if (truth.im_id[t], truth.obj_id[t]) == (image, obj)]
        assert truths == mine
        valid = sorted(mine, key=lambda t: -truth.visib_fract[t])[:count]
        matchable = selection.truth_matchable[selection.truth_group == g]
        assert {t for t, ok in zip(truths, matchable, strict=True) if ok} == set(valid)
        assert selection.n_wanted[g] == len(valid)
    used = len(selection.estimate_rows) + sum(selection.ignored.values())
    assert used == len(case.estimates)


@given(case=cases(), cap=st.integers(1, 4), strict=st.booleans())
def test_detection_takes_every_estimate_within_the_cap(case: Case, cap: int, strict: bool) -> None:
    protocol = get_protocol("bop24-detection-strict" if strict else "bop24-detection")
    selection = select(case.estimates, case.truth, case.targets, protocol, cap)
    e, truth = case.estimates, case.truth
    images = list(dict.fromkeys(case.targets.im_id.tolist()))
    kept: set[int] = set()
    for image in set(e.im_id.tolist()):
        rows = [r for r in range(len(e)) if e.im_id[r] == image]
        kept |= set(sorted(rows, key=lambda r: -e.score[r])[:cap])
    present = {(int(i), int(o)) for i, o in zip(truth.im_id, truth.obj_id, strict=True)}
    expected = {
        r
        for r in kept
        if e.im_id[r] in images and (strict or (int(e.im_id[r]), int(e.obj_id[r])) in present)
    }
    assert set(selection.estimate_rows.tolist()) == expected
    counted = (truth.visib_fract >= 0.1) & np.isin(truth.im_id, images)
    assert selection.n_targets == counted.sum()
    assert set(np.flatnonzero(selection.within_cap)) == kept
    # Ties of score are broken by the order of images in the list, scene by scene.
    scene_order = list(dict.fromkeys(case.targets.scene_id.tolist()))
    groups = zip(selection.scene_id.tolist(), selection.im_id.tolist(), strict=True)
    place = [(scene_order.index(s), images.index(i)) for s, i in groups]
    assert place == sorted(place)
    assert len(selection.estimate_rows) + sum(selection.ignored.values()) == len(e)


@given(case=cases())
def test_a_single_instance_is_found_at_most_once(case: Case) -> None:
    selection = select(case.estimates, case.truth, case.targets, get_protocol("bop18-siso"))
    assert (selection.n_wanted <= 1).all()
    assert (np.bincount(selection.estimate_group, minlength=1) <= 1).all()
    visible = selection.truth_matchable == (case.truth.visib_fract[selection.truth_rows] >= 0.1)
    assert visible.all()


def test_times_are_averaged_over_images_with_rows_and_over_all_target_images() -> None:
    images = (np.array([1, 1, 1, 9]), np.array([0, 0, 1, 9]))
    targets = (np.array([1, 1, 1, 1]), np.array([0, 1, 2, 2]))
    time_s = np.array([0.2, 0.2, 0.4, 0.9])
    over_rows, over_targets = average_times_s(images, time_s, targets)
    assert over_rows == np.mean([0.2, 0.4, 0.9])
    assert over_targets == (0.2 + 0.4) / 3
    time_s[2] = np.nan
    assert average_times_s(images, time_s, targets) == (-1.0, -1.0)
