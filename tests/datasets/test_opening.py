from __future__ import annotations

import numpy as np
import pytest

from sixd.datasets import open_dataset
from sixd.datasets.truth import read_truth
from sixd.errors import FormatError, MissingDataError, UsageError
from sixd.geometry import Fisheye624Camera, PinholeCamera
from tests.datasets.folders import (
    FISHEYE,
    K,
    write_classic,
    write_image,
    write_json,
    write_models,
    write_scene,
)


def test_a_folder_that_no_spec_names_needs_no_file_of_its_own(tmp_path):
    path = write_classic(tmp_path / "bins", scenes=(1, 12))
    dataset = open_dataset(path)
    assert (dataset.name, dataset.scene_ids, dataset.object_ids) == ("bins", (1, 12), (1, 2))
    assert (dataset.sensor, dataset.modality, dataset.image_size_px) == ("camera", "rgb", (8, 6))
    assert dataset.has_depth
    assert dataset.spec.vsd_delta_mm == 15.0
    assert dataset.image_ids(12) == (0, 3)
    assert dataset.depth_mm(1, 3).tolist() == np.full((6, 8), 6.5).tolist()
    assert dataset.rgb(1, 3).shape == (6, 8, 3)
    assert len(read_truth(dataset)) == 12
    assert dataset.model(1).vertices_mm.shape == (3, 3)


def test_a_dataset_toml_says_what_the_folder_cannot(tmp_path):
    path = write_classic(tmp_path / "bins")
    (path / "dataset.toml").write_text(
        'title = "My bins"\nvsd_delta_mm = 5.0\nsymmetric_objects = [2]\nobjects = "1-2"\n'
        "max_estimates_per_image = 7\n[splits.test]\ntruth = 'private'\n"
    )
    dataset = open_dataset(path)
    assert (dataset.spec.title, dataset.spec.vsd_delta_mm) == ("My bins", 5.0)
    assert [dataset.is_symmetric(o) for o in (1, 2)] == [False, True]
    assert dataset.spec.max_estimates_per_image == 7
    assert not dataset.truth_is_public
    assert dataset.image_size_px == (8, 6)


def test_without_a_spec_objects_are_symmetric_if_their_model_says_so(tmp_path):
    path = write_classic(tmp_path / "bins")
    write_models(path / "models_eval", (3,), symmetries_continuous=[
        {"axis": [0, 0, 1], "offset": [0, 0, 0]}])  # fmt: skip
    assert open_dataset(path).is_symmetric(3)


def test_models_are_taken_where_there_is_no_models_eval(tmp_path):
    write_scene(tmp_path / "mine" / "test" / "000001")
    write_models(tmp_path / "mine" / "models", (4,))
    assert open_dataset(tmp_path / "mine").model(4).path.parent.name == "models"


def test_a_known_dataset_never_falls_back_to_other_models(tmp_path):
    write_scene(tmp_path / "lmo" / "test" / "000002", size_px=(640, 480))
    write_models(tmp_path / "lmo" / "models", (1,))
    with pytest.raises(MissingDataError, match="models_eval"):
        open_dataset(tmp_path / "lmo").model(1)


def test_sensors_are_told_by_the_suffix_of_their_files(tmp_path):
    for scene in ("000000", "000004"):
        for name, modalities in (("top", ("gray", "depth")), ("left_top", ("rgb",))):
            images = {f"{m}_{name}": ".png" for m in modalities}
            write_scene(tmp_path / "rig/val" / scene, suffix=f"_{name}", images=images)
            (tmp_path / "rig/val" / scene / f"mask_{name}").mkdir()
    with pytest.raises(UsageError, match="several sensors: left_top, top"):
        open_dataset(tmp_path / "rig", "val")
    dataset = open_dataset(tmp_path / "rig", "val", sensor="top")
    assert (dataset.sensor, dataset.modality, dataset.scene_ids) == ("top", "gray", (0, 4))
    assert dataset.rgb(4, 3).shape == (6, 8)
    assert dataset.depth_mm(4, 3)[0, 0] == 6.5
    assert dataset.annotation_path("gt", 4).name == "scene_gt_top.json"
    other = open_dataset(tmp_path / "rig", "val", sensor="left_top")
    assert (other.modality, other.has_depth) == ("rgb", False)
    (tmp_path / "rig" / "dataset.toml").write_text('[splits.val]\neval_sensors = ["top"]\n')
    assert open_dataset(tmp_path / "rig", "val").sensor == "top"
    with pytest.raises(UsageError, match="did you mean top"):
        open_dataset(tmp_path / "rig", "val", sensor="topp")
    with pytest.raises(UsageError, match="no rgb images"):
        open_dataset(tmp_path / "rig", "val", modality="rgb")
    (tmp_path / "rig" / "dataset.toml").write_text('[splits.val]\neval_sensors = ["tip"]\n')
    with pytest.raises(FormatError, match="eval_sensors: names a sensor that is not there"):
        open_dataset(tmp_path / "rig", "val")


def test_the_industrial_layout_of_a_known_dataset_is_read(tmp_path):
    scene = tmp_path / "ipd" / "val" / "000003"
    size = (2064, 1544)
    for name in ("photoneo", "cam1"):
        images = {f"rgb_{name}": ".png", f"depth_{name}": ".png"}
        write_scene(scene, suffix=f"_{name}", images=images, im_ids=(0,), size_px=size)
    dataset = open_dataset(tmp_path / "ipd", "val")
    assert (dataset.sensor, dataset.modality) == ("photoneo", "rgb")
    assert dataset.image_size_px == (2064, 1544)
    assert dataset.image_path(3, 0).parent.name == "rgb_photoneo"
    assert open_dataset(tmp_path / "ipd", "val", sensor="cam1").sensor == "cam1"


def test_a_split_that_a_spec_does_not_describe_is_read_by_its_structure(tmp_path):
    scene = tmp_path / "ipd" / "train_pbr" / "000000"
    for name in ("cam1", "cam2"):
        write_scene(scene, suffix=f"_{name}", images={f"rgb_{name}": ".jpg"}, size_px=(24, 24))
    dataset = open_dataset(tmp_path / "ipd", "train", split_type="pbr")
    assert (dataset.sensor, dataset.image_size_px) == ("cam1", (24, 24))
    assert dataset.image_path(0, 3).name == "000003.jpg"


def test_the_scored_sensor_may_depend_on_the_scene(tmp_path):
    split = tmp_path / "hot3d" / "test"
    for scene_id, modality in ((1288, "gray1"), (3365, "rgb")):
        write_scene(split / f"{scene_id:06d}", suffix=f"_{modality}", images={modality: ".jpg"},
                    camera={"cam_model": FISHEYE}, size_px=(1280, 1024) if modality == "gray1"
                    else (1408, 1408), im_ids=(5,))  # fmt: skip
    dataset = open_dataset(tmp_path / "hot3d")
    assert (dataset.sensor, dataset.modality, dataset.image_size_px) == (None, None, None)
    assert [dataset.view(s).sensor for s in dataset.scene_ids] == ["quest3", "aria"]
    assert dataset.image_size_of(1288) == (1280, 1024)
    assert dataset.image_size_of(3365) == (1408, 1408)
    camera = dataset.cameras(3365)[5]
    assert isinstance(camera.camera, Fisheye624Camera)
    assert (camera.K, camera.depth_scale, dataset.has_depth) == (None, None, False)
    assert len(read_truth(dataset)) == 6
    with pytest.raises(MissingDataError, match="took scene 9999"):
        dataset.view(9999)
    assert open_dataset(tmp_path / "hot3d", sensor="aria").scene_ids == (3365,)


def test_streams_with_their_own_files_are_read_without_a_spec(tmp_path):
    split = tmp_path / "glasses" / "test"
    for scene_id, streams in ((1, ("rgb", "gray1")), (2, ("gray1", "gray2"))):
        for m in streams:
            camera = {"cam_model": FISHEYE}
            write_scene(split / f"{scene_id:06d}", suffix=f"_{m}", images={m: ".jpg"},
                        camera=camera)  # fmt: skip
    dataset = open_dataset(tmp_path / "glasses")
    assert [dataset.view(s).modality for s in (1, 2)] == [
        "rgb" if s == 1 else "gray1" for s in (1, 2)
    ]
    assert dataset.annotation_path("camera", 2).name == "scene_camera_gray1.json"
    assert dataset.image_size_of(2) == (8, 6)
    chosen = open_dataset(tmp_path / "glasses", modality="gray1")
    assert chosen.annotation_path("gt", 1).name == "scene_gt_gray1.json"


def test_the_image_size_of_a_fisheye_camera_needs_no_image(tmp_path):
    scene = tmp_path / "glasses" / "test" / "000001"
    write_scene(
        scene, suffix="_rgb", images={"rgb": ".jpg"}, camera={"cam_model": FISHEYE}, im_ids=()
    )
    write_scene(scene, suffix="_rgb", images={"x": ".jpg"}, camera={"cam_model": FISHEYE})
    assert open_dataset(tmp_path / "glasses").image_size_px == (8, 6)


def test_an_image_size_that_nothing_tells_is_asked_for(tmp_path):
    scene = tmp_path / "bins" / "test" / "000001"
    write_scene(scene, images={"notes": ".png"})
    for file in (scene / "notes").iterdir():
        file.unlink()
    dataset = open_dataset(tmp_path / "bins")
    assert dataset.image_size_px is None
    with pytest.raises(MissingDataError, match=r"sensors\.camera\.image_size_px"):
        dataset.image_size_of(1)
    (tmp_path / "bins" / "dataset.toml").write_text("[sensors.camera]\nimage_size_px = [64, 48]\n")
    assert open_dataset(tmp_path / "bins").image_size_px == (64, 48)


def test_the_default_type_of_a_split_is_found_with_and_without_its_suffix(tmp_path):
    for root, folder in (("a", "test_primesense"), ("b", "test")):
        write_scene(tmp_path / root / "tless" / folder / "000001", size_px=(720, 540))
        dataset = open_dataset(tmp_path / root / "tless")
        assert (dataset.split_type, dataset.folder.name) == ("primesense", folder)
        assert dataset.image_size_px == (720, 540)


def test_another_type_is_never_taken_silently(tmp_path):
    write_scene(tmp_path / "tless" / "test_canon" / "000001")
    with pytest.raises(UsageError, match="has the splits test_canon"):
        open_dataset(tmp_path / "tless")
    assert open_dataset(tmp_path / "tless", split_type="canon").sensor == "canon"


def test_an_own_dataset_with_one_typed_split_needs_no_type(tmp_path):
    write_scene(tmp_path / "mine" / "train_pbr" / "000001")
    assert open_dataset(tmp_path / "mine", "train").split_type == "pbr"
    write_scene(tmp_path / "mine" / "train_real" / "000001")
    with pytest.raises(UsageError, match="train_pbr, train_real"):
        open_dataset(tmp_path / "mine", "train")


def test_images_of_another_size_than_the_spec_says_are_refused(tmp_path):
    write_scene(tmp_path / "lmo" / "test" / "000002", size_px=(320, 240))
    with pytest.raises(FormatError) as caught:
        open_dataset(tmp_path / "lmo").image_size_of(2)
    problem = caught.value.problems[0]
    assert (problem.expected, problem.got) == ("640x480", "320x240")


def test_images_with_another_extension_than_the_spec_says_are_found(tmp_path):
    images = {"rgb": ".jpg", "depth": ".png"}
    write_scene(tmp_path / "lmo" / "test" / "000002", images=images, size_px=(640, 480))
    dataset = open_dataset(tmp_path / "lmo")
    assert dataset.image_path(2, 3).name == "000003.jpg"
    assert dataset.rgb(2, 3).shape == (480, 640, 3)


def test_a_dataset_toml_can_name_the_spec_of_a_renamed_folder(tmp_path):
    write_scene(tmp_path / "copy-of-it" / "test" / "000002", size_px=(640, 480))
    (tmp_path / "copy-of-it" / "dataset.toml").write_text('name = "lmo"\n')
    dataset = open_dataset(tmp_path / "copy-of-it")
    assert (dataset.name, dataset.spec.title, len(dataset.object_ids)) == ("lmo", "LM-O", 8)


def test_names_are_looked_up_in_bop_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_scene(tmp_path / "bop" / "lmo" / "test" / "000002", size_px=(640, 480))
    assert open_dataset("lmo", bop_path=tmp_path / "bop").path == tmp_path / "bop" / "lmo"
    (tmp_path / "lmo").mkdir()  # an output folder of that name is not the dataset
    assert open_dataset("lmo", bop_path=tmp_path / "bop").path == tmp_path / "bop" / "lmo"
    monkeypatch.chdir(tmp_path / "bop" / "lmo")
    assert open_dataset(".").name == "lmo"


def test_an_unknown_dataset_is_answered_with_names_and_places(tmp_path):
    with pytest.raises(UsageError) as caught:
        open_dataset("tles", bop_path=tmp_path)
    message = str(caught.value)
    assert "did you mean tless" in message
    assert str(tmp_path / "tles") in message
    with pytest.raises(UsageError, match="BOP_PATH"):
        open_dataset("tless")


def test_a_folder_above_or_below_the_dataset_is_recognised(tmp_path):
    write_classic(tmp_path / "lmo")
    with pytest.raises(UsageError, match=r"holds datasets: give one of lmo"):
        open_dataset(tmp_path)
    with pytest.raises(UsageError, match="is itself a split"):
        open_dataset(tmp_path / "lmo" / "test")
    with pytest.raises(UsageError, match="has the splits test"):
        open_dataset(tmp_path / "lmo", "val")
    (tmp_path / "empty").mkdir()
    with pytest.raises(UsageError, match=r"scene_camera\.json"):
        open_dataset(tmp_path / "empty")


def test_scenes_without_cameras_are_no_dataset(tmp_path):
    write_classic(tmp_path / "bins")
    (tmp_path / "bins/test/000001/scene_camera.json").unlink()
    with pytest.raises(UsageError, match=r"scene_camera\*\.json"):
        open_dataset(tmp_path / "bins")


def test_depth_without_a_unit_is_refused(tmp_path):
    for scale in ({}, {"depth_scale": 0}):
        write_scene(tmp_path / "bins/test/000001", camera={"cam_K": K, **scale})
        with pytest.raises(MissingDataError, match="no positive depth_scale"):
            open_dataset(tmp_path / "bins").depth_mm(1, 0)


def test_files_beside_scenes_and_odd_folders_are_no_scenes(tmp_path):
    path = write_classic(tmp_path / "bins")
    for name in ("2", "0000003", "obj_000001", "x"):
        (path / "test" / name).mkdir()
    write_json(path / "test" / "000009", {})
    assert open_dataset(path).scene_ids == (1,)


def test_cameras_of_one_k_are_one_object_and_are_decoded_once(tmp_path):
    dataset = open_dataset(write_classic(tmp_path / "bins"))
    cameras = dataset.cameras(1)
    assert cameras is dataset.cameras(1)
    assert isinstance(cameras[0].camera, PinholeCamera)
    assert cameras[0].camera is cameras[3].camera
    assert cameras[0].K.tolist() == [[500, 0, 4], [0, 510, 3], [0, 0, 1]]


def test_gray_images_beside_rgb_folders_stay_what_their_file_is(tmp_path):
    path = write_classic(tmp_path / "bins")
    write_image(path / "test/000001/rgb/000007.png", 3, "gray")
    assert open_dataset(path).rgb(1, 7).shape == (6, 8)
