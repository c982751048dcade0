"""Fixtures that every room's tests share."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

# Deadlines measure the machine, not the law: the first call of a kernel compiles it.
settings.register_profile("sixd", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("sixd")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real data beside the checkout; tests that need it skip where it is absent."""
    default = Path(__file__).resolve().parents[2] / "shared" / "data"
    path = Path(os.environ.get("SIXD_SHARED_DATA", default))
    if not path.is_dir():
        pytest.skip(f"needs the shared data, none at {path}")
    return path


@pytest.fixture(scope="session")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A complete dataset, rendered here: 2 scenes, 3 images each, 160 x 120 px; only read it."""
    from sixd.synth.demo_dataset import make_demo_dataset

    folder = tmp_path_factory.mktemp("tiny") / "sixdemo"
    return make_demo_dataset(folder, seed=0, scenes=2, images_per_scene=3, size_px=(160, 120))
