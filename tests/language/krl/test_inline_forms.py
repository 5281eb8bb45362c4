"""Inline forms of KRL are read at once as they are one by one."""

from __future__ import annotations

import random
from collections.abc import Mapping

import pytest

from postproc.compensation.program import read_program
from postproc.language.krl.interpreter import KrlMachine
from postproc.language.visits import Visits
from postproc.robot.cell import Cell
from tests.bench.languages import FORMS, milled, with_forms, with_names, written
from tests.language.analysis.test_move_blocks import cell, folded, same

assert cell  # a fixture

CONFIG = """DEFDAT  $CONFIG
DECL FRAME TOOL_DATA[3]
TOOL_DATA[1]={X 10,Y 0,Z 200,A 0,B 0,C 0}
TOOL_DATA[2]={X 10,Y 5,Z 250,A 0,B 90,C 0}
DECL FRAME BASE_DATA[3]
BASE_DATA[1]={X 900,Y 0,Z 500,A 0,B 0,C 0}
BASE_DATA[2]={X 900,Y 0,Z 500,A 90,B 0,C 0}
DECL LOAD LOAD_DATA[3]
LOAD_DATA[1]={M 5,CM {X 0,Y 0,Z 100,A 0,B 0,C 0},J {X 0,Y 0,Z 0}}
LOAD_DATA[2]={M 15,CM {X 0,Y 0,Z 100,A 0,B 0,C 0},J {X 0,Y 0,Z 0}}
DECL FDAT FDAT_ACT
DECL PDAT PDAT_ACT
DECL LDAT LDAT_ACT
ENDDAT
"""
INI = """GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO {} ( )
INTERRUPT ON 3"""
RARE = (
    "WAIT SEC 0", "$APO.CDIS=7", "$APO={CDIS 4,CPTP 20}", "$VEL.CP=0.3", "$ADVANCE=0",
    "$ADVANCE=3", "$TOOL=TOOL_DATA[2]", "BAS(#BASE,1)", "BAS(#TOOL,2)", "BAS(#FRAMES)",
    "BAS(#INITMOV,0)", "F1.TOOL_NO=2", "LC2.APO_DIST=3", "$OUT[3]=TRUE", "CONTINUE",
    "LIN {X 100,Z 50} C_DIS", "FDAT_ACT=F0", "FDAT_ACT.BASE_NO=2", "BASE_DATA[2].X=901",
    "$BASE.X=905", "ELSEWHERE()", "$ORI_TYPE=#CONSTANT", "$ORI_TYPE=#VAR",
    "$IPO_MODE=#BASE", "LDAT_ACT=LOCAL1", "X3.Z=X2.Z+5", "X4=X5", "$VEL=FAST1",
    "$TOOL={X 0,Y 0,Z 300,A 0,B 0,C 0}", "BAS(#VEL_CP,NUMBER1)", "NUMBER1=2",
    "SLIN X3 WITH $TOOL=STOOL2(F2), $APO=SAPO(LC3) C_SPL",
    "PTP X2 C_PTP", "LIN X1", "LIN X7 C_DIS ; @taught", "PULSE($OUT[1],TRUE,1)",
    "$TIMER[1]=0", "LIN X8 C_DIS", "ON_ERROR_PROCEED", "INTERRUPT OFF 3",
    "TRIGGER WHEN DISTANCE=0 DELAY=0 DO $OUT[1]=TRUE", "INTERRUPT ON 3",
)  # fmt: skip


def drawn(seed: int) -> dict[str, bytes]:
    """Draw a program of inline forms, with other statements and blocks between."""
    draw = random.Random(seed)
    rare = draw.choice([0.0, 0.03, 0.2])
    lines = [
        "DEF job ( )",
        "DECL LDAT LOCAL1",
        *["DECL FDAT F2"] * (draw.random() < 0.2),
    ]
    lines += [INI.format(draw.choice(["IR_STOPM"] * 9 + ["AWAY"]))]
    lines += ["BAS(#INITMOV,0)", "BAS(#TOOL,1)", "BAS(#BASE,1)", "PTP X1"]
    for _ in range(draw.randint(1, 4)):
        inner = [line for _ in range(draw.randint(3, 9)) for line in _form(draw, rare)]
        head, end = draw.choice(
            [(), (), ("FOR K=1 TO 2", "ENDFOR"), ("LOOP", "ENDLOOP"), ("A1:", "B1:"),
             ("IF $IN[1] THEN", "ENDIF"), ("WHILE $IN[2]", "ENDWHILE")]
        ) or ("", "")  # fmt: skip
        lines += [head, *inner, end]
    lines += ["GOTO A1"] * (lines.count("A1:") == 1 and draw.random() < 0.3)
    data = ["DEFDAT job", "DECL INT NUMBER1=1", "DECL INT K"]
    for k in range(1, 9):
        place = f"X {900 + k},Y {k},Z {draw.choice([600, 610])}"
        data.append(f"DECL E6POS X{k}={{{place},A 0,B 90,C 0,S 2,T 35,E1 0}}")
    data[-1] = "DECL E6POS X8={X 905,Y 3,Z 611}"
    for k in range(1, 5):
        tool, base = draw.choice([1, 1, 1, 2]), draw.choice([1, 1, 1, 2])
        word = draw.choice(["BASE"] * 9 + ["TCP"])
        data.append(
            f"DECL FDAT F{k}={{TOOL_NO {tool},BASE_NO {base},IPO_FRAME #{word},"
            'POINT2[] " "}'
        )
        size = draw.choice([5, 5, 5, 50])
        data.append(f"DECL LDAT LC{k}={{VEL 2,APO_DIST {size},ORI_TYP #VAR}}")
        mode = draw.choice(["#CPTP", "#CPTP", "#CDIS"])
        data.append(f"DECL PDAT PP{k}={{VEL 100,APO_DIST {size},APO_MODE {mode}}}")
    data += ["DECL FDAT F0={TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE}"]
    files = {"job.src": [*lines, "END"], "job.dat": [*data, "ENDDAT"]}
    texts = {name: "\n".join([*own, ""]) for name, own in files.items()}
    texts["$config.dat"] = CONFIG
    return {name: text.encode() for name, text in texts.items()}


def _form(draw: random.Random, rare: float) -> list[str]:
    """Draw a form, some of its lines left out, or something else."""
    if draw.random() < rare:
        return [draw.choice(RARE)]
    point, kind, k = draw.randint(1, 7), draw.choice("LLLPN"), draw.randint(1, 4)
    f, speed = draw.randint(1, 4), draw.choice(["0.2", "0.2", "0.5"])
    if kind == "N":
        sets = [f"$VEL=SVEL_CP({speed}, , LC{k})", f"$TOOL=STOOL2(F{f})",
                f"$BASE=SBASE(F{f}.BASE_NO)", f"$IPO_MODE=SIPO_MODE(F{f}.IPO_FRAME)",
                f"$LOAD=SLOAD(F{f}.TOOL_NO)", f"$APO=SAPO(LC{k})"]  # fmt: skip
        return [f"SLIN X{point} WITH {', '.join(sets)} C_SPL"]
    lines = [f"LDAT_ACT=LC{k}", f"FDAT_ACT=F{f}", f"BAS(#CP_PARAMS,{speed})"]
    move = [f"LIN X{point} C_DIS"]
    if kind == "P":
        lines = [f"PDAT_ACT=PP{k}", f"FDAT_ACT=F{f}", "BAS(#PTP_PARAMS,100)"]
        move = [f"PTP X{point} C_PTP"]
    kept = [line for line in lines if draw.random() > rare]
    return ["$BWDSTART=FALSE", *kept, "SET_CD_PARAMS (0)", *move]


@pytest.mark.parametrize("seed", [*range(60), 1172])
def test_drawn_forms_are_read_alike(seed: int, cell: Cell) -> None:
    same(drawn(seed), cell)


@pytest.fixture(scope="module")
def named(cell: Cell) -> Mapping[str, bytes]:
    return with_names(written(milled(cell, 60)))["job.src"]


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_forms_of_a_pendant_are_read_at_once(form, named, cell, monkeypatch):
    files = with_forms(named, form)
    same(files, cell)
    assert sum(folded(files, cell, monkeypatch)) > 50
    assert _known(read_program(files, cell).visits) == 60


def test_an_interrupt_that_moves_nothing_leaves_forms_read_at_once(
    named, cell, monkeypatch
):
    files = with_forms(named, FORMS["KSS 5 to 7"])
    for action, many in (("IR_STOPM", True), ("AWAY", False)):
        source = files["job.src"].replace(b"IR_STOPM", action.encode())
        own = {**files, "job.src": source}
        same(own, cell)
        assert (sum(folded(own, cell, monkeypatch)) > 50) is many


def test_data_that_hold_the_same_are_copied_once(named, cell, monkeypatch):
    found = list[str]()
    carry_out = KrlMachine.carry_out

    def counted(self, at, one, here):
        found.append(str(one))
        return carry_out(self, at, one, here)

    monkeypatch.setattr(KrlMachine, "carry_out", counted)
    read_program(with_forms(named, FORMS["KSS 5 to 7"]), cell)
    assert len(found) < 60 * 2


def _known(visits: Visits) -> int:
    """Count the visits that nothing speaks against, in lines."""
    return int((visits.reason[1:-1] == 0).sum())
