"""A tiny dataset that any room's tests can score; lift it into ``tests/conftest.py`` to share."""

from __future__ import annotations

from pathlib import Path

import pytest

from sixd.synth.demo import make_demo_dataset

TINY_PX = (160, 120)


def make_tiny_dataset(folder: Path, seed: int = 0) -> Path:
    """Two scenes of three images, 160 x 120 px, six objects; one is absent from each scene."""
    return make_demo_dataset(
        folder / "tiny", seed=seed, scenes=2, images_per_scene=3, size_px=TINY_PX
    )


@pytest.fixture(scope="session")
def tiny_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the tiny dataset; read it, do not write into it."""
    return make_tiny_dataset(tmp_path_factory.mktemp("tiny"))
