"""Broken files end in a `SixdError` that names file, place and reason; never in anything else."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sixd.datasets import images, open_dataset
from sixd.datasets.cameras import read_cameras
from sixd.datasets.models import read_models_info
from sixd.datasets.spec import read_toml
from sixd.datasets.targets import read_targets
from sixd.datasets.truth import read_truth
from sixd.errors import FormatError, MissingDataError, SixdError
from tests.datasets.folders import FISHEYE, K, instance, write_classic, write_json

GOOD = {
    "gt": {"0": [instance(1), instance(2)], "3": []},
    "camera": {"0": {"cam_K": K, "depth_scale": 1.0}, "3": {"cam_model": FISHEYE}},
    "targets": [{"scene_id": 1, "im_id": 2, "obj_id": 3, "inst_count": 1}],
    "models_info": {"1": {"diameter": 3.0, "symmetries_continuous": [
        {"axis": [0, 0, 1], "offset": [0, 0, 0]}]}},
}  # fmt: skip


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A dataset whose files are overwritten, and a reader of each."""
    dataset = open_dataset(write_classic(tmp_path_factory.mktemp("hostile") / "bins"))
    for path in dataset.scene_dir(1).glob("scene_gt_info.json"):
        path.unlink()
    return {
        "gt": (dataset.annotation_path("gt", 1), lambda _: read_truth(dataset)),
        "camera": (dataset.annotation_path("camera", 1), read_cameras),
        "targets": (dataset.path / "targets.json", read_targets),
        "models_info": (dataset.models_info_path, read_models_info),
    }


def problems_of(bench, kind: str, content: object) -> list[str]:
    path, read = bench[kind]
    path.write_bytes(content if isinstance(content, bytes) else json.dumps(content).encode())
    with pytest.raises(FormatError) as caught:
        read(path)
    assert {p.file for p in caught.value.problems} == {str(path)}
    return [str(p).removeprefix(f"{path}") for p in caught.value.problems]


@pytest.mark.parametrize("kind", sorted(GOOD))
@given(data=st.data())
def test_a_file_with_damaged_bytes_is_read_or_refused(bench, kind, data):
    raw = bytearray(json.dumps(GOOD[kind]).encode())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(raw) - 1))
        if data.draw(st.booleans()):
            raw[at : at + data.draw(st.integers(0, 9))] = data.draw(st.binary(max_size=3))
        else:
            raw[at : at + 1] = data.draw(
                st.sampled_from([b"NaN", b"-1", b"1e999", b"null", b"[", b"{}", b'"', b"\x00"])
            )
        raw = raw or bytearray(b"x")
    path, read = bench[kind]
    path.write_bytes(raw)
    try:
        read(path)
    except SixdError as error:
        assert str(path) in str(error)  # noqa: PT017


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(
        st.sampled_from(["0", "1", "x", "obj_id", "cam_K", "cam_model", "scene_id", "diameter"]),
        inner, max_size=3),
    max_leaves=12,
)  # fmt: skip


@pytest.mark.parametrize("kind", sorted(GOOD))
@given(value=json_values)
def test_any_json_at_all_is_read_or_refused(bench, kind, value):
    path, read = bench[kind]
    path.write_text(json.dumps(value))
    try:
        read(path)
    except SixdError as error:
        assert str(path) in str(error)  # noqa: PT017


@given(st.text(max_size=60))
def test_any_text_as_dataset_toml_is_read_or_refused(text):
    path = Path("dataset.toml")

    class File(type(path)):
        def read_text(self, *_args, **_kwargs):
            return text

    try:
        read_toml(File("dataset.toml"))
    except SixdError as error:
        assert "dataset.toml" in str(error)  # noqa: PT017


def test_every_wrong_entry_is_named_not_the_first(bench):
    gt = {str(i): [instance(1), instance(2)] for i in range(3)}
    gt["0"][1]["cam_t_m2c"] = [1, 2]
    gt["2"][0]["obj_id"] = "cup"
    del gt["1"][0]["cam_R_m2c"]
    found = problems_of(bench, "gt", gt)
    assert [p.split(" ")[1].removesuffix(":") for p in found] == [
        '$["0"][1].cam_t_m2c', '$["1"][0]', '$["2"][0].obj_id']  # fmt: skip
    assert "array of length 3" in found[0]
    assert "cam_R_m2c" in found[1]
    assert "int" in found[2]


@pytest.mark.parametrize(
    ("kind", "content", "words"),
    [
        ("gt", b"", "is empty"),
        ("gt", b'{"0": [{"obj_id": 1', "cut off"),
        ("gt", b'\xef\xbb\xbf{"0": []}', "byte order mark"),
        ("gt", b'{\n"0": [{"obj_id": 1, "cam_t_m2c": [NaN, 0, 1]}]}', "NaN or Infinity"),
        ("gt", b'{"0": [], "1": [], "0": []}', None),
        ("gt", b'{"-4": []}', "as key"),
        ("gt", b'{"four": []}', '$["four"]'),
        ("gt", b"[1, 2]", "object"),
        ("camera", {"0": {"depth_scale": 1.0}}, "cam_K or cam_model"),
        ("camera", {"0": {"cam_K": K, "cam_model": FISHEYE}}, "both"),
        ("camera", {"0": {"cam_K": [0.0] * 9}}, "intrinsic"),
        ("camera", {"0": {"cam_model": {**FISHEYE, "projection_params": [1.0]}}}, "15"),
        ("camera", {"0": {"cam_K": K, "cam_t_w2c": [1.0]}}, "length 3"),
        ("models_info", {"1": {"diameter": -1.0}}, "above 0"),
        ("models_info", {"1": {"min_x": 1.0}}, "diameter"),
        ("targets", [], "no targets"),
        ("targets", [{"scene_id": 1}], "im_id"),
        ("targets", [{"scene_id": 1, "im_id": -1}], "$[0].im_id"),
    ],
)
def test_the_message_says_what_is_wrong(bench, kind, content, words):
    if words is None:
        path, read = bench[kind]
        path.write_bytes(content)
        read(path)  # empty lists repeat without losing an instance
    else:
        assert words in problems_of(bench, kind, content)[0]


def test_numbers_that_overflow_are_not_infinity(bench):
    raw = json.dumps({"0": [instance(1)]}).replace("500.0", "1e999").encode()
    assert "finite number" in problems_of(bench, "gt", raw)[0]


def test_a_malformed_line_is_named_by_its_number(bench):
    assert problems_of(bench, "gt", b'{\n"0": [],\n"1": [oops]}')[0].startswith(":3:")


@pytest.mark.parametrize(("kind", "entry"), [("gt", [instance(1)]), ("camera", {"cam_K": K})])
def test_a_repeated_image_is_not_silently_the_last_one(bench, kind, entry):
    raw = f'{{"7": {json.dumps(entry)}, "7": {json.dumps(entry)}}}'.encode()
    assert '"7": occurs twice' in problems_of(bench, kind, raw)[0]


def test_symmetries_that_are_no_transforms_are_named_with_their_object(tmp_path):
    path = write_classic(tmp_path / "bins")
    bad = {"2": {"diameter": 1.0, "symmetries_discrete": [[1, 2, 3]]}}
    write_json(path / "models_eval" / "models_info.json", bad)
    with pytest.raises(FormatError, match="object 2"):
        open_dataset(path).model(2)


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pictures")
    noise = np.random.default_rng(0).integers(1, 2**16, (30, 40)).astype(np.uint16)
    grey = (noise >> 8).astype(np.uint8)
    for name, image in (
        ("depth.png", noise), ("depth.tif", noise), ("float.tif", noise.astype(np.float32)),
        ("rgb.png", np.dstack([grey] * 3)), ("rgb.jpg", np.dstack([grey] * 3)),
        ("rgba.png", np.dstack([grey] * 4)), ("grey.png", grey),
    ):  # fmt: skip
        assert cv2.imwrite(str(folder / name), image)
    return folder


@pytest.mark.parametrize("name", ["depth.png", "depth.tif", "float.tif", "rgb.png", "rgb.jpg"])
def test_the_size_is_read_from_the_header(pictures, name):
    assert images.image_size_px(pictures / name) == (40, 30)


@given(data=st.data())
def test_a_png_with_a_damaged_byte_never_gives_wrong_depth(pictures, data):
    raw = bytearray((pictures / "depth.png").read_bytes())
    expected = images.read_depth_mm(pictures / "depth.png", 1.0)
    raw[data.draw(st.integers(0, len(raw) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    damaged = pictures / "damaged.png"
    damaged.write_bytes(raw)
    try:
        assert (images.read_depth_mm(damaged, 1.0) == expected).all()
    except FormatError as error:
        assert str(damaged) in str(error)  # noqa: PT017


@given(data=st.data(), name=st.sampled_from(["depth.png", "depth.tif", "rgb.jpg", "rgb.png"]))
def test_a_cut_off_image_is_refused(pictures, data, name):
    raw = (pictures / name).read_bytes()
    # The last two bytes of a PNG are half of a checksum that nobody reads.
    cut = pictures / f"cut-{name}"
    cut.write_bytes(raw[: data.draw(st.integers(0, len(raw) - 20))])
    with pytest.raises(FormatError, match="cut-"):
        images.read_image(cut) if name.startswith("rgb") else images.read_depth_mm(cut, 1.0)


@given(st.binary(max_size=40))
def test_any_bytes_have_a_size_or_are_refused(pictures, raw):
    for head in (b"", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", b"\xff\xd8", b"II*\0", b"MM\0*"):
        path = pictures / "any.png"
        path.write_bytes(head + raw)
        try:
            width, height = images.image_size_px(path)
        except FormatError:
            continue
        assert min(width, height) >= 1


def test_depth_is_scaled_in_single_precision(pictures):
    stored = cv2.imread(str(pictures / "depth.png"), cv2.IMREAD_UNCHANGED)
    depth_mm = images.read_depth_mm(pictures / "depth.png", 0.1)
    assert depth_mm.dtype == np.float32
    assert (depth_mm == stored.astype(np.float32) * np.float32(0.1)).all()
    tif = images.read_depth_mm(pictures / "depth.tif", 0.1)
    assert (tif == depth_mm).all()


def test_colours_come_as_rgb_and_grey_stays_grey(pictures, tmp_path):
    red = np.zeros((4, 5, 3), np.uint8)
    red[..., 2] = 255  # OpenCV writes BGR
    cv2.imwrite(str(tmp_path / "red.png"), red)
    assert images.read_image(tmp_path / "red.png")[0, 0].tolist() == [255, 0, 0]
    assert images.read_image(pictures / "rgba.png").shape == (30, 40, 3)
    assert images.read_image(pictures / "grey.png").shape == (30, 40)


@pytest.mark.parametrize(
    ("name", "read", "words"),
    [
        ("rgb.png", lambda p: images.read_depth_mm(p, 1.0), "3 channels"),
        ("depth.png", images.read_image, "uint16"),
    ],
)
def test_an_image_of_the_wrong_kind_is_refused(pictures, name, read, words):
    with pytest.raises(FormatError, match=words):
        read(pictures / name)


def test_depth_that_is_not_finite_is_refused(tmp_path):
    image = np.ones((4, 4), np.float32)
    image[1, 2] = np.nan
    cv2.imwrite(str(tmp_path / "d.tif"), image)
    with pytest.raises(FormatError, match="1 pixels"):
        images.read_depth_mm(tmp_path / "d.tif", 1.0)


def test_a_missing_image_is_named(tmp_path):
    with pytest.raises(MissingDataError, match=r"000001\.png: no such file"):
        images.read_image(tmp_path / "000001.png")
