"""Run cases on a package, several side by side."""

from __future__ import annotations

import hashlib
import json
import os
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue
from types import TracebackType
from typing import Any

from tests.golden.case import HERE, Case
from tests.golden.cases import DESK, all_cases
from tests.golden.record import BINARY, Record, masked

WARM = Case(
    "warm",
    (
        "compensate job.pdl --cell cell.toml --model model.json",
        "explain job.pdl --cell cell.toml --model model.json",
        "diff job.pdl job.compensated.pdl",
    ),
    {**DESK, "job.pdl": "cases/robodk/job.pdl"},
)  # loads most of the package
LANGUAGES = ("krl/calls", "rapid/if")  # load what belongs to one language alone


class Worker:
    """A process that has the package loaded and runs commands, each in a fork."""

    def __init__(self, root: Path, scratch: Path) -> None:
        """Start it on the package that lies in a folder."""
        self.scratch = Path(tempfile.mkdtemp(dir=scratch))
        self.count = 0
        self.answers: list[dict[str, Any]] = []
        given = {
            "PYTHONPATH": str(root),
            "XDG_CACHE_HOME": str(scratch / "cache"),
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
            "COLUMNS": "100",
            "NO_COLOR": "1",
            "TERM": "dumb",
            "MPLBACKEND": "agg",
        }
        self.process = subprocess.Popen(
            [sys.executable, "-P", str(HERE / "worker.py")],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **given},
            text=True,
        )
        hello = self._answer()
        if not Path(hello["file"]).is_relative_to(root):
            raise RuntimeError(f"postproc is {hello['file']}, not below {root}")
        self.version = hello["version"]
        self.root = root
        for case in (WARM, *(c for c in all_cases() if c.name in LANGUAGES)):
            self.run(case, here=True)

    def __enter__(self) -> Worker:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.process.communicate()

    def run(self, case: Case, here: bool = False) -> Record:
        """Run the commands of a case in a folder of its own; record what came out."""
        self.count += 1
        folder = self.scratch / str(self.count)
        folder.mkdir()
        staged = case.stage(folder)
        found: dict[str, bytes] = {}
        for number, line in enumerate(case.commands, 1):
            words = shlex.split(line)
            stdin = str(folder / words[-1]) if "<" in words else ""
            command = words[: words.index("<")] if stdin else words
            printed = {way: self.scratch / way for way in ("stdout", "stderr")}
            order = {"folder": str(folder), "command": command, "stdin": stdin}
            order |= {way: str(path) for way, path in printed.items()}
            answer = self._ask({**order, "here": here})
            self.answers.append(answer)
            found[f"{number} exit"] = str(answer["exit"]).encode()
            for way, path in printed.items():
                found[f"{number} {way}"] = path.read_bytes()
        found |= written(folder, staged)
        return self._record(case, folder, found)

    def _record(self, case: Case, folder: Path, found: dict[str, bytes]) -> Record:
        """Mask what differs between runs."""
        names = {
            str(folder): "<folder>",
            str(self.root): "<root>",
            f"postproc {self.version}": "postproc <version>",
            f'"version": "{self.version}"': '"version": "<version>"',
            f'{{"postproc": "{self.version}"': '{"postproc": "<version>"',
        }
        return {
            what: hashlib.sha256(data).hexdigest()
            if what.endswith(BINARY)
            else masked(data.decode("latin-1"), names, case.fitted)
            for what, data in found.items()
        }

    def _ask(self, order: Mapping[str, Any]) -> dict[str, Any]:
        """Give an order, and wait for the answer."""
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps(order) + "\n")
        self.process.stdin.flush()
        return self._answer()

    def _answer(self) -> dict[str, Any]:
        """Read an answer."""
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            raise RuntimeError("the process that runs commands has ended")
        return dict(json.loads(line))


def written(folder: Path, staged: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return the files that are new or changed; empty text for those that are gone."""
    paths = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    now = {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}
    changed = {k: v for k, v in now.items() if staged.get(k) != v}
    return changed | {f"{k} (gone)": b"" for k in staged if k not in now}


def run_all(cases: Iterable[Case], root: Path, workers: int = 2) -> dict[str, Record]:
    """Run cases on the package that lies in a folder; return their records by name."""
    cases = list(cases)
    if not cases:
        return {}
    with tempfile.TemporaryDirectory(prefix="golden-") as name:
        free: SimpleQueue[Worker] = SimpleQueue()

        def run(case: Case) -> Record:
            worker = free.get()
            try:
                return worker.run(case)
            finally:
                free.put(worker)

        started = [Worker(root, Path(name)) for _ in range(min(workers, len(cases)))]
        for worker in started:
            free.put(worker)
        with ThreadPoolExecutor(workers) as pool:
            records = list(pool.map(run, cases))
        for worker in started:
            worker.process.communicate()
    return dict(zip((case.name for case in cases), records, strict=True))
