"""Sound programs to damage: the corpus, the samples, and generated ones."""

from __future__ import annotations

import random
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from tests.fuzz.mutation import mutated
from tests.language.pdl2.generator import POINTS, Generator
from tests.language.pdl2.generator.rarer import Rarer
from tests.language.pdl2.reachable import Reachable, ReachableJob
from tests.language.pdl2.whole_jobs import Job

ROOT = Path(__file__).parents[2]
Files = dict[str, bytes]
KINDS = (Generator, Rarer, Reachable, Job, ReachableJob)

PARTS = (
    "pth PATH nd Priv",
    "NODE[1]:",
    "$MAIN_POS POS X: 100.00 Y: 200.00 Z: 150.00 A: 0.00 E: 175.00 R: 0.00 CNFG: ''",
    "$LIN_SPD REA",
    " 0.5",
    "rec AREC[2] frame_table Xport",
    " [1]: ",
    " p JNTP Arm: 1 Ax: 6",
    " 1: 0.00 2: -20.00 3: -110.00 4: 0.00 5: 60.00 6: 0.00",
)  # what a variable file may hold more


@cache
def written() -> tuple[Mapping[str, bytes], ...]:
    """Return the programs that lie in this project, with their variable files."""
    found: list[Mapping[str, bytes]] = []
    for path in sorted((ROOT / "tests" / "corpus").glob("*.txt")):
        for case in path.read_bytes().split(b"==== ")[1:]:
            text = case.split(b"\n", 1)[1].partition(b"----\n")[0]
            program, _, listed = text.partition(b"-- values\n")
            more = {"job.lsv": listed} if listed else {}
            found.append({"job.pdl": program, **more})
    found += case_programs()
    for path in sorted((ROOT / "programs").glob("*.pdl")):
        values = path.with_suffix(".lsv")
        more = {"job.lsv": values.read_bytes()} if values.exists() else {}
        found.append({"job.pdl": path.read_bytes(), **more})
    return tuple(found)


def case_programs() -> list[Mapping[str, bytes]]:
    """Return the inputs of the cases."""
    paths = sorted((ROOT / "tests" / "cases").glob("*.pdl"))
    return [{"job.pdl": p.read_bytes().partition(b"-- output")[0]} for p in paths]


def generated(rng: random.Random) -> Files:
    """Write a program at random, often with pages, and half of the time with values."""
    kind = rng.choice(KINDS)
    files = kind(rng, exact=rng.random() < 0.3).program().files
    if rng.random() < 0.5:
        files["job.lsv"] = values(rng)
    return files


def values(rng: random.Random) -> bytes:
    """Write a variable file for a generated program."""
    text = ["--$$  ARM: 1 AXES: 8 AUX: 1 MASK: 191"]
    for name in POINTS:
        n = [round(rng.uniform(-900, 900), 3) for _ in range(6)]
        kind = rng.choice(["POS Priv", "XTND Arm: 1 Ax:1 Priv", "POS Xport NoSave"])
        aux = "  1: 90" if kind.startswith("XTND") else ""
        text.append(f"{name} {kind}")
        pairs = "  ".join(f"{c}: {v:.3f}" for c, v in zip("XYZAER", n, strict=True))
        text += [f" {pairs}{aux}", " CNFG: ''"]
    text.append("tab APOS [9] Priv")
    for index in range(1, 4):
        n = [round(rng.uniform(-900, 900), 2) for _ in range(6)]
        pairs = " ".join(f"{c}:{v:.2f}" for c, v in zip("XYZAER", n, strict=True))
        text.append(f" [{index}]: {pairs} CNFG: ''")
    text += ["n1 INT Priv", " 1", "j1 JNTP Arm: 1 AX: 6 Priv"]
    text.append(" 1: 0.00 2: -20.00 3: -110.00 4: 0.00 5: 60.00 6: 0.00")
    return "\r\n".join([*text, *PARTS, ""]).encode("latin-1")


def damaged(seed: int, number: int) -> Files:
    """Return damaged files; the same for the same two numbers."""
    rng = random.Random(f"{seed}:{number}")
    files = dict(rng.choice(written())) if rng.random() < 0.4 else generated(rng)
    for name in list(files):
        if len(files) == 1 or rng.random() < 0.7:
            files[name] = mutated(rng, files[name])
    return files
