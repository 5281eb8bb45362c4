"""Nodes of a path mean what elements of an array would: the same visits."""

from __future__ import annotations

import random
import re

import numpy as np
import pytest

from postproc.language.language import Start
from postproc.language.pdl2.interpreter import resolve
from postproc.language.pdl2.program import parse
from postproc.language.pdl2.variable_file import read_variables
from postproc.language.text.source import source_from_bytes

HEAD = """PROGRAM job
VAR tab, other : ARRAY[4] OF POSITION
  p : POSITION
  i, n : INTEGER
ROUTINE go(x : POSITION)
BEGIN
  MOVE LINEAR TO x
  x := other[1]
END go
ROUTINE idle(k : INTEGER)
BEGIN
  DELAY k
END idle
BEGIN
"""
LINES = (
    "MOVE LINEAR TO other[@]",
    "MOVE JOINT TO p",
    "p := tab[@]",
    "tab[@] := p",
    "tab[@] := POS(90, 2, 3, 4, 5, 6, '')",
    "tab[@].X := 80",
    "tab[@].Z := tab[@].Z + 10",
    "MOVE LINEAR TO POS_SHIFT(tab[@], VEC(0, 0, 5))",
    "go(tab[@])",
    "go((tab[@]))",
    "outside(tab[@])",
    "outside(other)",
    "idle(3)",
    "READ lun (tab[@])",
    "MOVE LINEAR TO tab[n]",
    "tab[n] := p",
    "tab := other",
    "other[@] := tab[@]",
)
FIELD = ".$MAIN_POS"


def body(rng: random.Random) -> list[str]:
    """Write a program of a few kinds of statements: most of them unsettle others."""
    lines = ["MOVE LINEAR TO tab[@]", *rng.sample(LINES, rng.randint(1, 6))]
    return [line for _ in range(3) for line in block(rng, lines)]


def block(rng: random.Random, lines: list[str], depth: int = 0) -> list[str]:
    """Write some statements, with loops and branches in them."""
    found = []
    for _ in range(rng.randint(2, 5)):
        kind = rng.random()
        if kind < 0.15 and depth < 2:
            found += ["IF $DIN[1] THEN", *block(rng, lines, depth + 1), "ELSE"]
            found += [*block(rng, lines, depth + 1), "ENDIF"]
        elif kind < 0.3 and depth == 0:
            found += [
                "FOR i := 1 TO 3 DO",
                *block(rng, lines, 1),
                "MOVE LINEAR TO tab[i]",
            ]
            found += ["ENDFOR"]
        else:
            line = rng.choice(lines)
            found.append(re.sub("@", lambda _: str(rng.randint(1, 4)), line))
    return found


def listed(head: str, element: str) -> str:
    """Write the values of two arrays, or paths."""
    text = ""
    for at, name in enumerate(("tab", "other")):
        text += head.format(name=name)
        for k in (1, 2, 3):
            numbers = f"X: {10 * at + k}.00 Y: 2.00 Z: 3.00 A: 4.00 E: 5.00 R: 6.00"
            text += element.format(k=k) + f" {numbers} CNFG: ''\n"
    return text


ARRAYS = listed("{name} APOS [4] Priv\n", " [{k}]:")
PATHS = listed("{name} PATH nd Priv\n", " NODE[{k}]:\n $MAIN_POS POS")


def as_path(program: str) -> str:
    """Write nodes of paths in place of elements of arrays."""
    text = program.replace("ARRAY[4] OF POSITION", "PATH OF nd")
    return re.sub(r"\b(tab|other)\[(\w)\]", rf"\1.NODE[\2]{FIELD}", text)


def followed(program: str, values: str):
    source = source_from_bytes("job.pdl", program.encode())
    variables = read_variables(source_from_bytes("job.lsv", values.encode()))
    return resolve(parse(source), Start(), variables).visits


def edited(visits) -> list[tuple[bool, bool]]:
    """Tell of every visit whether it has a literal, and whether that may change."""
    pinned = visits.literals.pinned
    return [(k >= 0, k >= 0 and not pinned[k]) for k in visits.target.literal.tolist()]


@pytest.mark.parametrize("seed", range(60))
def test_nodes_are_followed_like_elements(seed):
    program = HEAD + "\n".join([*body(random.Random(seed)), "END job"])
    arrays, paths = followed(program, ARRAYS), followed(as_path(program), PATHS)
    assert len(arrays) == len(paths)
    np.testing.assert_array_equal(arrays.target.values, paths.target.values)
    np.testing.assert_array_equal(arrays.graph.pred, paths.graph.pred)
    assert edited(arrays) == edited(paths)
    assert [bool(arrays.reasons[k]) for k in arrays.reason] == [
        bool(paths.reasons[k]) for k in paths.reason
    ]
