"""Run the commands of an installed postproc over a folder, and compare two such runs.

    python .ci/smoke.py make FOLDER [COUNT]   programs in three languages, a survey
    python .ci/smoke.py run FOLDER OUT        on this system: one process runs all
    python .ci/smoke.py compare OUT OTHER     bytes of programs, numbers of models

`make` needs the sources and their tests, `run` the installed package alone, `compare`
nothing.
"""

from __future__ import annotations

import io
import json
import shutil
import subprocess
import sys
import time
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

PROGRAMS = 200
KILLS = 3
ALMOST = 1e-6  # of numbers of a model that was fitted on another system


def make(folder: Path, count: int = PROGRAMS) -> None:
    """Write programs drawn at random, as many of each language, and a survey."""
    from postproc.robot.cell import load_cell
    from tests.any_controller import EVERY
    from tests.conftest import ROOT, make_job
    from tests.language.neutral_job import LANGUAGES, drawn

    folder.mkdir(parents=True)
    text = (ROOT / "programs/cell.toml").read_text()
    make_job(folder, text.replace("[robot]", f"[robot]\n{EVERY}", 1))
    cell = load_cell(folder / "cell.toml")
    for k in range(count):
        language = list(LANGUAGES)[k % len(LANGUAGES)]
        place = folder / "programs" / f"{k:03d}"
        place.mkdir(parents=True)
        for name, data in LANGUAGES[language](drawn(cell, k)).items():
            (place / name).write_bytes(data)


def postproc(*arguments: object) -> tuple[int, str]:
    """Run a command in this process: its exit code, and what it prints."""
    from postproc.cli import main

    said = io.StringIO()
    sys.argv = ["postproc", *map(str, arguments)]
    with redirect_stdout(said), redirect_stderr(said):
        try:
            main()
        except SystemExit as ended:
            return int(ended.code or 0), said.getvalue()
    return 0, said.getvalue()


def ran(*arguments: object, codes: tuple[int, ...] = (0, 1)) -> str:
    """Run a command that must end with one of some codes; return what it prints."""
    code, said = postproc(*arguments)
    if code not in codes:
        raise SystemExit(f"postproc {arguments} ended with {code}:\n{said}")
    return said


def programs_of(folder: Path) -> list[Path]:
    """List programs; what belongs to one is found beside it."""
    every = sorted((folder / "programs").rglob("*"))
    return [p for p in every if p.suffix in (".pdl", ".mod", ".src")]


def run(folder: Path, out: Path) -> None:
    """Run help, fit, compensate, restore, pages and batch."""
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    cell, model = folder / "cell.toml", folder / "model.json"
    assert "compensate" in ran("--help", codes=(0,))
    ran("fit", folder / "survey.csv", "--cell", cell, "-o", out / "fitted.json",
        "--effects", "geometry,backlash", "--report", out / "fit.html")  # fmt: skip
    at = ("--cell", cell, "--model", model)
    sources = programs_of(folder)
    for k, source in enumerate(sources):
        place = out / "single" / source.parent.name
        place.mkdir(parents=True)
        page = ("--report", out / "page.html") if k < 3 else ()
        ran("compensate", source, *at, "-o", place / source.name, *page)
        back = out / "back" / source.parent.name / source.name
        back.parent.mkdir(parents=True)
        ran("restore", place / source.name, "-o", back, codes=(0,))
        assert back.read_bytes() == source.read_bytes(), source
    assert (out / "page.html").stat().st_size > 10_000
    killed = batch(folder, out, at)
    print(f"{len(sources)} programs, {killed} batches killed, on {sys.platform}")


def batch(folder: Path, out: Path, at: tuple[object, ...]) -> int:
    """Kill batches at work and resume: at the end there is what one run writes."""
    words = ["batch", folder / "programs", out / "tree", *at, "--jobs", 2, "--resume"]
    command = [sys.executable, __file__, "postproc", *map(str, words)]
    killed = 0
    for _ in range(KILLS):
        with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
            log, size = out / "tree.batch.jsonl", 0
            size = log.stat().st_size if log.exists() else 0
            while process.poll() is None:
                time.sleep(0.1)
                if log.exists() and log.stat().st_size > size + 500:
                    process.kill()
                    killed += 1
                    break
    for place in (out / "tree").rglob("*"):
        if place.suffix in (".pdl", ".mod", ".src"):
            assert Path(f"{place}.postproc.json").exists(), place
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode not in (0, 1):
        raise SystemExit(f"batch ended with {done.returncode}:\n{done.stderr}")
    return killed


def compare(one: Path, other: Path) -> int:
    """Compare two runs: programs and records byte for byte, the model as numbers."""
    differ = []
    names = sorted(
        p.relative_to(one) for part in ("single", "back", "tree")
        for p in (one / part).rglob("*") if p.is_file()
    )  # fmt: skip
    there = [p for p in (other / "tree").rglob("*") if p.is_file()]
    for name in names:
        second = other / name
        if not second.exists() or second.read_bytes() != (one / name).read_bytes():
            differ.append(name.as_posix())
    for name in differ:
        print(f"differs: {name}")
    far = max_difference(*(json.loads((p / "fitted.json").read_bytes())["parameters"]
                           for p in (one, other)))  # fmt: skip
    extra = len(there) - sum(n.parts[0] == "tree" for n in names)
    print(f"{len(names)} files, {len(differ)} differ, {extra} in one tree alone; "
          f"parameters of a fit differ by {far:.1e}")  # fmt: skip
    return int(bool(differ) or extra != 0 or far > ALMOST)


def max_difference(one: object, other: object) -> float:
    """Return the largest difference of numbers within two of the same shape."""
    if isinstance(one, dict) and isinstance(other, dict):
        assert one.keys() == other.keys()
        return max((max_difference(one[k], other[k]) for k in one), default=0.0)
    if isinstance(one, list) and isinstance(other, list):
        assert len(one) == len(other)
        pairs = zip(one, other, strict=True)
        return max((max_difference(a, b) for a, b in pairs), default=0.0)
    if isinstance(one, (int, float)) and isinstance(other, (int, float)):
        return abs(one - other)
    return 0.0 if one == other else float("inf")


if __name__ == "__main__":
    match sys.argv[1]:
        case "postproc":
            code, said = postproc(*sys.argv[2:])
            sys.stderr.write(said)
            raise SystemExit(code)
        case "make":
            make(Path(sys.argv[2]), *map(int, sys.argv[3:]))
        case "run":
            run(Path(sys.argv[2]), Path(sys.argv[3]))
        case "compare":
            raise SystemExit(compare(Path(sys.argv[2]), Path(sys.argv[3])))
