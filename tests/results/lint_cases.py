"""One file for each thing that can be wrong, and what must be said of it."""
# ruff: noqa: E501  a table is read by its columns

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sixd.results import CheckRules
from tests.results.makers import ROW, row_with

LOCALIZATION = CheckRules("test_targets_bop19.json", "pose", every_target_object=True)
DETECTION = CheckRules("test_targets_bop24.json", "pose", cap=True)
BOXES = CheckRules("test_targets_bop19.json", "bbox")
MASKS = CheckRules("test_targets_bop19.json", "segm")

BOX: dict[str, Any] = {"scene_id": 2, "image_id": 3, "category_id": 5, "score": 0.5, "time": 1.0}
BOX["bbox"] = [1, 2, 30, 40]
MASK = {key: BOX[key] for key in ("scene_id", "image_id", "category_id", "score", "time")}


def rle(counts: str | list[int], size: tuple[int, int] = (48, 64)) -> dict[str, Any]:
    return MASK | {"segmentation": {"size": size, "counts": counts}}


@dataclass(frozen=True)
class Case:
    """A file with one thing wrong, and what must be said of it."""

    code: str
    text: str | bytes | list[Any]
    line: int | None = 2
    field: str = ""
    expected: str = ""
    got: str = ""
    fix: str = ""
    severity: str = "error"
    dataset: bool = False
    rules: CheckRules | None = None


ROTATED_2 = (
    "0.9993908270190958 -0.03489949670250097 0 0.03489949670250097 0.9993908270190958 0 0 0 1.02"
)
ALL_TARGETS = [ROW, row_with(obj_id="6"), row_with(im_id="4")]


def rows(*lines: str) -> str:
    return "\n".join(["scene_id,im_id,obj_id,score,R,t,time", *lines, ""])


CASES = [
    # what is on a line
    Case("column-count", rows("1,2,3"), field="", expected="7 fields", got="3: '1,2,3'", fix="seven"),
    Case("column-count", rows(ROW.replace(" ", ",")), expected="7", got="17", fix="spaces, not commas"),
    Case("column-count", rows(ROW.replace(",", ";")), expected="7", got="1:", fix="not semicolons"),
    Case("column-count", rows(ROW.rsplit(",", 1)[0]), expected="7", got="6:", fix="-1"),
    Case("not-an-integer", rows(row_with(im_id="3.0")), 2, "im_id", "integer", "'3.0'", "decimal"),
    Case("not-an-integer", rows(row_with(obj_id=str(2**63))), 2, "obj_id", "64 bits", "9223", "obj_id"),
    Case("not-a-number", rows(row_with(score="0_5")), 2, "score", "-12.5", "0_5", "underscores"),
    Case("not-a-number", rows(row_with(t="\N{MINUS SIGN}1 2 700")), 2, "t", "3 numbers", "\u22121", "U+2212"),
    Case("number-count", rows(row_with(R="1 0 0 0 1 0 0 0")), 2, "R", "9 numbers", "8:", "row by row"),
    Case("number-count", rows(row_with(t="1 2")), 2, "t", "3 numbers", "2:", "millimetres"),
    Case("not-finite", rows(row_with(score="nan")), 2, "score", "finite", "nan", "leave"),
    Case("not-finite", rows(row_with(t="0 0 1e400")), 2, "t", "finite", "1e400", "leave"),
    Case("not-finite", rows(row_with(time="inf")), 2, "time", "finite", "inf", "-1"),
    Case("bad-header", "scene,im,obj,score,R,t,time\n" + ROW, 1, "", "scene_id,im_id", "scene,im", "header"),
    Case("repeated-header", rows(ROW, rows()), 3, "", "first line only", "scene_id", "joined"),
    Case("blank-line", rows("", ROW), 2, "", "a row", "nothing", "--fix", "warning"),
    Case("line-too-long", rows("1" * 70_000), 2, "", "65,536", "more", "line feed"),
    Case("crlf", rows(ROW).replace("\n", "\r\n"), 1, "", r"\n", "2 lines", "--fix", "warning"),
    Case("bom", "\ufeff" + rows(ROW), 1, "", "first byte", "EF BB BF", "--fix", "warning"),
    Case("encoding", rows(ROW).encode() + b"\xff\n", 3, "", "UTF-8", "0xff at offset 81", "UTF-8"),
    # the whole file
    Case("empty-file", "", None, "", "pose CSV", "no text", "write"),
    Case("no-estimates", rows(), None, "", "one row", "none", "write"),
    Case("no-estimates", [], None, "", "one row", "none", "write"),
    Case("wrong-kind", [BOX], None, "", "pose CSV", "COCO", "protocol", rules=LOCALIZATION),
    Case("wrong-kind", rows(ROW), None, "", "boxes", "pose CSV", "protocol", rules=BOXES),
    # poses
    Case("not-a-rotation", rows(row_with(R=ROTATED_2)), 2, "R", "det 1 and max|R R^T - I| near 0",
         "det 1.02, max|R R^T - I| 0.0404", "--fix"),
    Case("not-a-rotation", rows(row_with(R="2 0 0 0 2 0 0 0 2")), 2, "R", "det 1", "det 8", "scale"),
    Case("not-a-rotation", rows(row_with(R=" ".join("0" * 9))), 2, "R", "det 1", "det 0", "leave out"),
    Case("not-a-rotation", rows(row_with(R="1 1 0 0 1 0 0 0 1")), 2, "R", "det 1", "det 1,", "row by row"),
    Case("inexact-rotation", rows(row_with(R="1.004 0 0 0 1 0 0 0 1")), 2, "R", "det 1", "det 1.004, max|R R^T - I| 0.00802", "--fix", "warning"),
    Case("reflection", rows(row_with(R="1 0 0 0 1 0 0 0 -1")), 2, "R", "det 1", "det -1", "flipped"),
    Case("metres", rows(row_with(t="0.1 0 0.9")), 2, "t", "20 mm", "median distance 0.9055 in 1", "1000"),
    Case("near-camera", rows(ROW, row_with(im_id="4", t="0 0 0")), 3, "t", "20 mm", "0 mm", "check", "warning"),
    Case("behind-camera", rows(row_with(t="0 0 -700")), 2, "t", "z > 0", "-700", "OpenGL", "warning"),
    Case("duplicate", rows(ROW, row_with(score="0.1")), 3, "R, t", "once", "line 2", "score", "warning"),
    # ids, times, counts
    Case("negative-id", rows(row_with(im_id="-3")), 2, "im_id", "0 or more", "-3", "dataset"),
    Case("negative-id", [BOX | {"category_id": -1}], 1, "[0].category_id", "0 or more", "-1", "dataset"),
    Case("inconsistent-time", rows(ROW, row_with(obj_id="6", time="0.26")), 3, "time",
         "0.25 as in line 2", "0.26 (scene 2, image 3)", "--fix"),
    Case("inconsistent-time", rows(ROW, row_with(obj_id="6", time="0.26"), row_with(im_id="4", time="-1")),
         3, "time", "0.25 as in line 2", "0.26 (scene 2, image 3)", "--fix", "warning"),
    Case("missing-time", rows(row_with(time="-1")), 2, "time", "every row", "1 of 1", "measure", "warning"),
    Case("over-cap", rows(*[row_with(t=f"0 0 {900 - i}", score=f"0.{9 - i}") for i in range(5)]), 5,
         "score", "at most 3", "5 in scene 2, image 3: 2 not scored", "best", "warning", rules=CheckRules(cap=3)),
    Case("unknown-scene", rows(row_with(scene_id="1")), 2, "scene_id", "one of 2", "1", "another", dataset=True),
    Case("unknown-image", rows(row_with(im_id="5")), 2, "im_id", "scene 2", "5", "another", dataset=True),
    Case("unknown-object", rows(row_with(obj_id="7")), 2, "obj_id", "5, 6", "7", "another", dataset=True),
    Case("unknown-object", [BOX, BOX | {"category_id": 9}, BOX | {"bbox": [0, 0, 1, 1]}], 1,
         "[1].category_id", "5, 6", "9", "write the category_id", dataset=True),
    Case("missing-targets", rows(ROW), None, "", "each of 3 targets",
         "2: scene 2, image 3, object 6; scene 2, image 4, object 5", "all targets", "warning", True, LOCALIZATION),
    Case("missing-targets", rows(ROW), None, "", "each of 2 target images", "1: scene 2, image 4", "all",
         "warning", True, DETECTION),
    Case("non-target-image", rows(*ALL_TARGETS, row_with(im_id="7")), 5, "im_id", "test_targets_bop24.json",
         "1 estimates in 1 images; first scene 2, image 7, object 5", "leave", "warning", True, DETECTION),
    Case("non-target-object", rows(*ALL_TARGETS, row_with(im_id="4", obj_id="6")), 5, "obj_id",
         "objects of test_targets_bop19", "image 4, object 6", "leave", "warning", True, LOCALIZATION),
    # boxes and masks
    Case("missing-field", [MASK], 1, "[0].bbox or segmentation", "bbox", "none", "leave"),
    Case("missing-field", [BOX], 1, "[0].segmentation", "scored", "none", "leave", rules=MASKS),
    Case("missing-field", [rle([3072])], 1, "[0].bbox", "scored", "none", "leave", rules=BOXES),
    Case("normalised-boxes", [BOX | {"bbox": [0.1, 0.2, 0.5, 0.5]}], 1, "[0].bbox", "pixels", "0.5", "width"),
    Case("inverted-box", [BOX | {"bbox": [30, 20, -10, 5]}], 1, "[0].bbox", "above 0", "-10.0", "corners"),
    Case("empty-box", [BOX | {"bbox": [30, 20, 0, 5]}], 1, "[0].bbox", "above 0", "0.0", "leave", "warning"),
    Case("box-outside", [BOX | {"bbox": [64, 0, 9, 9]}], 1, "[0].bbox", "pixels of the image",
         "64 x 48 px", "size", dataset=True),
    Case("box-beyond", [BOX | {"bbox": [60, 0, 9, 9]}], 1, "[0].bbox", "within", "64 x 48 px", "clip",
         "warning", True),
    Case("bad-rle", [rle("o")], 1, "[0].segmentation", "compressed", "'o'", "encode"),
    Case("bad-rle", [rle([3073, -1])], 1, "[0].segmentation", "0 or more", "-1", "again"),
    Case("bad-rle", [rle([3071])], 1, "[0].segmentation", "48 x 64 = 3072", "3071", "last pixel"),
    Case("mask-size", [rle([3072], (64, 48))], 1, "[0].segmentation.size", "[48, 64]", "[64, 48]",
         "swap", dataset=True),
    Case("mask-size", [rle([768], (24, 32))], 1, "[0].segmentation.size", "[48, 64]", "[24, 32]",
         "scale", dataset=True),
    Case("duplicate", [BOX, BOX | {"score": 0.1}], 1, "[1].bbox", "once", "[0].bbox", "score", "warning"),
]  # fmt: skip
