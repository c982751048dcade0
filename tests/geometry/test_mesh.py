from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from scipy.spatial.distance import pdist

from sixd.errors import FormatError, MissingDataError, OutputError, ShapeError, UsageError
from sixd.geometry import (
    Mesh,
    bounding_box_mm,
    mesh_diameter_mm,
    read_mesh,
    read_vertices,
    write_ply,
)
from tests.strategies import CUBE_MM, points, poses


@given(p=points())
def test_the_diameter_is_the_largest_of_all_distances(p):
    """Points, lines, planes and repeats included."""
    expected = pdist(p).max() if len(p) > 1 else 0.0
    for many in (0, len(p)):  # by the hull, and without it
        with mock.patch("sixd.geometry.mesh.MANY_VERTICES", many):
            np.testing.assert_allclose(mesh_diameter_mm(p), expected, rtol=1e-12, atol=1e-12)


@given(p=points(3), pose=poses(1))
def test_the_diameter_does_not_depend_on_the_frame(p, pose):
    moved = pose[0].apply(p)
    np.testing.assert_allclose(mesh_diameter_mm(moved), mesh_diameter_mm(p), atol=1e-9)


def test_the_diameter_of_points_on_a_sphere_compares_all_of_them():
    """Every point is on the hull: the chunks must meet every pair."""
    p = np.random.default_rng(0).normal(size=(3000, 3))
    p /= np.linalg.norm(p, axis=1, keepdims=True)
    assert mesh_diameter_mm(p) == pytest.approx(pdist(p).max(), rel=1e-12)


def test_the_box_of_a_cube_is_the_cube():
    lowest, size = bounding_box_mm(CUBE_MM)
    assert lowest.tolist() == [-50, -50, -50]
    assert size.tolist() == [100, 100, 100]


@pytest.mark.oracle
def test_diameters_are_those_the_reference_toolkit_wrote(shared_data):
    import json

    folder = shared_data / "peer_synth" / "dataset" / "lmo" / "models_eval"
    for obj_id, entry in json.loads((folder / "models_info.json").read_text()).items():
        vertices_mm = read_vertices(folder / f"obj_{int(obj_id):06d}.ply")
        assert mesh_diameter_mm(vertices_mm) == pytest.approx(entry["diameter"], abs=1e-9)
        lowest, size = bounding_box_mm(vertices_mm)
        np.testing.assert_allclose(lowest, [entry[f"min_{k}"] for k in "xyz"], atol=1e-9)
        np.testing.assert_allclose(size, [entry[f"size_{k}"] for k in "xyz"], atol=1e-9)


@pytest.mark.oracle
def test_real_meshes_read_as_an_independent_reader_reads_them(shared_data):
    """To float32, which is what plyfile keeps of an ASCII number."""
    plyfile = pytest.importorskip("plyfile")
    paths = [
        *sorted((shared_data / "lmo" / "models_eval").glob("*.ply"))[:2],
        shared_data / "hope_bbq" / "hope_000002.ply",
    ]
    for path in paths:
        mesh, other = read_mesh(path), plyfile.PlyData.read(str(path))
        vertex = other["vertex"]
        expected = np.stack([vertex[k] for k in "xyz"], axis=1)
        np.testing.assert_array_equal(mesh.vertices_mm.astype(np.float32), expected)
        np.testing.assert_array_equal(mesh.faces, np.stack(other["face"]["vertex_indices"]))
        assert (mesh.colors is not None) == ("red" in vertex.data.dtype.names)
        assert (mesh.uv is not None) == ("texture_u" in vertex.data.dtype.names)


def test_a_textured_mesh_knows_its_image(shared_data):
    mesh = read_mesh(shared_data / "hope_bbq" / "hope_000002.ply")
    assert mesh.texture_file == shared_data / "hope_bbq" / "hope_000002.png"
    assert mesh.corner_uv.shape == (len(mesh.faces), 3, 2)


@pytest.mark.parametrize("suffix", [".obj", ".off", ".stl", ".glb"])
def test_other_formats_keep_their_vertices_through_trimesh(tmp_path, suffix):
    trimesh = pytest.importorskip("trimesh")
    faces = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5]])
    path = tmp_path / f"cube{suffix}"
    trimesh.Trimesh(CUBE_MM, faces, process=False).export(path)
    mesh = read_mesh(path)
    corners = mesh.vertices_mm[mesh.faces]
    np.testing.assert_allclose(np.sort(corners.ravel()), np.sort(CUBE_MM[faces].ravel()))
    np.testing.assert_array_equal(read_vertices(path), mesh.vertices_mm)


@pytest.mark.parametrize("name", ["x.obj", "x.glb", "x.stl", "x.off", "x.xyzzy", "x"])
def test_garbage_in_another_format_is_a_format_error_with_the_path(tmp_path, name):
    (tmp_path / name).write_bytes(b"\x00\x01 no mesh at all \xff" * 9)
    with pytest.raises(FormatError, match=name):
        read_mesh(tmp_path / name)


@pytest.mark.parametrize("name", ["none.ply", "none.obj", "."])
def test_a_file_that_cannot_be_read_is_missing_data(tmp_path, name):
    with pytest.raises((MissingDataError, FormatError), match="cannot be read"):
        read_mesh(tmp_path / name)


def test_a_mesh_refuses_arrays_that_do_not_fit():
    triangle = np.array([[0, 1, 2]])
    with pytest.raises(ShapeError, match="vertices_mm"):
        Mesh(np.zeros((3, 2)), triangle)
    with pytest.raises(ShapeError, match="colors must have shape"):
        Mesh(np.zeros((3, 3)), triangle, colors=np.zeros((2, 3), np.uint8))
    with pytest.raises(UsageError, match="indices from 0 to 2"):
        Mesh(np.zeros((3, 3)), triangle + 1)
    with pytest.raises(UsageError, match="finite"):
        Mesh(np.full((3, 3), np.nan), triangle)


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "mesh.ply"
    write_ply(path, Mesh(CUBE_MM, np.zeros((0, 3), int)))
    before = path.read_bytes()

    def fail(self: Path, target: Path) -> Path:
        raise OSError("disk full")

    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises(OutputError, match="disk full"):
        write_ply(path, Mesh(CUBE_MM / 3, np.zeros((0, 3), int)))
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["mesh.ply"]
