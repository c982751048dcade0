from __future__ import annotations

import gzip
import hashlib
import json
import subprocess
import sys
import zlib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sixd.errors import FormatError, Problem, SixdError
from sixd.results import (
    Detections,
    Limits,
    PoseEstimates,
    check_file,
    fix_file,
    read_results,
    write_results,
)
from tests.results.makers import ROW, csv_file

PACKED_ROW = gzip.compress(ROW.encode(), mtime=0)
DETECTION = {"scene_id": 2, "image_id": 3, "category_id": 5, "score": 0.5, "bbox": [1, 2, 30, 40]}


def sha256_of_rows(table: PoseEstimates | Detections) -> str:
    columns = [column for name, column in table._columns() if name not in ("line", "entry")]
    return hashlib.sha256(
        b"".join(c.tobytes() if hasattr(c, "tobytes") else repr(c).encode() for c in columns)
    ).hexdigest()


def only_problem(path: Path, limits: Limits | None = None) -> Problem:
    with pytest.raises(FormatError) as caught:
        read_results(path, limits=limits)
    (problem,) = caught.value.problems
    assert problem.file == str(path)
    assert problem.expected
    assert problem.got
    assert problem.fix
    return problem


@pytest.mark.parametrize("name", ["x.csv", "x.json", "x.gz", "x", "a_b.c_d.e"])
@pytest.mark.parametrize("packed", [False, True])
def test_the_content_decides_not_the_name(tmp_path: Path, name: str, packed: bool) -> None:
    path = tmp_path / name
    for text, kind in ((f"{ROW}\n", PoseEstimates), (f"\n [{json.dumps(DETECTION)}]", Detections)):
        path.write_bytes(gzip.compress(text.encode()) if packed else text.encode())
        assert isinstance(read_results(path), kind)


def test_what_is_written_is_read_back_as_the_same_kind(tmp_path: Path) -> None:
    poses = read_results(csv_file(tmp_path / "in.csv", ROW))
    (tmp_path / "in.json").write_text(json.dumps([DETECTION]))
    for table in (poses, read_results(tmp_path / "in.json")):
        write_results(tmp_path / "out.gz", table)
        again = read_results(tmp_path / "out.gz")
        assert type(again) is type(table)
        assert sha256_of_rows(again) == sha256_of_rows(table)


def test_a_bom_is_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "x"
    for text in (f"{ROW}\n", f"[{json.dumps(DETECTION)}]"):
        path.write_bytes(b"\xef\xbb\xbf" + text.encode())
        assert len(read_results(path)) == 1


@pytest.mark.parametrize(
    "text",
    [b"", b"\n \r\n\t", b"\xef\xbb\xbf", gzip.compress(b"", mtime=0)],
    ids=["nothing", "blanks", "BOM", "gzip of nothing"],
)
def test_an_empty_file_is_told(tmp_path: Path, text: bytes) -> None:
    (tmp_path / "x").write_bytes(text)
    assert only_problem(tmp_path / "x").code == "empty-file"


@pytest.mark.parametrize(
    ("text", "code", "words"),
    [
        (ROW.encode("utf-16"), "encoding", "ff fe"),
        (b"PK\x03\x04 and so on", "not-text", "zip"),
        (b"\xfd7zXZ\x00", "not-text", "xz"),
        (b"\x89PNG\r\n\x1a\n\0\0", "not-text", "byte 8 is zero"),
        (
            gzip.compress(PACKED_ROW, mtime=0),
            "not-text",
            "gzip inside gzip",
        ),
        (gzip.compress(b"1,2," * 9000, mtime=0)[:-9], "truncated-gzip", "compressed bytes"),
        (PACKED_ROW[:5], "truncated-gzip", "compressed bytes"),
        (PACKED_ROW + b"more", "corrupt-gzip", "byte"),
    ],
    ids=["UTF-16", "zip", "xz", "png", "gzip twice", "cut gzip", "cut header", "gzip and more"],
)
def test_what_is_no_text_is_told(tmp_path: Path, text: bytes, code: str, words: str) -> None:
    (tmp_path / "x").write_bytes(text)
    if code == "truncated-gzip":  # what came before is read, so it may have problems of its own
        problem = check_file(tmp_path / "x").problems[0]
    else:
        problem = only_problem(tmp_path / "x")
    assert problem.code == code
    assert words in problem.got


def test_a_damaged_gzip_is_told_by_its_checksum(tmp_path: Path) -> None:
    packed = bytearray(gzip.compress(f"{ROW}\n".encode()))
    packed[-6] ^= 1
    (tmp_path / "x").write_bytes(packed)
    assert only_problem(tmp_path / "x").code == "corrupt-gzip"


def test_joined_and_padded_gzips_are_one_text(tmp_path: Path) -> None:
    (tmp_path / "x").write_bytes(gzip.compress(f"{ROW}\n".encode()) * 2 + b"\0" * 100)
    assert len(read_results(tmp_path / "x")) == 2


def test_a_truncated_gzip_says_what_it_is_and_keeps_the_problems_before(tmp_path: Path) -> None:
    rows = "\n".join([ROW, "1,2", *[f"{i},{ROW[2:]}" for i in range(9000)]]).encode()
    (tmp_path / "x").write_bytes(gzip.compress(rows)[:-2000])
    report = check_file(tmp_path / "x")
    assert [p.code for p in report.problems][:1] == ["truncated-gzip"]
    assert "column-count" in [p.code for p in report.problems]
    assert not report.ok


@pytest.mark.parametrize("tail", [b"", b"anything"], ids=["whole", "with a tail"])
def test_a_bomb_is_refused_while_it_inflates(tmp_path: Path, tail: bytes) -> None:
    packer = zlib.compressobj(9, wbits=31)
    bomb = (
        b"".join([packer.compress(f"{ROW}\n".encode() * 20_000) for _ in range(48)])
        + packer.flush()
    )
    (tmp_path / "x").write_bytes(bomb + tail)
    problem = only_problem(tmp_path / "x")
    assert problem.code == "gzip-ratio"
    assert "200 times" in problem.expected


@pytest.mark.parametrize("packed", [False, True])
def test_a_text_that_is_too_long_is_refused(tmp_path: Path, packed: bool) -> None:
    text = f"{ROW}\n".encode() * 1000
    (tmp_path / "x").write_bytes(gzip.compress(text, 0) if packed else text)
    assert only_problem(tmp_path / "x", Limits(inflated_bytes=9_999)).code == "too-large"
    assert len(read_results(tmp_path / "x")) == 1000


@pytest.mark.parametrize("text", [f"{ROW}\n" * 11, json.dumps([DETECTION] * 11)])
def test_too_many_rows_are_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "x").write_text(text)
    assert only_problem(tmp_path / "x", Limits(rows=10)).code == "too-many-rows"
    assert len(read_results(tmp_path / "x", limits=Limits(rows=11))) == 11


def test_blank_and_broken_lines_are_rows_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sixd.results.results_text.BLOCK_BYTES", 1000)
    (tmp_path / "x").write_bytes(f"{ROW}\n".encode() + b"\n" * 5000)
    assert only_problem(tmp_path / "x", Limits(rows=100)).code == "too-many-rows"


def test_nothing_but_blanks_is_not_read_to_its_end(tmp_path: Path) -> None:
    (tmp_path / "x").write_bytes(b"\n" * 3_000_000 + ROW.encode())
    assert only_problem(tmp_path / "x").code == "not-text"


def test_a_line_without_end_is_not_held_in_memory(tmp_path: Path) -> None:
    path = tmp_path / "x"
    path.write_bytes(ROW.encode() + b"\n" + b"7" * 5_000_000 + b"\n" + ROW.encode())
    with pytest.raises(FormatError) as caught:
        read_results(path)
    (problem,) = caught.value.problems
    assert (problem.code, problem.line) == ("line-too-long", 2)


def test_the_import_is_light() -> None:
    code = (
        "import sys, sixd.results; heavy = {'numba', 'scipy', 'polars', 'cv2', 'trimesh', 'rich', "
        "'click', 'hotcoco'} & set(sys.modules); sys.exit(str(heavy) if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


# --- any bytes at all: an answer or a SixdError ---


def answers(path: Path) -> None:
    """Read, check and mend; nothing but a `SixdError` may come out."""
    try:
        n_rows = len(read_results(path))
    except SixdError:
        n_rows = -1
    report = check_file(path)
    assert (n_rows >= 0) == (report.table is not None)
    assert n_rows < 0 or report.n_rows == n_rows
    assert json.dumps(report.to_dict())
    out = path.with_name("mended")
    fixed = fix_file(path, out)
    assert fixed.written == (report.table is not None)
    if fixed.written:
        left = {p.code for p in fixed.left}
        assert left <= {p.code for p in report.problems} - {"bom", "crlf", "blank-line"}
        assert "inconsistent-time" not in left
        again = fix_file(out, path.with_name("again"))
        assert again.changes == ()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fuzz")


prefixes = st.sampled_from(
    [b"", b"\x1f\x8b", b"\x1f\x8b\x08\0", b"[", b"{", b"\xef\xbb\xbf", b"1,2,"]
)


@given(prefix=prefixes, rest=st.binary(max_size=200))
def test_random_bytes_get_an_answer(folder: Path, prefix: bytes, rest: bytes) -> None:
    (folder / "x").write_bytes(prefix + rest)
    answers(folder / "x")


VALID = [
    f"scene_id,im_id,obj_id,score,R,t,time\n{ROW}\n{ROW.replace('0.25', '-1')}\n".encode(),
    (json.dumps([DETECTION, DETECTION | {"time": 1.5}]) + "\n").encode(),
    json.dumps([DETECTION | {"segmentation": {"size": [2, 2], "counts": "04"}}]).encode(),
]


@st.composite
def mutated(draw: st.DrawFn) -> bytes:
    """A good file with a few pieces cut out, doubled, or put in from elsewhere."""
    text = draw(st.sampled_from(VALID))
    pieces = st.sampled_from(
        [
            *(b"\n", b"\r\n", b"\r", b",", b" ", b"nan", b"NaN", b"-", b"e", b"1e999", b"[", b"]"),
            *(
                b"{",
                b"}",
                b'"',
                b"\0",
                b"\xff",
                b"\xe2\x88\x92",
                b"9" * 30,
                b"null",
                b"\\ud800",
                b"0.26",
            ),
        ]
    )
    for _ in range(draw(st.integers(1, 4))):
        begin = draw(st.integers(0, len(text)))
        end = draw(st.integers(begin, min(len(text), begin + 12)))
        text = text[:begin] + draw(pieces | st.just(text[begin:end] * 2)) + text[end:]
    if draw(st.booleans()):
        return text
    packed = gzip.compress(text, mtime=0)
    return packed[: draw(st.integers(0, len(packed)))] if draw(st.booleans()) else packed


@given(mutated())
def test_damaged_files_get_an_answer(folder: Path, text: bytes) -> None:
    (folder / "x").write_bytes(text)
    answers(folder / "x")


json_trees = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(
            st.sampled_from([*DETECTION, "time", "segmentation", "size", "counts"]), inner
        )
    ),
    max_leaves=12,
)


@given(json_trees)
def test_random_json_gets_an_answer(folder: Path, tree: object) -> None:
    (folder / "x").write_text(json.dumps(tree))
    answers(folder / "x")
