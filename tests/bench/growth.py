"""How the time to read a program grows with what it holds.

python -m tests.bench.growth        (or: make growth)

Every kind of program is read at a size and at twice that size: 1.0 is linear.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from postproc.compensation.program import read_program
from postproc.robot.cell import Cell, load_cell

ROOT = Path(__file__).parents[2]
CELL = ROOT / "programs" / "cell.toml"
Files = Mapping[str, bytes]
AT = "POS({0}.125, 200.5, 300.25, 0, 180, 0, '')"
WIDTH = 456  # characters of the longest lines of real files


def job(*lines: str, head: tuple[str, ...] = ()) -> Files:
    text = "\r\n".join(["PROGRAM job", *head, "BEGIN", *lines, "END job", ""])
    return {"job.pdl": text.encode("ascii")}


def moves(n: int) -> Files:
    """Write lines of moves, with a comment every tenth."""
    lines = [f"  MOVE LINEAR TO {AT.format(k % 900)}" for k in range(n)]
    lines[::10] = [f"  -- row {k}" for k in range(0, n, 10)]
    return job(*lines)


def wide(n: int) -> Files:
    """Write lines of 456 characters: moves with many items."""
    long = []
    for k in range(n):
        line = f"  MOVE LINEAR TO {AT.format(k % 900)} WITH $LIN_SPD = 0.{k % 9 + 1}"
        while len(line) < WIDTH - 20:
            line += f", CONDITION[{len(line)}]"
        long.append(line.ljust(WIDTH))
    return job(*long)


def various(n: int) -> Files:
    """Write lines that are all of different shapes."""
    words = [f"  a{k}b := fn{k}(x{k}, 'text {k}') + ({k} * y{k})" for k in range(n)]
    return job(*words)


def variables(n: int) -> Files:
    """Write variables, each of them assigned and gone to."""
    names = [f"p{k}" for k in range(n)]
    head = ["VAR", *(f"  {name} : POSITION" for name in names)]
    lines = [f"  {name} := {AT.format(k % 900)}" for k, name in enumerate(names)]
    return job(*lines, *(f"  MOVE LINEAR TO {n}" for n in names), head=tuple(head))


def entries(n: int) -> Files:
    """Write variables with their values in the variable file."""
    names = [f"p{k}" for k in range(n)]
    head = ("VAR", *(f"  {name} : XTNDPOS FOR ARM[1]" for name in names))
    rows = ["--$$  ARM: 1 AXES: 8 AUX: 1 MASK: 191"]
    for k, name in enumerate(names):
        rows += [f"{name} XTND Arm: 1 Ax:1 Priv", " X: 1 Y: 2 Z: 3 A: 4 E: 5 "
                 f"R: {k}  1: 90", " CNFG: ''"]  # fmt: skip
    files = job(*(f"  MOVE JOINT TO {name}" for name in names), head=head)
    return {**files, "job.lsv": "\r\n".join([*rows, ""]).encode("ascii")}


def branches(n: int) -> Files:
    """Write moves, each of them in an IF of its own."""
    lines = [(f"IF $DIN[{k % 9}] THEN", f"  MOVE LINEAR TO {AT.format(k % 900)}",
              "ENDIF") for k in range(n)]  # fmt: skip
    return job(*(line for three in lines for line in three))


def nested(n: int) -> Files:
    """Write a variable that one of many cases sets, and a move to it after each."""
    lines = ["SELECT n OF"]
    for k in range(n):
        lines += [f"CASE ({k}):", f"  p := {AT.format(k % 900)}", "  MOVE LINEAR TO p"]
    return job(*lines, "ENDSELECT", head=("VAR n : INTEGER", "  p : POSITION"))


def calls(n: int) -> Files:
    """Write calls of a routine that moves to its parameter."""
    head = ("VAR p, q : POSITION", "ROUTINE r(a : POSITION)", "BEGIN",
            "  MOVE LINEAR TO a", "END r")  # fmt: skip
    lines = [f"  p := {AT.format(k % 900)}\r\n  r(p)" for k in range(n)]
    return job(*lines, head=head)


def elements(n: int) -> Files:
    """Write elements of an array, and others of which only the run tells which."""
    lines = [f"  t[{k + 1}] := {AT.format(k % 900)}" for k in range(n)]
    lines.append("  n := $AIN[1]")
    for k in range(n):
        at = "n" if k % 2 else f"{k + 1}"
        lines += [f"  t[{at}] := {AT.format(k % 800)}", f"  MOVE LINEAR TO t[{at}]"]
    return job(*lines, head=(f"VAR t : ARRAY[{n}] OF POSITION", "  n : INTEGER"))


def locals_(n: int) -> Files:
    """Write as many calls of a routine with a variable of its own as variables."""
    names = [f"p{k}" for k in range(n)]
    head = ("VAR", *(f"  {name} : POSITION" for name in names), "ROUTINE r",
            "VAR a : POSITION", "BEGIN", f"  a := {AT.format(7)}",
            "  MOVE LINEAR TO a", "END r")  # fmt: skip
    lines = [f"  {name} := {AT.format(k % 900)}" for k, name in enumerate(names)]
    return job(*lines, *["  r"] * n, head=head)


def functions(n: int) -> Files:
    """Write calls of a function in expressions."""
    head = ("VAR n : INTEGER", "ROUTINE f(k : INTEGER) : INTEGER", "BEGIN",
            "  RETURN(k + 1)", "END f")  # fmt: skip
    lines = [
        f"  n := f({k})\r\n  MOVE LINEAR TO {AT.format(k % 900)}" for k in range(n)
    ]
    return job(*lines, head=head)


def handlers(n: int) -> Files:
    """Write condition handlers, each of which sets a variable, and moves."""
    lines = []
    for k in range(n):
        lines += [f"CONDITION[{k + 1}] :", f"  WHEN $DIN[{k + 1}]+ DO",
                  f"    n{k} := 1", "ENDCONDITION", f"ENABLE CONDITION[{k + 1}]",
                  f"  MOVE LINEAR TO {AT.format(k % 900)}"]  # fmt: skip
    return job(*lines, head=("VAR", *(f"  n{k} : INTEGER" for k in range(n))))


def arcs(n: int) -> Files:
    """Write arcs between moves by a step."""
    lines = [f"  MOVE CIRCULAR TO {AT.format(k % 900)} VIA {AT.format(k % 800)}\r\n"
             f"  MOVE LINEAR AWAY {k % 90}" for k in range(n)]  # fmt: skip
    return job(*lines)


def jumps(n: int) -> Files:
    """Write jumps forward over moves."""
    lines = []
    for k in range(n):
        lines += [f"IF $DIN[{k % 9}] THEN", f"  GOTO l{k}", "ENDIF",
                  f"  MOVE LINEAR TO {AT.format(k % 900)}", f"l{k}::"]  # fmt: skip
    return job(*lines)


def routines(n: int) -> Files:
    """Write routines, each of them called once."""
    return job(*(f"  r{k}" for k in range(n)), head=_bodies(n, lambda k: ()))


def chain(n: int) -> Files:
    """Write routines, each of which calls the next."""
    return job("  r0", head=_bodies(n, lambda k: [f"  r{k + 1}"] * (k + 1 < n)))


def nested_functions(n: int) -> Files:
    """Write functions, each of which calls the next one in an expression."""
    lines = ["VAR n : INTEGER"]
    for k in range(n):
        value = f"f{k + 1}(k)" if k + 1 < n else "k"
        lines += [f"ROUTINE f{k}(k : INTEGER) : INTEGER", "BEGIN",
                  f"  RETURN({value})", f"END f{k}"]  # fmt: skip
    move = f"  MOVE LINEAR TO {AT.format(7)}"
    return job("  n := f0(1)", move, head=tuple(lines))


def tree(n: int) -> Files:
    """Write routines that call the next one twice: n visits and more, in few lines."""
    deep = max(n - 1, 1).bit_length()
    return job(
        "  r0", head=_bodies(deep, lambda k: [f"  r{k + 1}"] * 2 * (k + 1 < deep))
    )


def _bodies(n: int, calls: Callable[[int], Sequence[str]]) -> tuple[str, ...]:
    """Write routines that move and then call others."""
    lines = []
    for k in range(n):
        move = f"  MOVE LINEAR TO {AT.format(k % 900)}"
        lines += [f"ROUTINE r{k}", "BEGIN", move, *calls(k), f"END r{k}"]
    return tuple(lines)


def terms(n: int) -> Files:
    """Write one sum of many terms."""
    return job("  n := " + " + ".join(["n"] * n), head=("VAR n : INTEGER",))


KINDS: dict[str, tuple[Callable[[int], Files], int]] = {
    "lines of moves": (moves, 50_000),
    "lines of 456 characters": (wide, 10_000),
    "lines that all differ": (various, 2_000),
    "variables": (variables, 3_000),
    "entries of a variable file": (entries, 3_000),
    "moves in an IF each": (branches, 3_000),
    "cases of one SELECT": (nested, 2_000),
    "calls with a parameter": (calls, 3_000),
    "elements, known or not": (elements, 2_000),
    "calls among variables": (locals_, 3_000),
    "calls of a function": (functions, 3_000),
    "condition handlers": (handlers, 1_000),
    "arcs and steps": (arcs, 5_000),
    "jumps forward": (jumps, 3_000),
    "routines": (routines, 3_000),
    "calls within calls": (chain, 3_000),
    "functions within functions": (nested_functions, 2_000),
    "visits of a tree of calls": (tree, 1 << 14),
    "terms of a sum": (terms, 50_000),
}


def seconds(files: Files, cell: Cell) -> float:
    """Return the processor time to read a program, the best of three."""
    best = math.inf
    for _ in range(3):
        begun = time.process_time()
        read_program(files, cell)
        best = min(best, time.process_time() - begun)
    return best


def main() -> int:
    """Measure and print every kind."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=float, default=1.0, help="of the usual sizes")
    given = parser.parse_args()
    cell = load_cell(CELL)
    print(
        f"{'program of':28} {'n/2':>7} {'n':>7} {'s at n/2':>9} {'s at n':>8}  growth"
    )
    for name, (write, size) in KINDS.items():
        n = int(size * given.times)
        half, whole = (seconds(write(k), cell) for k in (n // 2, n))
        growth = math.log2(whole / half)
        print(f"{name:28} {n // 2:7} {n:7} {half:9.3f} {whole:8.3f}  {growth:.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
