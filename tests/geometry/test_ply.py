import re
import struct
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sixd.errors import FormatError
from sixd.geometry import Mesh, read_mesh, read_vertices, write_ply
from tests.strategies import CUBE_MM, meshes

ASCII = """ply
format ascii 1.0
comment made by hand
comment TextureFile my image.png
element vertex 4
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
property float s
property float t
element face 2
property list uchar int vertex_indices
end_header
0 0 0 255 0 0 0 0
1.1 0 0 0 255 0 1 0
1 1 0 0 0 255 1 1
0 1e-3 0 9 9 9 0 1
3 0 1 2
3 0 2 3
"""
QUAD = ASCII.replace("element face 2", "element face 1").replace("3 0 1 2\n3 0 2 3", "4 0 1 2 3")


def read_text(folder: Path, text: str | bytes) -> Mesh:
    path = folder / "mesh.ply"
    path.write_bytes(text if isinstance(text, bytes) else text.encode("latin-1"))
    mesh = read_mesh(path)
    np.testing.assert_array_equal(read_vertices(path), mesh.vertices_mm)
    return mesh


def assert_same(a: Mesh, b: Mesh) -> None:
    for name in ("vertices_mm", "faces", "normals", "colors", "uv", "face_uv"):
        x, y = getattr(a, name), getattr(b, name)
        assert (x is None) == (y is None), name
        if x is not None:
            assert x.tobytes() == y.tobytes(), name


@given(mesh=meshes(), binary=st.booleans())
def test_what_is_written_is_read_back_bit_for_bit(tmp_path_factory, mesh, binary):
    path = tmp_path_factory.mktemp("ply") / "mesh.ply"
    write_ply(path, mesh, binary=binary)
    assert_same(read_mesh(path), mesh)


def test_ascii_numbers_are_read_as_float64(tmp_path):
    assert read_text(tmp_path, ASCII).vertices_mm[1, 0] == 1.1
    assert float(np.float32(1.1)) != 1.1  # what readers that keep float32 would give


def test_all_properties_find_their_place(tmp_path):
    mesh = read_text(tmp_path, ASCII)
    assert mesh.vertices_mm.tolist() == [[0, 0, 0], [1.1, 0, 0], [1, 1, 0], [0, 0.001, 0]]
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert mesh.colors.tolist() == [[255, 0, 0], [0, 255, 0], [0, 0, 255], [9, 9, 9]]
    assert mesh.uv.tolist() == [[0, 0], [1, 0], [1, 1], [0, 1]]
    assert mesh.texture_file == tmp_path / "my image.png"


@pytest.mark.parametrize("names", [("u", "v"), ("texture_u", "texture_v")])
def test_texture_coordinates_go_by_three_names(tmp_path, names):
    text = ASCII.replace("float s", f"float {names[0]}").replace("float t\n", f"float {names[1]}\n")
    assert_same(read_text(tmp_path, text), read_text(tmp_path, ASCII))


def test_line_ends_spaces_and_a_missing_last_newline_do_not_matter(tmp_path):
    plain = read_text(tmp_path, ASCII)
    assert_same(read_text(tmp_path, ASCII.replace("\n", "\r\n")), plain)
    assert_same(read_text(tmp_path, ASCII.replace(" 0 0 ", "\t0   0  ")), plain)
    assert_same(read_text(tmp_path, ASCII.rstrip("\n")), plain)
    assert_same(read_text(tmp_path, ASCII.replace("vertex_indices", "vertex_index")), plain)


def test_polygons_are_cut_into_fans(tmp_path):
    assert_same(read_text(tmp_path, QUAD), read_text(tmp_path, ASCII))
    mixed = ASCII.replace("3 0 1 2\n", "4 0 1 2 3\n")
    assert read_text(tmp_path, mixed).faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 2, 3]]


def test_texture_coordinates_of_corners_follow_their_fan(tmp_path):
    text = QUAD.replace(
        "vertex_indices\nend", "vertex_indices\nproperty list uchar float texcoord\nend"
    ).replace("4 0 1 2 3", "4 0 1 2 3 8 .0 .1 .2 .3 .4 .5 .6 .7")
    assert read_text(tmp_path, text).face_uv.tolist() == [
        [[0.0, 0.1], [0.2, 0.3], [0.4, 0.5]],
        [[0.0, 0.1], [0.4, 0.5], [0.6, 0.7]],
    ]


@pytest.mark.parametrize(("name", "order"), [("little", "<"), ("big", ">")])
@pytest.mark.parametrize("corners", [(0, 1, 2), (0, 1, 2, 3)])
def test_both_byte_orders_and_elements_in_between_are_read(tmp_path, name, order, corners):
    """With an element of lists before the vertices, and a number between the lists of a face."""
    header = f"""ply
format binary_{name}_endian 1.0
element camera 2
property list ushort double view
element vertex 4
property double x
property float y
property short z
element face 1
property list uchar uint vertex_index
property uchar flags
end_header
"""
    body = struct.pack(f"{order}Hd", 1, 0.5) + struct.pack(f"{order}H", 0)
    for x, y, z in [(0.1, 0.5, 3), (1, 2, 3), (4, 5, -6), (7, 8, 9)]:
        body += struct.pack(f"{order}dfh", x, y, z)
    body += struct.pack(f"{order}B{len(corners)}IB", len(corners), *corners, 7)
    mesh = read_text(tmp_path, header.encode() + body)
    assert mesh.vertices_mm.tolist() == [[0.1, 0.5, 3], [1, 2, 3], [4, 5, -6], [7, 8, 9]]
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]][: len(corners) - 2]


def test_a_point_cloud_is_a_mesh_without_faces(tmp_path):
    text = ASCII[: ASCII.index("element face")] + "end_header\n" + ASCII.split("end_header\n")[1]
    assert read_text(tmp_path, text).faces.shape == (0, 3)


BROKEN = {
    "not PLY at all": ("PLY", "not a PLY file"),
    "an empty file": ("", "not a PLY file"),
    "no end of header": ("ply\nformat ascii 1.0\n", "does not end"),
    "no format": (ASCII.replace("format ascii 1.0\n", ""), "no format line"),
    "a newer format": (ASCII.replace("ascii 1.0", "ascii 2.0"), "not understood"),
    "an unknown type": (ASCII.replace("uchar red", "rgb red"), "unknown property"),
    "a negative count": (ASCII.replace("vertex 4", "vertex -4"), "not understood"),
    "no x": (ASCII.replace("float x", "float a"), "no coordinates"),
    "no vertex element": (ASCII.replace("vertex 4", "point 4"), "no vertices"),
    "zero vertices": (
        ASCII.replace("vertex 4", "vertex 0").replace("face 2", "face 0"),
        "the mesh is empty",
    ),
    "fewer lines than promised": (ASCII.replace("face 2", "face 3"), "ends within its 3"),
    "far fewer lines": (ASCII.replace("face 2", "face 99999999999999"), "ends within"),
    "a word among numbers": (ASCII.replace("1.1 0 0", "1.1 zero 0"), ":18: bad vertex"),
    "a number too many": (ASCII.replace("1.1 0 0 ", "1.1 0 0 0 "), ":18: bad vertex"),
    "an empty line": (ASCII.replace("1.1 0 0", "\n1.1 0 0"), ":18: bad vertex"),
    "a NaN": (ASCII.replace("1.1 0 0", "nan 0 0"), "not finite"),
    "an infinity": (ASCII.replace("1.1 0 0", "1e999 0 0"), "not finite"),
    "a face of nobody": (ASCII.replace("3 0 2 3", "3 0 2 4"), "do not exist"),
    "a face before the first": (ASCII.replace("3 0 2 3", "3 0 2 -1"), "do not exist"),
    "half an index": (ASCII.replace("3 0 2 3", "3 0 2 2.5"), ":22: not a face"),
    "a face of two": (ASCII.replace("3 0 2 3", "2 0 2"), ":22: not a face"),
    "a short face": (ASCII.replace("3 0 2 3", "3 0 2"), ":22: bad face"),
    "a long face": (ASCII.replace("3 0 2 3", "3 0 2 3 3"), ":22: bad face"),
    "a colour above 255": (ASCII.replace(" 255 0 0 ", " 256 0 0 "), "colours are not bytes"),
    "faces without indices": (ASCII.replace("vertex_indices", "neighbours"), "have no vertices"),
    "two elements of a name": (ASCII.replace("element face 2", "element vertex 4"), "one of each"),
    "strips": (ASCII.replace("element face 2", "element tristrips 2"), "strips"),
}


@pytest.mark.parametrize(("text", "message"), BROKEN.values(), ids=BROKEN)
def test_a_broken_file_is_named_with_what_was_expected(tmp_path, text, message):
    with pytest.raises(FormatError, match=re.escape(message)) as caught:
        read_text(tmp_path, text)
    (problem,) = caught.value.problems
    assert problem.file == str(tmp_path / "mesh.ply")
    assert problem.expected
    assert problem.fix


SEEDS = [ASCII.encode(), QUAD.encode()]


@pytest.fixture(scope="module")
def fuzz_path(tmp_path_factory):
    """Binary samples join the ASCII ones here; the same file is written over and over."""
    path = tmp_path_factory.mktemp("fuzz") / "mesh.ply"
    colors, uv = np.full((8, 3), 7, np.uint8), CUBE_MM[:, :2]
    face_uv = np.zeros((2, 3, 2))
    write_ply(path, Mesh(CUBE_MM, np.array([[0, 1, 2], [5, 6, 7]]), CUBE_MM, colors, uv))
    SEEDS.append(path.read_bytes())
    write_ply(path, Mesh(CUBE_MM / 3, np.array([[0, 1, 2], [5, 6, 7]]), face_uv=face_uv))
    SEEDS.append(path.read_bytes())
    return path


def only_a_mesh_or_a_format_error(path: Path, data: bytes) -> None:
    path.write_bytes(data)
    for read in (read_mesh, lambda p: Mesh(read_vertices(p), np.zeros((0, 3), int))):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                mesh = read(path)
        except FormatError as error:
            named = str(path) in str(error)
            assert named, error  # noqa: PT017 - pytest.raises would demand it
            continue
        assert len(mesh.vertices_mm) > 0
        assert np.isfinite(mesh.vertices_mm).all()
        assert mesh.faces.min(initial=0) >= 0
        assert mesh.faces.max(initial=0) < len(mesh.vertices_mm)


@settings(max_examples=300)
@given(data=st.binary(max_size=400), head=st.sampled_from([b"", b"ply\n", ASCII[:330].encode()]))
def test_no_bytes_at_all_bring_more_than_a_format_error(fuzz_path, data, head):
    only_a_mesh_or_a_format_error(fuzz_path, head + data)


words = st.sampled_from(
    b"0 -1 3 1e9 4294967296 99999999999999999999 nan inf x float uchar int double list element "
    b"property vertex face texcoord vertex_indices comment format ascii binary_little_endian "
    b"binary_big_endian end_header \r \x00 \xff \x85".split(b" ")
)


@settings(max_examples=600)
@given(
    seed=st.integers(0, 3),
    edits=st.lists(st.tuples(st.integers(0, 10**4), words, st.booleans()), min_size=1, max_size=4),
    cut=st.one_of(st.none(), st.integers(0, 2000)),
)
def test_no_mutation_of_a_valid_file_brings_more_than_a_format_error(fuzz_path, seed, edits, cut):
    data = SEEDS[seed]
    for place, word, whole_word in edits:
        if whole_word:  # of the text in front, else of any byte
            spans = [m.span() for m in re.finditer(rb"\S+", data)]
            start, end = spans[place % len(spans)] if spans else (0, 0)
        else:
            start = place % max(len(data), 1)
            end = start + len(word)
        data = data[:start] + word + data[end:]
    only_a_mesh_or_a_format_error(fuzz_path, data[:cut])
