"""Moves with instructions between them are read at once as they are one by one."""

from __future__ import annotations

import random
from collections.abc import Mapping

import pytest

from postproc.robot.cell import Cell
from tests.bench.languages import milled, with_names, written
from tests.language.analysis.test_move_blocks import cell, folded, same

assert cell  # a fixture

END = "[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
HEAD = """MODULE job
  PERS tooldata t:=[TRUE,[[0,0,300],[1,0,0,0]],[8,[0,0,100],[1,0,0,0],0,0,0]];
  PERS wobjdata w:=[FALSE,TRUE,"",[[600,0,800],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  CONST loaddata l1:=[5,[0,0,50],[1,0,0,0],0,0,0];
  CONST pose d1:=[[0,0,10],[1,0,0,0]];
  VAR pose d2;
  VAR robtarget v1;
  VAR num n1;
"""
USUAL = (
    "SetDO do1,1;", "Set do2;", "Reset do2;", "SetAO ao1,n1;", "PulseDO do3;",
    "ConfL\\Off;", "ConfL\\On;", "ConfJ\\Off;", "SingArea\\Wrist;", "SingArea\\Off;",
    "VelSet 100,5000;", "VelSet 50,5000;", "VelSet n1,5000;", "GripLoad l1;",
    "GripLoad load0;", "PDispSet d1;", "PDispSet d2;", "PDispOff;", 'TPWrite "x";',
    "AccSet 50,50;", "CirPathMode\\PathFrame;",
)  # fmt: skip
RARE = (
    "WaitTime 1;", "n1:=n1+1;", "n1:=40;", "Incr n1;", "Add n1,2;", "v1:=p3;",
    "v1.trans.z:=v1.trans.z+5;", "d2:=d1;", "elsewhere;", "Stop;", "StorePath;",
    "MoveL v1,v100,z10,t\\WObj:=w;", "SetDO do1,DInput(di1);", "IF di1=1 SetDO do1,1;",
    "PDispOn p1,t;", "SoftAct 1,50;", "SoftDeact;", "next;", "SetDO do1,1; ! @taught",
    "EOffsOn p1;", "WaitDI di1,1;", "StrToVal2;", "quiet;", "SetDO n1,1;",
)  # fmt: skip
AROUND = (
    ("", ""), ("", ""), ("FOR i FROM 1 TO 2 DO", "ENDFOR"), ("again:", ""),
    ("WHILE di2=1 DO", "ENDWHILE"), ("IF di3=1 THEN", "ENDIF"),
)  # fmt: skip


def drawn(seed: int) -> dict[str, bytes]:
    """Draw a module of moves, with instructions between most of them."""
    draw = random.Random(seed)
    rare, lines = draw.choice([0.0, 0.05, 0.2]), list[str]()
    for _ in range(draw.randint(1, 4)):
        head, end = draw.choice(AROUND)
        head = "" if head == "again:" and head in lines else head
        lines += [head, *(line for _ in range(draw.randint(3, 12))
                          for line in _lines(draw, rare)), end]  # fmt: skip
    points = "".join(f"  CONST robtarget p{k}:=[[{k},{2 * k},3],[1,0,0,0],{END};\n"
                     for k in range(1, 9))  # fmt: skip
    handler = draw.choice(["", "", "ERROR\nTRYNEXT;\n", "ERROR\nSetDO do1,0;\n"])
    text = f"{HEAD}{points}PROC main()\n" + "\n".join(lines) + f"\n{handler}ENDPROC\n"
    text += "PROC next()\nConfL\\Off;\nENDPROC\nPROC quiet()\nSetDO do1,1;\nENDPROC\n"
    return {"job.mod": f"{text}ENDMODULE\n".encode()}


def _lines(draw: random.Random, rare: float) -> list[str]:
    """Draw a move, and what stands before it."""
    if draw.random() < rare:
        return [draw.choice(RARE)]
    word, zone = draw.choice("LLLJ"), draw.choice(["z10", "z10", "fine"])
    written = f"[[{draw.random():.3f},2,3],[1,0,0,0],{END}"
    to = draw.choice([f"p{draw.randint(1, 8)}", written])
    before = [draw.choice(USUAL) for _ in range(draw.choice([0, 1, 1, 2]))]
    return [*before, f"Move{word} {to},v100,{zone},t\\WObj:=w;"]


@pytest.mark.parametrize("seed", range(60))
def test_drawn_instructions_are_read_alike(seed: int, cell: Cell) -> None:
    same(drawn(seed), cell)


@pytest.fixture(scope="module")
def named(cell: Cell) -> Mapping[str, bytes]:
    return with_names(written(milled(cell, 60)))["job.mod"]


@pytest.mark.parametrize(
    ("line", "at_once"),
    [("SetDO do1,1;", True), ("VelSet 50,500;", True), ("ConfL\\Off;", True),
     ("WaitTime 1;", False), ("n1:=1;", False), ("elsewhere;", False),
     ("SetDO do1,DInput(di1);", False), ("Incr n1;", False), ("TPErase;", True),
     ("TPShow 1;", False)],
)  # fmt: skip
def test_moves_with_an_instruction_before_each(line, at_once, named, cell, monkeypatch):
    text = named["job.mod"].replace(b"MoveL p", f"{line}\n    MoveL p".encode())
    own = b"PROC TPShow(num k)\nConfL\\Off;\nENDPROC\nPROC main()\nVAR num n1;"
    files = {"job.mod": text.replace(b"PROC main()", own)}
    same(files, cell)
    assert (sum(folded(files, cell, monkeypatch)) > 50) is at_once
