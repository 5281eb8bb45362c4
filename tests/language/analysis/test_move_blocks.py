"""Moves that are read at once are read as one by one."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass

import numpy as np
import pytest

from postproc.compensation.program import read_program
from postproc.language.analysis import move_blocks
from postproc.language.analysis.move_blocks import rows_of_lines
from postproc.language.analysis.visit_columns import chain_visits
from postproc.language.rapid.program import read_statements
from postproc.language.text.source import Source
from postproc.language.visits import Graph, Visits
from postproc.robot.cell import Cell, load_cell
from tests.any_controller import any_controller, told
from tests.bench.languages import milled, written
from tests.conftest import CELL
from tests.generated.neutral.landing import case

ONE_BY_ONE = 10**9
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


def read(
    files: Mapping[str, bytes], cell: Cell, least: int, patch: pytest.MonkeyPatch
) -> Visits:
    """Read a program; runs of `least` moves are read at once."""
    with patch.context() as one:
        one.setattr(move_blocks, "LEAST", least)
        return read_program(files, cell).visits


def differing(a: object, b: object) -> Iterator[str]:
    """Yield the names of what differs between two results."""
    for name in (f.name for f in fields(a)):  # type: ignore[arg-type]
        one, other = getattr(a, name), getattr(b, name)
        if isinstance(one, np.ndarray):
            nan = one.dtype.kind == "f"
            if not np.array_equal(one, other, equal_nan=nan):
                yield name
        elif is_dataclass(one) and name != "dialect":
            yield from (f"{name}.{inner}" for inner in differing(one, other))
        elif one != other and name not in ("dialect", "shifts"):
            yield name


def same(
    files: Mapping[str, bytes], cell: Cell, patch: pytest.MonkeyPatch, least: int = 3
) -> Visits:
    """Read a program both ways; all columns are the same."""
    at_once = read(files, cell, least, patch)
    assert [*differing(at_once, read(files, cell, ONE_BY_ONE, patch))] == []
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
        read(files, cell, 3, patch)
    return found


@pytest.mark.parametrize("name", ["job.mod", "job.src"])
def test_milled_rows_are_read_at_once(name, rows, cell, monkeypatch):
    same(rows[name], cell, monkeypatch)
    assert sum(folded(rows[name], cell, monkeypatch)) > 40


@pytest.mark.parametrize("language", ["rapid", "krl"])
@pytest.mark.parametrize("seed", range(900, 915))
def test_drawn_programs_are_read_alike(seed, language, cell, monkeypatch):
    same(case(seed, language, cell).text.files, cell, monkeypatch)


def changed(
    files: Mapping[str, bytes], name: str, line: int, edit: str
) -> dict[str, bytes]:
    """Put a line in front of a line of the moves, {} standing for that line."""
    lines = files[name].decode().splitlines()
    first = next(k for k, one in enumerate(lines) if "MoveL" in one or "SLIN" in one)
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
def test_what_stands_between_is_told_as_ever(name, what, line, rows, cell, monkeypatch):
    files = changed(rows[name], name, line, BREAKS[name][what])
    assert files[name] != rows[name]
    same(files, cell, monkeypatch)


def test_loops_and_calls_repeat_a_run(rows, cell, monkeypatch):
    text = rows["job.mod"]["job.mod"].decode()
    calls = "  FOR i FROM 1 TO 3 DO\n    cut;\n  ENDFOR\n  cut;\n  ENDPROC\n"
    text = text.replace("PROC main()", f"PROC main()\n{calls}  PROC cut()", 1)
    text = text.replace("    EXIT;\n", "", 1)
    visits = same({"job.mod": text.encode()}, cell, monkeypatch)
    assert len(visits) == 4 * 62 and len(visits.literals) == 62
    krl = rows["job.src"]["job.src"].decode()
    krl = krl.replace("$VEL.CP", "FOR I=1 TO 3\r\n$VEL.CP", 1)
    krl = krl.replace("\r\nEND\r\n", "\r\nENDFOR\r\nEND\r\n", 1)
    krl = krl.replace("DEF job ( )", "DEF job ( )\r\nINT I")
    files = {**rows["job.src"], "job.src": krl.encode()}
    visits = same(files, cell, monkeypatch)
    assert len(visits) == 3 * 62


def test_an_error_that_may_lead_anywhere_lets_nothing_be_read_at_once(
    rows, cell, monkeypatch
):
    text = rows["job.mod"]["job.mod"].decode()
    text = text.replace("  ENDPROC", "  ERROR\n    TRYNEXT;\n  ENDPROC", 1)
    files = {"job.mod": text.encode()}
    same(files, cell, monkeypatch)
    assert folded(files, cell, monkeypatch) == []


def test_lines_are_found_by_the_statements_that_stand_on_them():
    text = read_statements(Source("a.mod", b"MODULE a\nVAR num x\n:=1;\nVAR num y;\n"))
    rows = rows_of_lines(text, {3})
    assert [text.quote(row) for row in rows] == ["'VAR num x :=1;'"]
    assert rows_of_lines(text, set()) == set()
