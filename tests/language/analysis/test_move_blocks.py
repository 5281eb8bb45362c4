"""Moves that are read at once are read as one by one."""

import re
from collections.abc import Mapping, Sequence

import numpy as np
import pytest

from postproc.compensation.program import read_program
from postproc.language.analysis.move_blocks import rows_of_lines
from postproc.language.analysis.to_visits import Collector
from postproc.language.analysis.visit_columns import chain_visits
from postproc.language.rapid.program import read_statements
from postproc.language.text.source import Source
from postproc.language.visits import Graph, Visits
from postproc.robot.cell import Cell, load_cell
from tests.any_controller import any_controller, told
from tests.bench.languages import milled, written
from tests.conftest import CELL
from tests.generated.neutral.landing import case
from tests.language.named_points import INLINE, name_points
from tests.language.one_by_one import differing, read

NOWHERE = "[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]"
WITH = "vWork,zone1,tWork\\WObj:=wPart;"


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Cell:
    path = tmp_path_factory.mktemp("cell") / "cell.toml"
    path.write_text(told(CELL))
    return any_controller(load_cell(path))


@pytest.fixture(scope="module")
def rows(cell: Cell) -> dict[str, Mapping[str, bytes]]:
    return written(milled(cell, 60))


def same(files: Mapping[str, bytes], cell: Cell, least: int = 3) -> Visits:
    """Read a program both ways; all columns are the same."""
    at_once = read(files, cell, least)
    assert [*differing(at_once, read(files, cell))] == []
    return at_once


def folded(
    files: Mapping[str, bytes], cell: Cell, patch: pytest.MonkeyPatch
) -> list[int]:
    """List how many moves each run that is read at once holds."""
    found = list[int]()

    def chained(counts: np.ndarray, origins: Sequence[Sequence[int]]) -> Graph:
        found.extend(counts[counts > 1].tolist())
        return chain_visits(counts, origins)

    with patch.context() as one:
        one.setattr("postproc.language.analysis.to_visits.chain_visits", chained)
        read(files, cell, 3)
    return found


@pytest.mark.parametrize("name", ["job.pdl", "job.mod", "job.src"])
def test_milled_rows_are_read_at_once(name, rows, cell, monkeypatch):
    same(rows[name], cell)
    assert sum(folded(rows[name], cell, monkeypatch)) > 40


@pytest.mark.parametrize("language", ["pdl2", "rapid", "krl"])
@pytest.mark.parametrize("seed", range(900, 915))
def test_drawn_programs_are_read_alike(seed, language, cell):
    same(case(seed, language, cell).text.files, cell)


def changed(
    files: Mapping[str, bytes], name: str, line: int, edit: str
) -> dict[str, bytes]:
    """Put a line in front of a line of the moves, {} standing for that line."""
    lines = files[name].decode().splitlines()
    first = next(
        k for k, one in enumerate(lines) if re.search("MoveL|SLIN|LINEAR TO", one)
    )
    at = first + line
    lines[at] = edit.replace("{}", lines[at])
    return {**files, name: "\n".join([*lines, ""]).encode()}


BREAKS = {
    "job.mod": {
        "a taught point": "{} ! @taught",
        "another zone": "    SpindleSpeed:=1;\n{}",
        "a comment": "    ! here\n{}",
        "an id": "    ! MEASURE h20\n{}",
        "a label": "  again:\n{}",
        "no rotation": f"    MoveL [[1,2,3],[0,0,0,0],{NOWHERE}],{WITH}\n{{}}",
        "two on a line": "{} {}",
        "a shift": f"    MoveL Offs([[1,2,3],[1,0,0,0],{NOWHERE}],1,0,0),{WITH}\n{{}}",
    },
    "job.src": {
        "a taught point": "{} ; @taught",
        "a load": "$LOAD.M=12\n{}",
        "a comment": "; here\n{}",
        "an id": "; MEASURE h20\n{}",
        "a label": "AGAIN:\n{}",
        "a wait": "WAIT SEC 0\n{}",
        "an interrupt": "INTERRUPT DECL 3 WHEN $IN[1] DO away( )\nINTERRUPT ON 3\n{}",
        "an interrupt later": "{}\nINTERRUPT DECL 3 WHEN $IN[1] DO away( )\n"
        "INTERRUPT ON 3",
        "a spline": "SPLINE\nSLIN {X 1,Y 2,Z 3,A 0,B 0,C 0}\n"
        "SLIN {X 2,Y 2,Z 3,A 0,B 0,C 0}\nSLIN {X 3,Y 2,Z 3,A 0,B 0,C 0}\n"
        "SLIN {X 4,Y 2,Z 3,A 0,B 0,C 0}\nENDSPLINE\n{}",
        "fewer numbers": "SLIN {X 1,Y 2}\nSLIN {X 1,Y 2}\nSLIN {X 1,Y 2}\n"
        "SLIN {X 1,Y 2}\n{}",
        "an orientation that stays": "$ORI_TYPE=#CONSTANT\n{}",
        "errors passed over": "ON_ERROR_PROCEED\n{}",
    },
}


@pytest.mark.parametrize(
    ("name", "what"), [(name, what) for name in BREAKS for what in BREAKS[name]]
)
@pytest.mark.parametrize("line", [1, 12])
def test_what_stands_between_is_told_as_ever(name, what, line, rows, cell):
    files = changed(rows[name], name, line, BREAKS[name][what])
    assert files[name] != rows[name]
    same(files, cell)


def test_loops_and_calls_repeat_a_run(rows, cell):
    text = rows["job.mod"]["job.mod"].decode()
    calls = "  FOR i FROM 1 TO 3 DO\n    cut;\n  ENDFOR\n  cut;\n  ENDPROC\n"
    text = text.replace("PROC main()", f"PROC main()\n{calls}  PROC cut()", 1)
    text = text.replace("    EXIT;\n", "", 1)
    visits = same({"job.mod": text.encode()}, cell)
    assert len(visits) == 4 * 62 and len(visits.literals) == 62
    krl = rows["job.src"]["job.src"].decode()
    krl = krl.replace("$VEL.CP", "FOR I=1 TO 3\r\n$VEL.CP", 1)
    krl = krl.replace("\r\nEND\r\n", "\r\nENDFOR\r\nEND\r\n", 1)
    krl = krl.replace("DEF job ( )", "DEF job ( )\r\nINT I")
    files = {**rows["job.src"], "job.src": krl.encode()}
    visits = same(files, cell)
    assert len(visits) == 3 * 62


def test_an_error_that_may_lead_anywhere_lets_nothing_be_read_at_once(
    rows, cell, monkeypatch
):
    text = rows["job.mod"]["job.mod"].decode()
    text = text.replace("  ENDPROC", "  ERROR\n    TRYNEXT;\n  ENDPROC", 1)
    files = {"job.mod": text.encode()}
    same(files, cell)
    assert folded(files, cell, monkeypatch) == []


# Points with names.

HALF = "vWork,zone1,tWork\\WObj:=wPart;"


@pytest.mark.parametrize("in_array", [False, True])
@pytest.mark.parametrize("name", INLINE)
def test_named_points_are_read_alike(name, in_array, rows, cell, monkeypatch):
    files = name_points(rows[name], name, in_array)
    visits = same(files, cell)
    assert (visits.target.literal >= 0).all() and not visits.reason.any()
    assert sum(folded(files, cell, monkeypatch)) > 40


OTHERWISE = {
    "job.mod": {
        "assigned": "p9:=p3;\n{}",
        "a component": "p9.trans.z:=5;\n{}",
        "shifted": f"MoveL Offs(p9,0,0,5),{HALF}\n{{}}",
        "turned": f"MoveL RelTool(p9,0,0,5\\Rz:=3),{HALF}\n{{}}",
        "twice": f"MoveL p9,{HALF}\n{{}}",
        "a joint move": f"MoveJ p9,{HALF}\n{{}}",
        "to no joints": f"MoveAbsJ p9,{HALF}\n{{}}",
        "read": "IF p9.trans.z>5 THEN\nENDIF\n{}",
        "written out": "write p9;\n{}",
        "undeclared": f"MoveL p999,{HALF}\n{{}}",
        "a speed": f"MoveL p9,v50\\V:=9,{HALF[6:]}\n{{}}",
        "a stop": "MoveL p9,vWork,fine,tWork\\WObj:=wPart;\n{}",
        "on its way": f'MoveLSync p9,{HALF[:-1]},"other";\n{{}}',
    },
    "job.src": {
        "assigned": "P9=P3\n{}",
        "a component": "P9.Z=5\n{}",
        "shifted": "LIN P9:{X 0,Y 0,Z 5,A 0,B 0,C 0}\n{}",
        "twice": "SLIN P9 C_SPL\n{}",
        "the other planner": "LIN P9 C_DIS\nLIN P10 C_DIS\nLIN P11 C_DIS\nLIN P12\n{}",
        "a joint move": "SPTP P9 C_SPL\n{}",
        "read": "IF P9.Z>5 THEN\nENDIF\n{}",
        "handed over": "OTHER(P9)\n{}",
        "undeclared": "SLIN P999 C_SPL\n{}",
        "home": "SLIN XHOME1 C_SPL\n{}",
        "an orientation that stays": "$ORI_TYPE=#CONSTANT\n{}",
        "an element": "SLIN PTS[3] C_SPL\n{}",
    },
    "job.pdl": {
        "assigned": "p9 := p3\n{}",
        "a component": "p9.z := 5\n{}",
        "twice": "MOVEFLY LINEAR TO p9 ADVANCE\n{}",
        "read": "IF p9.z > 5 THEN\nENDIF\n{}",
        "handed over": "other(p9)\n{}",
        "undeclared": "MOVEFLY LINEAR TO p999 ADVANCE\n{}",
    },
}


@pytest.mark.parametrize(
    ("name", "what"), [(name, what) for name in OTHERWISE for what in OTHERWISE[name]]
)
@pytest.mark.parametrize("line", [1, 12])
def test_what_else_is_done_with_a_point_is_told_as_ever(
    name, what, line, rows, cell, monkeypatch
):
    files = name_points(rows[name], name, in_array=False)
    edited = changed(files, name, line, OTHERWISE[name][what])
    assert edited[name] != files[name]
    same(edited, cell)


DECLARED = {
    "a routine's own": ("PROC main()", "PROC main()\nVAR robtarget p9;"),
    "persistent and set": ("CONST robtarget p9", "PERS robtarget p9"),
    "a variable": ("CONST robtarget p9", "VAR robtarget p9"),
    "local": ("CONST robtarget p9", "LOCAL CONST robtarget p9"),
    "beside its original": (
        "CONST robtarget p9:",
        "CONST robtarget o_p9:=p9;\nCONST robtarget p9:",
    ),
    "twice": ("CONST robtarget p9:", "CONST robtarget p9:=p3;\nCONST robtarget p9:"),
    "taught": ("CONST robtarget p9:", "! @taught\nCONST robtarget p9:"),
    "no rotation": (
        re.compile(r"(CONST robtarget p9:=\[\[.*?\]),\[.*?\]"),
        r"\1,[0,0,0,0]",
    ),
    "an axis": (re.compile(r"(CONST robtarget p9:=.*)\[9E9"), r"\1[7"),
    "another quarter": (
        re.compile(r"(CONST robtarget p9:=.*)\[0,0,0,0\]"),
        r"\1[-1,0,0,1]",
    ),
    "parts of others": (re.compile(r"(CONST robtarget p9:=\[)\[.*?\]"), r"\1[1,2,1+2]"),
}


@pytest.mark.parametrize("what", DECLARED)
def test_points_that_are_declared_otherwise_are_told_as_ever(
    what, rows, cell, monkeypatch
):
    files = name_points(rows["job.mod"], "job.mod", in_array=False)
    old, new = DECLARED[what]
    text = files["job.mod"].decode()
    edited = re.sub(
        old if isinstance(old, re.Pattern) else re.escape(old),
        new.replace("\n", "\\n"),
        text,
        count=1,
    )
    assert edited != text
    same({"job.mod": edited.encode()}, cell)


@pytest.mark.parametrize("in_array", [False, True])
@pytest.mark.parametrize("name", INLINE)
def test_steps_do_not_grow_with_moves(name, in_array, cell, monkeypatch):
    """A move more in a block is no step of the analysis, and no arrival of its own."""
    told = list[tuple[int, int]]()
    made = Collector.__init__

    def noted(self, machine, *rest):
        made(self, machine, *rest)
        told.append((machine.steps, len(self.found)))

    monkeypatch.setattr(Collector, "__init__", noted)
    for n in (60, 240):
        files = written(milled(cell, n))[name]
        read_program(name_points(files, name, in_array), cell)
    few, many = told
    assert few == many


def test_lines_are_found_by_the_statements_that_stand_on_them():
    text = read_statements(Source("a.mod", b"MODULE a\nVAR num x\n:=1;\nVAR num y;\n"))
    rows = rows_of_lines(text, {3})
    assert [text.quote(row) for row in rows] == ["'VAR num x :=1;'"]
    assert rows_of_lines(text, set()) == set()
