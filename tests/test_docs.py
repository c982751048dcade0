"""Docs that repeat the code are generated; docs that show commands are run."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import sixd
from sixd.datasets.spec import known_datasets
from sixd.evaluation.protocol import PROTOCOLS

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def generator() -> ModuleType:
    spec = importlib.util.spec_from_file_location("generate", ROOT / "docs/generate.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("page", ["cli.md", "reference.md"])
def test_a_generated_page_is_what_the_code_says(page: str) -> None:
    written = (ROOT / "docs" / page).read_text()
    assert written == generator().PAGES[page](), "run: python docs/generate.py"


def test_every_protocol_is_documented() -> None:
    text = (ROOT / "docs/protocols.md").read_text()
    assert [p for p in PROTOCOLS if f"`{p}`" not in text] == []


def test_every_known_dataset_is_documented() -> None:
    text = (ROOT / "docs/datasets.md").read_text()
    assert [d for d in known_datasets() if f"`{d}`" not in text] == []


def blocks(language: str) -> list[tuple[str, str]]:
    """Fenced blocks of a language, by page, in order; those marked as not run are left out."""
    found = []
    for page in PAGES:
        text = re.sub(r"<!-- not run.*?-->\n```.*?\n```", "", page.read_text(), flags=re.DOTALL)
        text = re.sub(r"<!-- command: .*?-->\n```.*?\n```", "", text, flags=re.DOTALL)
        body = "\n".join(re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL))
        if body:
            found.append((str(page.relative_to(ROOT)), body))
    return found


@pytest.fixture(scope="module")
def demo_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which `sixd demo` has been run, as the docs assume."""
    folder = tmp_path_factory.mktemp("docs")
    run_in(folder, [sys.executable, "-m", "sixd", "demo"])
    return folder


def run_in(folder: Path, command: list[str]) -> str:
    bin_dir = str(Path(sys.executable).parent)
    environment = {**os.environ, "PATH": f"{bin_dir}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.mark.parametrize(("page", "script"), blocks("sh"))
def test_the_commands_of_a_page_run(demo_folder: Path, page: str, script: str) -> None:
    run_in(demo_folder, ["bash", "-euo", "pipefail", "-c", script])


@pytest.mark.parametrize(("page", "code"), blocks("python"))
def test_the_python_of_a_page_runs(demo_folder: Path, page: str, code: str) -> None:
    run_in(demo_folder, [sys.executable, "-W", "error::SyntaxWarning", "-c", code])


def test_every_public_name_can_be_imported() -> None:
    for name in sixd.__all__:
        assert getattr(sixd, name) is not None
