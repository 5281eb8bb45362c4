"""An editable install and a wheel are complete: grammars, arms, licence."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest

import postproc

ROOT = Path(__file__).parent.parent

# Run in a process of its own, away from the sources.
PROBE = """
from pathlib import Path
import postproc
from postproc.language.pdl2.parser import grammar
print(Path(postproc.__file__).resolve())
print(grammar("pdl2").strip().splitlines()[0])
"""


def run(code: str, cwd: Path, **environment: str) -> list[str]:
    """Run Python code in a folder of its own and return the lines it prints."""
    names = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=cwd,
        env=names | environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def pip(*arguments: str) -> None:
    """Run pip without its index: everything needed is here already."""
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", *arguments]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the wheel."""
    if find_spec("pip") is None:
        pytest.skip("pip is not in this environment: nothing to build a wheel with")
    if find_spec("hatchling") is None:
        pytest.skip("hatchling is missing: pip install -e '.[dev]'")
    folder = tmp_path_factory.mktemp("wheel")
    pip("wheel", "--no-deps", "--no-build-isolation", "-q", "-w", str(folder), ".")
    (built,) = folder.glob("postproc-*.whl")
    return built


def test_wheel_holds_grammars_arms_and_licence(wheel: Path) -> None:
    assert wheel.name.startswith(f"postproc-{postproc.__version__}-")
    names = set(zipfile.ZipFile(wheel).namelist())
    for folder, pattern, inside in (
        (ROOT / "grammars", "*.lark", "postproc/grammars"),
        (ROOT / "postproc" / "robot" / "arms", "*.toml", "postproc/robot/arms"),
    ):
        files = [f.name for f in folder.glob(pattern)]
        assert files, folder
        assert {f"{inside}/{name}" for name in files} <= names
    assert "postproc/py.typed" in names
    assert any(name.endswith("licenses/LICENSE") for name in names)
    assert not any(name.startswith(("tests/", "programs/")) for name in names)


def test_grammar_is_found_from_a_wheel(wheel: Path, tmp_path: Path) -> None:
    target = tmp_path / "site"
    pip("install", "--no-deps", "--no-index", "-q", "--target", str(target), str(wheel))
    where, first = run(PROBE, tmp_path, PYTHONPATH=str(target))
    assert Path(where).is_relative_to(target.resolve())
    text = (ROOT / "grammars" / "pdl2.lark").read_text(encoding="utf-8")
    assert first == text.strip().splitlines()[0]


def test_grammar_is_found_from_the_sources(tmp_path: Path) -> None:
    where, first = run(PROBE, tmp_path)
    if not Path(where).is_relative_to(ROOT.resolve()):
        pytest.skip("postproc is not installed editable here: pip install -e '.[dev]'")
    text = (ROOT / "grammars" / "pdl2.lark").read_text(encoding="utf-8")
    assert first == text.strip().splitlines()[0]
