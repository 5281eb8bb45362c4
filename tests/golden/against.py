"""The package of a commit against this one: the same cases, run on both."""

from __future__ import annotations

import gzip
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import distributions
from pathlib import Path

from postproc import _native
from tests.golden.case import HERE, ROOT, Case, kept
from tests.golden.record import Record, differences
from tests.golden.running import run_all
from tests.golden.translation import Translation

BUILD = ROOT / "build" / "golden"


def against(
    commit: str, cases: Sequence[Case], workers: int, fresh: bool
) -> dict[str, list[str]]:
    """Tell what the package here writes otherwise than that of a commit, by case."""
    words = Translation.read()
    base = records_of(commit, [*map(words.case, cases)], workers, fresh)
    here = run_all(cases, ROOT, workers)
    found = {
        case.name: differences(
            words.base(base[case.name]), words.here(here[case.name]), case.fitted
        )
        for case in cases
    }
    return {name: lines for name, lines in found.items() if lines}


def records_of(
    commit: str, cases: Sequence[Case], workers: int, fresh: bool
) -> dict[str, Record]:
    """Return the records of a commit; what ran before is kept below build/golden."""
    full = git("rev-parse", f"{commit}^{{commit}}").decode().strip()
    path = BUILD / f"{full[:12]}-{setup()}.json.gz"
    records: dict[str, Record] = {}
    if path.exists() and not fresh:
        records = json.loads(gzip.decompress(path.read_bytes()))
    missing = [case for case in cases if case.name not in records]
    if missing:
        print(f"running {len(missing)} cases on {full[:12]}", file=sys.stderr)
        records |= run_at(full, missing, workers)
        BUILD.mkdir(parents=True, exist_ok=True)
        path.write_bytes(gzip.compress(json.dumps(records).encode(), 3))
    return records


def run_at(commit: str, cases: Sequence[Case], workers: int) -> dict[str, Record]:
    """Run cases on the package of a commit, see `package_of`."""
    with package_of(commit) as root:
        return run_all(cases, root, workers)


@contextmanager
def package_of(commit: str) -> Iterator[Path]:
    """Give the folder of a commit's package, with its core: built where it is another.

    Raises:
        subprocess.CalledProcessError: There is no such commit, or no core of it.
    """
    with tempfile.TemporaryDirectory(prefix="golden-base-") as name:
        archive = git("archive", commit, "postproc", "grammars", "native")
        subprocess.run(["tar", "-x", "-C", name], input=archive, check=True)
        core = Path(str(_native.__file__))
        if git("diff", "--stat", commit, "--", "native"):
            core = build_core(Path(name) / "native")
        shutil.copy(core, Path(name) / "postproc" / "_native.abi3.so")
        yield Path(name).resolve()


def build_core(folder: Path) -> Path:
    """Compile the core of a commit in its folder; return the library."""
    path = f"{Path.home() / '.cargo/bin'}:{os.environ['PATH']}"
    subprocess.run(
        ["cargo", "build", "--release", "--locked", "--target-dir", "target"],
        cwd=folder,
        env=os.environ | {"PYO3_PYTHON": sys.executable, "PATH": path},
        check=True,
    )
    return folder / "target" / "release" / "libpostproc_native.so"


def setup() -> str:
    """Hash what else decides on the records: cases, inputs, and what is installed."""
    found = hashlib.sha256(sys.version.encode())
    for path in sorted(HERE.glob("*.py")):
        found.update(path.read_bytes())
    found.update(Translation.read().digest)
    for name, data in kept().items():
        found.update(name.encode() + data)
    for one in sorted(f"{d.name} {d.version}" for d in distributions()):
        found.update(one.encode())
    return found.hexdigest()[:12]


def git(*words: str) -> bytes:
    """Run git here."""
    command = ["git", "-C", str(ROOT), *words]
    return subprocess.run(command, check=True, capture_output=True).stdout
