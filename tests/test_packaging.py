"""An install and a wheel are complete: grammars, arms, licence, pinned packages."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from importlib.util import find_spec
from pathlib import Path
from shutil import which

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import postproc

ROOT = Path(__file__).parent.parent

PIN = re.compile(
    r"^(?P<name>[\w.-]+)(?:\[.*\])?==(?P<version>\S+)(?: ; [^\n]*?)?"
    r"(?P<hashes>(?: \\\n    --hash=sha256:[0-9a-f]{64})*)$",
    re.M,
)

# Run in a process of its own, away from the sources.
PROBE = """
from pathlib import Path
import postproc
from postproc.language.text.grammars import grammar
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
    if (
        which("cargo") is None
        and which("cargo", path=Path.home() / ".cargo/bin") is None
    ):
        pytest.skip("there is no cargo any more: the core was built without it staying")
    folder = tmp_path_factory.mktemp("wheel")
    pip("wheel", "--no-deps", "--no-build-isolation", "-q", "-w", str(folder), ".")
    (built,) = folder.glob("postproc-*.whl")
    return built


def test_wheel_holds_grammars_arms_and_licence(wheel: Path) -> None:
    assert wheel.name.startswith(f"postproc-{postproc.__version__}-")
    assert "-cp311-abi3-" in wheel.name
    names = set(zipfile.ZipFile(wheel).namelist())
    assert "postproc/_native.abi3.so" in names and "postproc/_native.pyi" in names
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


HOOK = """
import sys
sys.path.insert(0, "native")
import hatch_build as hook
print(*hook.library_of(sys.argv[1]), hook.platform_of(sys.argv[1]))
"""


@pytest.mark.parametrize(
    ("target", "words"),
    [
        ("x86_64-pc-windows-gnu", "postproc_native.dll postproc/_native.pyd win_amd64"),
        ("", r"libpostproc_native\.so postproc/_native\.abi3\.so linux_\w+"),
        ("sparc-sun-solaris", "no wheel is known for sparc-sun-solaris"),
    ],
)
def test_a_wheel_is_named_after_the_system_that_is_built_for(
    target: str, words: str
) -> None:
    if find_spec("hatchling") is None:
        pytest.skip("hatchling is missing: pip install -e '.[dev]'")
    command = [sys.executable, "-c", HOOK, target]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if sys.platform == "linux" or target:
        assert re.match(f"(postproc: )?{words}", done.stdout + done.stderr)


def test_sources_hold_no_binary(tmp_path: Path) -> None:
    if find_spec("hatchling") is None:
        pytest.skip("hatchling is missing: pip install -e '.[dev]'")
    command = [
        sys.executable,
        "-m",
        "hatchling",
        "build",
        "-t",
        "sdist",
        "-d",
        tmp_path,
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    (archive,) = tmp_path.glob("postproc-*.tar.gz")
    with tarfile.open(archive) as found:
        names = [name.partition("/")[2] for name in found.getnames()]
    assert {"native/src/lib.rs", "native/hatch_build.py", "native/Cargo.lock"} <= {
        *names
    }
    assert not [n for n in names if n.endswith((".so", ".pyd")) or "/target/" in n]


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


def declared() -> dict[str, list[str]]:
    """Return what each file of requirements/ must hold."""
    ours = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    extras = ours["project"]["optional-dependencies"]
    dev = list(ours["project"]["dependencies"])
    for extra in extras.keys() - {"fuzz", "rust"}:
        dev += extras[extra]
    build = ours["build-system"]["requires"]
    return {"build": build, "dev": dev, "fuzz": extras["fuzz"], "rust": extras["rust"]}


def pinned(name: str) -> dict[str, set[str]]:
    """Return the versions of each package in a file of requirements/, all hashed."""
    text = (ROOT / "requirements" / f"{name}.txt").read_text("utf-8")
    found: dict[str, set[str]] = {}
    for pin in PIN.finditer(text):
        assert pin["hashes"], f"{pin[0]} has no hash"
        found.setdefault(canonicalize_name(pin["name"]), set()).add(pin["version"])
    assert sum(map(len, found.values())) == text.count("==") - markers(text)
    return found


def markers(text: str) -> int:
    """Count the comparisons that belong to markers, not to pins."""
    return sum(line.partition(" ; ")[2].count("==") for line in text.splitlines())


@pytest.mark.parametrize("name", ["build", "dev", "fuzz", "rust"])
def test_what_is_required_is_pinned_with_hashes(name: str) -> None:
    versions = pinned(name)
    for text in declared()[name]:
        required = Requirement(text)
        found = versions.get(canonicalize_name(required.name), set())
        fit = [v for v in found if required.specifier.contains(v)]
        assert found and len(fit) == len(found), f"{text}: {found}. Run make lock"


def test_the_locked_files_agree() -> None:
    build, dev = pinned("build"), pinned("dev")
    assert all(dev.get(name, versions) == versions for name, versions in build.items())
