"""Let coverage guide the damage: atheris and the two parsers.

python -m tests.fuzz.guided --runs 20000 --seed 1        (part of: make fuzz)

Each parser gets bytes of its own, grown from the programs of this project towards code
that no input has reached yet. Only a PostprocError may come of them, and what a parser
accepts it must be able to write back: the same bytes where nothing changes, the same
shapes where every number does.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).parents[2]
PARSERS = ("program", "variables")
MISSING = (
    "atheris is not installed, so coverage did not guide any damage. It comes with the "
    "extra `fuzz`, on Linux: pip install -e '.[fuzz]'"
)
LONGEST = 4096  # bytes of an input
TIMEOUT = 20  # [s] of wall clock for one input, on a machine that does more than this


def begin(parser: str, options: list[str]) -> None:
    """Fuzz one parser in this process, which libFuzzer ends."""
    import atheris

    with atheris.instrument_imports(include=["postproc.language"]):
        from tests.fuzz import parsers
    atheris.Setup([sys.argv[0], *options], getattr(parsers, parser))
    atheris.Fuzz()


def seeds(folder: Path) -> None:
    """Write what the inputs grow from: one folder for each parser."""
    import random

    from tests.fuzz.originals import values, written

    texts = [[files["job.pdl"] for files in written()], [values(random.Random(0))]]
    texts[1] += [files["job.lsv"] for files in written() if "job.lsv" in files]
    lines = [text.splitlines(keepends=True) for text in texts[1]]
    texts[1] = [b"".join(x[a : a + 12]) for x in lines for a in range(0, len(x), 12)]
    for parser, some in zip(PARSERS, texts, strict=True):
        (folder / parser).mkdir()
        for number, text in enumerate(some):
            (folder / parser / f"{number:03}").write_bytes(text)


def guide(parser: str, folder: Path, runs: int, seed: int) -> int:
    """Fuzz one parser in a process of its own; return its exit code."""
    found = ROOT / "build" / "fuzz"
    found.mkdir(parents=True, exist_ok=True)
    options = [f"-runs={runs}", f"-seed={seed}", f"-max_len={LONGEST}"]
    options += [f"-timeout={TIMEOUT}", f"-artifact_prefix={found}/{parser}-"]
    command = [sys.executable, "-m", "tests.fuzz.guided", "--begin", parser, "--"]
    said = subprocess.run(
        [*command, *options, str(folder / parser)],
        cwd=ROOT, stderr=subprocess.PIPE, text=True, errors="replace",
    )  # fmt: skip
    lines = said.stderr.splitlines()
    if said.returncode:
        print("\n".join(lines[-60:]))
    print(f"{parser}: {next((x for x in lines[::-1] if 'cov:' in x), 'nothing ran')}")
    return said.returncode


def main() -> int:
    """Fuzz both parsers; exit 1 where one fails or hangs, 2 without atheris."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--runs", type=int, default=20_000, help="inputs of each parser"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--begin", choices=PARSERS, help=argparse.SUPPRESS)
    parser.add_argument("options", nargs="*", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if find_spec("atheris") is None:
        print(MISSING, file=sys.stderr)
        return 2
    if given.begin:
        begin(given.begin, given.options)
    with tempfile.TemporaryDirectory() as name:
        seeds(Path(name))
        codes = [guide(p, Path(name), given.runs, given.seed) for p in PARSERS]
    return 1 if any(codes) else 0


if __name__ == "__main__":
    sys.exit(main())
