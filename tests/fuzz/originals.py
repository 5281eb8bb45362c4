"""Sound programs to damage: the corpus, the samples, and generated ones."""

from __future__ import annotations

import random
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from postproc.robot.cell import Cell, load_cell
from tests.any_controller import any_controller
from tests.fuzz.mutation import KRL_KINDS, RAPID_KINDS, mutated
from tests.generated.neutral import landing
from tests.language import neutral_job
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


# Tasks of RAPID.

HEADER = b"%%%\n  VERSION:1\n  LANGUAGE:ENGLISH\n%%%\n"
HELPER = b"""MODULE points
  CONST robtarget pHelp:=[[-605,876,1590],[-0.2549,-0.164,-0.6405,0.7056],[0,0,0,0],
    [9E9,9E9,9E9,9E9,9E9,9E9]];
  LOCAL PERS robtarget aSome{2}:=[
    [[-610,870,1580],[-0.2549,-0.164,-0.6405,0.7056],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],
    [[-600,880,1600],[-0.2549,-0.164,-0.6405,0.7056],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]];
  PROC help(num n)
    FOR i FROM 1 TO 2 DO
      MoveL Offs(aSome{i},0,0,10*i),vWork,fine,tWork\\WObj:=wPart;
    ENDFOR
    IF n>1 THEN
      MoveJ RelTool(pHelp,0,0,-20),vWork,fine,tWork\\WObj:=wPart;
    ENDIF
    MoveL pHelp,vWork,fine,tWork\\WObj:=wPart;
  ENDPROC
ENDMODULE
"""


@cache
def cell() -> Cell:
    """Load the cell of the shipped programs, whose arm the drawn jobs are for."""
    return any_controller(load_cell(ROOT / "programs" / "cell.toml"))


@cache
def tasks() -> tuple[Mapping[str, bytes], ...]:
    """Return the tasks that lie in this project, the module with main first."""
    welding = ROOT / "programs" / "welding"
    test = ROOT / "tests" / "language" / "rapid" / "welding.mod"
    names = ("Welding.mod", "Seams.mod")
    shipped = {name: (welding / name).read_bytes() for name in names}
    return shipped, {"job.mod": test.read_bytes()}


def task(rng: random.Random) -> Files:
    """Write a task at random: moves alone, or with all that programs have."""
    return moves(rng) if rng.random() < 0.5 else drawn_files(rng, "rapid")


def drawn_files(rng: random.Random, language: str) -> Files:
    """Write a program as `tests.generated` draws it."""
    drawn = landing.case(rng.randrange(1 << 30), language, cell())
    return dict(drawn.text.files)


def moves(rng: random.Random) -> Files:
    """Write a task of moves, often with a header, and with a module of points."""
    job = neutral_job.drawn(cell(), rng.randrange(1 << 30), rng.randrange(3, 25))
    text = neutral_job.rapid(job)
    if rng.random() < 0.5:
        text = HEADER + text
    if rng.random() < 0.5:
        return {"job.mod": text}
    text = text.replace(b"  ENDPROC", b"    help 2;\n  ENDPROC")
    return {"job.mod": text, "points.mod": HELPER}


def damaged_task(seed: int, number: int) -> Files:
    """Return damaged modules of a task; the same for the same two numbers."""
    rng = random.Random(f"rapid:{seed}:{number}")
    files = dict(rng.choice(tasks())) if rng.random() < 0.3 else task(rng)
    for name in list(files):
        if len(files) == 1 or rng.random() < 0.7:
            files[name] = mutated(rng, files[name], kinds=RAPID_KINDS)
    return files


# Jobs of KRL.

SUBPROGRAM = b"""DEF help (n :IN)
DECL INT n, i
FOR i=1 TO 2
  LIN XS[i]:{X 0,Y 0,Z -10,A 0,B 0,C 0}
ENDFOR
SWITCH n
CASE 1
  PTP XHELP C_PTP
DEFAULT
  LOOP
    LIN_REL {Z 5}
    EXIT
  ENDLOOP
ENDSWITCH
FDAT_ACT=FP1
BAS(#CP_PARAMS,0.2)
LIN XHELP
END
"""
SUBDATA = b"""DEFDAT help
DECL E6POS XHELP={X -605,Y 876,Z 1590,A 20,B 30,C 170,S 'B010',T 35,E1 0.0}
DECL E6POS XS[2]
XS[1]={X -610,Y 870,Z 1580,A 20,B 30,C 170,S 2,T 35}
XS[2]={X -600,Y 880,Z 1600,A 20,B 30,C 170,S 2,T 35}
DECL FDAT FP1={TOOL_NO 1,BASE_NO 1,IPO_FRAME #BASE,POINT2[] " "}
ENDDAT
"""


@cache
def jobs() -> tuple[Mapping[str, bytes], ...]:
    """Return the jobs that lie in this project, the source that runs first."""
    folder = ROOT / "programs" / "facing"
    names = ("Milling", "Facing", "Holes")
    files = [f"{name}{suffix}" for name in names for suffix in (".src", ".dat")]
    files.append("$config.dat")
    return ({name: (folder / name).read_bytes() for name in files},)


def krl_job(rng: random.Random) -> Files:
    """Write a job at random: moves alone, or with all that programs have."""
    return krl_moves(rng) if rng.random() < 0.5 else drawn_files(rng, "krl")


def krl_moves(rng: random.Random) -> Files:
    """Write a job of moves, often with a subprogram and with a list of the system."""
    drawn = neutral_job.drawn(cell(), rng.randrange(1 << 30), rng.randrange(3, 25))
    files = neutral_job.krl(drawn)
    if rng.random() < 0.5:
        files["job.src"] = files["job.src"].replace(b"END\r\n", b"help(1)\r\nEND\r\n")
        files |= {"help.src": SUBPROGRAM, "help.dat": SUBDATA}
        files["$config.dat"] = jobs()[0]["$config.dat"]
    return files


def damaged_job(seed: int, number: int) -> Files:
    """Return damaged files of a job; the same for the same two numbers."""
    rng = random.Random(f"krl:{seed}:{number}")
    files = dict(rng.choice(jobs())) if rng.random() < 0.3 else krl_job(rng)
    for name in list(files):
        if len(files) == 1 or rng.random() < 0.7:
            files[name] = mutated(rng, files[name], kinds=KRL_KINDS)
    return files


def damaged_of(seed: int, number: int, language: str = "") -> Files:
    """Return damaged files; in no language: of four one is RAPID, and one KRL."""
    kinds = {"pdl2": damaged, "krl": damaged_job, "": damaged, "rapid": damaged_task}
    kind = kinds[language] if language else [*kinds.values()][number % 4]
    return kind(seed, number)
