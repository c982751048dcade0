from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from sixd.datasets.opening import open_dataset

SIZE_PX = (64, 48)


@pytest.fixture(scope="session")
def toy_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Scene 2 with images 3, 4, 7 (3 and 4 are targets) of 64 x 48 px, objects 5 and 6."""
    folder = tmp_path_factory.mktemp("data") / "toy"
    scene = folder / "test" / "000002"
    (scene / "rgb").mkdir(parents=True)
    K = [100.0, 0, 32, 0, 100, 24, 0, 0, 1]
    cameras = {str(i): {"cam_K": K, "depth_scale": 1.0} for i in (3, 4, 7)}
    (scene / "scene_camera.json").write_text(json.dumps(cameras))
    for im_id in (3, 4, 7):
        image = np.zeros((SIZE_PX[1], SIZE_PX[0], 3), np.uint8)
        assert cv2.imwrite(str(scene / "rgb" / f"{im_id:06d}.png"), image)
    (folder / "dataset.toml").write_text("objects = [5, 6]\nmax_estimates_per_image = 3\n")
    targets = [
        {"scene_id": 2, "im_id": im_id, "obj_id": obj_id, "inst_count": 1}
        for im_id, obj_id in ((3, 5), (3, 6), (4, 5))
    ]
    (folder / "test_targets_bop19.json").write_text(json.dumps(targets))
    images = [{"scene_id": 2, "im_id": im_id} for im_id in (3, 4)]
    (folder / "test_targets_bop24.json").write_text(json.dumps(images))
    return folder


@pytest.fixture
def toy(toy_folder: Path):  # type: ignore[no-untyped-def]
    return open_dataset(toy_folder)
