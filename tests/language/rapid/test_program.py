"""RAPID files: round trip, statements counted, no move unseen, every number's place."""

import os
import re
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import example, given, settings

from postproc.exceptions import ProgramError
from postproc.language import ir
from postproc.language.rapid.instructions import MOTIONS
from postproc.language.rapid.program import read_rapid
from postproc.language.text.source import Edit, Replacements, Source, Span, apply
from tests.language.rapid.test_statements import TEXTS
from tests.reference.statements import statements

SHARED = Path(os.environ.get("POSTPROC_SHARED", Path(__file__).parents[4] / "shared"))
CORPUS = SHARED / "corpus"
WELDING = Path(__file__).with_name("welding.mod")
BROKEN = (
    "Comments Fields IfStatements Modules Routines Structures Variables keywords "
    "numbers"
)
FILES = [
    WELDING,
    *(CORPUS / "intellij-rapid" / f"{name}.mod" for name in BROKEN.split()),
    CORPUS / "robodk" / "Program.mod",
    CORPUS / "robodk" / "ABB.sys",
]
# Statements, moves, and what is listed, of every file.
COUNTED = {
    "welding.mod": (73, 9, {}),
    "Comments.mod": (9, 0, {}),
    "Fields.mod": (4, 0, {"unknown-statement": 1}),
    "IfStatements.mod": (13, 0, {"unknown-statement": 1}),
    "Modules.mod": (15, 0, {"open-block": 3, "unknown-statement": 5}),
    "Routines.mod": (10, 0, {"open-block": 3, "unknown-statement": 5}),
    "Structures.mod": (
        20, 0, {"unknown-statement": 6, "open-block": 3},
    ),
    "Variables.mod": (15, 0, {"unknown-statement": 1}),
    "keywords.mod": (33, 0, {"unknown-statement": 18, "open-block": 12}),
    "numbers.mod": (1, 0, {"unknown-statement": 1}),
    "Program.mod": (24, 6, {}),
    "ABB.sys": (24, 6, {}),
}  # fmt: skip


def read(path):
    if not path.exists():
        pytest.skip(f"{path} is not here")
    return read_rapid(Source(path.name, path.read_bytes()))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_every_byte_is_a_statement_s_or_between_two(path):
    file = read(path)
    data, at, parts = file.text.source.data, 0, []
    for row in range(len(file.text)):
        start, end = file.text.span(row)
        assert at <= start < end
        parts += [data[at:start], data[start:end]]
        at = end
    assert b"".join([*parts, data[at:]]) == data
    assert len(file.text) == len(statements(data.decode("latin-1")))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_every_number_can_be_written_where_it_stands(path):
    """Numbers put back as they are give the file; others change nothing else."""
    file = read(path)
    data, text = file.text.source.data, file.text
    start, end = text.numbers.start.tolist(), text.numbers.end.tolist()
    places = zip(start, end, strict=True)
    spans = [Span(a, b) for a, b in places]
    same = Replacements.of(Edit(span, data[span.start : span.end]) for span in spans)
    assert same.apply(data) == data
    other = apply(data, [Edit(span, b"7.25") for span in spans])
    again = read_rapid(Source(path.name, other))
    assert len(again.text) == len(text) and (again.text.value == 7.25).all()
    assert again.text.said.shapes == text.said.shapes


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_no_statement_that_may_move_is_passed_in_silence(path):
    """What is neither a move nor listed is understood, and no move."""
    file = read(path)
    seen = {*file.moves}
    listed = {one.line for one in file.diagnostics}
    for row in range(len(file.text)):
        statement = file.text.statement(row)
        while isinstance(statement, ir.CompactIf):
            statement = statement.statement
        quiet = row not in seen and file.text.line(row) not in listed
        if quiet and not in_record(file, row):
            assert not isinstance(statement, ir.NotUnderstood)
            if isinstance(statement, ir.Instruction):
                assert statement.name not in MOTIONS


def in_record(file, row):
    """Tell whether a statement stands between RECORD and what ends it."""
    inside = False
    for k in range(len(file.text)):
        statement = file.text.statement(k)
        if getattr(statement, "kind", "") == "record" and k < row:
            inside = True
        elif inside and isinstance(statement, ir.BlockWord):
            inside = False
            if row < k:
                return statement.word == "endrecord"
    return False


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_statements_and_moves_are_counted(path):
    file = read(path)
    codes = dict(Counter(one.code for one in file.diagnostics))
    assert (len(file.text), len(file.moves), codes) == COUNTED[path.name]


def test_moves_with_their_positions():
    file = read(WELDING)
    moves = [file.text.statement(row) for row in file.moves]
    named = {ir.inside(move).name: ir.inside(move) for move in moves}
    assert set(named) == {"moveabsj", "movej", "movel", "arclstart", "arcc", "searchl"}
    to, _ = MOTIONS["searchl"].operands(named["searchl"].arguments)
    assert to == ir.DataObject("p10") and not MOTIONS["searchl"].reaches
    ends = MOTIONS["arcc"].operands(named["arcc"].arguments)
    assert all(isinstance(end, ir.Composite) for end in ends)
    (shifted,) = (ir.inside(one) for one in moves if isinstance(one, ir.CompactIf))
    to, _ = MOTIONS[shifted.name].operands(shifted.arguments)
    assert isinstance(to, ir.FunctionCall) and to.name == "offs"
    wobj = next(a for a in shifted.arguments if a.name == "wobj")
    assert wobj.value == ir.DataObject("wtable")


def test_data_with_its_place():
    file = read(WELDING)
    data = {one.name: one for one in file.data}
    assert len(data) == 16
    assert (data["s1"].module, data["s1"].routine) == ("welding", "main")
    assert (data["phome"].module, data["phome"].routine) == ("welding", "")
    assert data["phome"].scope == "local"
    assert data["ttorch"].scope == "task"
    assert data["list"].dimensions == (ir.Num(0),)
    kinds = Counter(one.type for one in file.data)
    assert kinds["robtarget"] == 4 and kinds["tooldata"] == kinds["wobjdata"] == 1
    routines = [(s.head.kind, s.head.name, s.head.local) for s in file.routines]
    assert routines == [
        ("proc", "main", False), ("proc", "weld", True), ("func", "ready", False),
        ("trap", "t_stop", False),
    ]  # fmt: skip
    (module,) = file.modules
    assert module.head.attributes == ("sysmodule", "nostepin")
    assert (module.first, module.last) == (1, len(file.text) - 1)


def test_a_milling_job_has_one_shape():
    """Thousands of moves, one form."""
    moves = "".join(
        f"MoveL [[{k}.5,-{k},0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],"
        f"v{k},z1,t1;\r\n"
        for k in range(3000)
    )
    file = read_rapid(
        Source("m.mod", f"MODULE m\r\nPROC a()\r\n{moves}ENDPROC\r\nENDMODULE".encode())
    )
    assert file.moves.tolist() == [*range(2, 3002)]
    assert len(file.text.said.shapes.texts) == 5 and not file.diagnostics


@pytest.mark.parametrize(
    ("body", "code", "text"),
    [
        ("IF a THEN MoveL p1,v1,z1,t;", "open-block", "'IF a THEN' has no ENDIF"),
        ("ENDFOR", "open-block", "this ENDFOR closes or divides no"),
        ("CASE 1:", "open-block", "this CASE closes or divides no block"),
        ("MoveC p1;", "unknown-statement", "'MoveC p1;' has too few positions"),
        ("MoveL p1 v1;", "unknown-statement", "'MoveL p1 v1;' is not understood"),
    ],
)
def test_what_is_odd_is_listed_with_its_line(body, code, text):
    data = f"MODULE m\nPROC a()\n{body}\nENDPROC\nENDMODULE\n".encode()
    (found,) = read_rapid(Source("m.mod", data)).diagnostics
    assert (found.file, found.line, found.code) == ("m.mod", 3, code)
    assert re.search(text, found.message)


@settings(deadline=None)  # the first one makes the parser's tables
@given(TEXTS)
@example("p10\\Onp10")
def test_whatever_the_text_it_is_read_or_refused(text):
    try:
        file = read_rapid(Source("m.mod", text.encode("latin-1")))
    except ProgramError as refused:
        assert refused.line is not None
        return
    rows = [scope for scope in (*file.modules, *file.routines)]
    assert all(0 <= scope.first <= scope.last < len(file.text) for scope in rows)


def test_a_record_without_an_end_hides_no_move():
    data = b"MODULE m\nRECORD r\nnum n;\nMoveL p1,v1,z1,t;\nENDMODULE\n"
    file = read_rapid(Source("m.mod", data))
    assert [file.text.line(row) for row in file.moves] == [4]
    assert [(d.line, d.code) for d in file.diagnostics] == [(2, "open-block")]


def test_a_routine_without_an_end_does_not_swallow_the_next():
    data = b"MODULE m\nPROC a()\nMoveL p1,v1,z1,t;\nPROC b()\nENDPROC\n"
    file = read_rapid(Source("m.mod", data))
    assert [(s.head.name, s.first, s.last) for s in file.routines] == [
        ("a", 1, 2), ("b", 3, 4),
    ]  # fmt: skip
    assert [one.line for one in file.diagnostics] == [1, 2] and len(file.moves) == 1
