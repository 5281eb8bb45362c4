"""RAPID files: round trip, statements counted, no move unseen, every number's place."""

import os
import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings

from postproc.exceptions import ProgramError
from postproc.language import ir
from postproc.language.rapid import syntax as said
from postproc.language.rapid.instructions import MOTIONS, read_known_instructions
from postproc.language.rapid.program import read_rapid
from postproc.language.rapid.targets import WIDTH, RecordKind, find_literals
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
    "welding.mod": (73, 9, {"late-binding": 1, "unknown-instruction": 2}),
    "Comments.mod": (9, 0, {}),
    "Fields.mod": (4, 0, {"unknown-statement": 1}),
    "IfStatements.mod": (13, 0, {"unknown-statement": 1}),
    "Modules.mod": (15, 0, {"open-block": 3, "unknown-statement": 5}),
    "Routines.mod": (10, 0, {"open-block": 3, "unknown-statement": 5}),
    "Structures.mod": (
        20, 0, {"unknown-statement": 6, "open-block": 3, "unknown-instruction": 3},
    ),
    "Variables.mod": (15, 0, {"unknown-statement": 1, "unknown-instruction": 1}),
    "keywords.mod": (33, 0, {"unknown-statement": 18, "open-block": 12}),
    "numbers.mod": (1, 0, {"unknown-statement": 1}),
    "Program.mod": (24, 6, {"unknown-instruction": 1}),
    "ABB.sys": (24, 6, {"unknown-instruction": 1}),
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
    spans = [
        Span(a, b) for a, b in zip(text.start.tolist(), text.stop.tolist(), strict=True)
    ]
    same = Replacements.of(Edit(span, data[span.start : span.end]) for span in spans)
    assert same.apply(data) == data
    other = apply(data, [Edit(span, b"7.25") for span in spans])
    again = read_rapid(Source(path.name, other))
    assert len(again.text) == len(text) and (again.text.value == 7.25).all()
    assert list(again.text.said.shapes) == list(text.said.shapes)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_no_statement_that_may_move_is_passed_in_silence(path):
    """What is neither a move nor listed is something that moves nothing."""
    file = read(path)
    own = {scope.head.name for scope in file.routines}
    seen = {move.row for move in file.moves}
    listed = {one.line for one in file.diagnostics}
    for row in range(len(file.text)):
        statement = file.text.statement(row)
        while isinstance(statement, said.CompactIf):
            statement = statement.statement
        quiet = row not in seen and file.text.line(row) not in listed
        if quiet and not in_record(file, row):
            assert not isinstance(statement, ir.NotUnderstood | said.LateCall)
            if isinstance(statement, ir.Instruction):
                assert statement.name in read_known_instructions().keys() | own
                assert statement.name not in MOTIONS


def in_record(file, row):
    """Tell whether a statement stands between RECORD and what ends it."""
    inside = False
    for k in range(len(file.text)):
        statement = file.text.statement(k)
        if isinstance(statement, said.RecordHead) and k < row:
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
    moves = {(m.name, file.text.line(m.row)): m for m in file.moves}
    named = {name for name, _ in moves}
    assert named == {"moveabsj", "movej", "movel", "arclstart", "arcc", "searchl"}
    (search,) = (m for m in file.moves if m.name == "searchl")
    assert search.to == ir.DataObject("p10") and not search.signature.reaches
    (arc,) = (m for m in file.moves if m.name == "arcc")
    assert isinstance(arc.via, ir.Composite) and isinstance(arc.to, ir.Composite)
    assert [m.condition for m in file.moves].count(True) == 1
    (shifted,) = (m for m in file.moves if m.condition)
    assert isinstance(shifted.to, ir.FunctionCall) and shifted.to.name == "offs"
    wobj = next(a for a in shifted.arguments if a.name == "wobj")
    assert wobj.value == ir.DataObject("wtable")


def test_data_with_its_place():
    file = read(WELDING)
    data = {one.declared.name: one for one in file.data}
    assert len(data) == 16
    assert (data["s1"].module, data["s1"].routine) == ("welding", "main")
    assert (data["phome"].module, data["phome"].routine) == ("welding", "")
    assert data["phome"].declared.scope == "local"
    assert data["ttorch"].declared.scope == "task"
    assert data["list"].declared.dimensions == (ir.Num(0),)
    kinds = Counter(one.declared.type for one in file.data)
    assert kinds["robtarget"] == 4 and kinds["tooldata"] == kinds["wobjdata"] == 1
    routines = [(s.head.kind, s.head.name, s.head.local) for s in file.routines]
    assert routines == [
        ("proc", "main", False), ("proc", "weld", True), ("func", "ready", False),
        ("trap", "t_stop", False),
    ]  # fmt: skip
    (module,) = file.modules
    assert module.head.attributes == ("sysmodule", "nostepin")
    assert (module.first, module.last) == (1, len(file.text) - 1)


def test_every_number_of_every_target_is_found_in_its_bytes():
    file = read(WELDING)
    found = find_literals(file.text, RecordKind.ROBTARGET)
    data = file.text.source.data
    assert found.value.shape == (6, WIDTH[RecordKind.ROBTARGET])
    np.testing.assert_array_equal(found.value[:, :3], [
        [1250, -0.25, 1500], [1000.5, 200, 900], [1, 2, 3], [4, 5, 6],
        [10, 20, 30], [40, 50, 60],
    ])  # fmt: skip
    written = [data[a:b] for a, b in zip(found.start[1], found.stop[1], strict=True)]
    assert written == (
        b"1000.5 200 900 0.00123 -0.70711 0.70711 0 -1 0 -1 0".split() + [b"9E+09"] * 6
    )
    joints = find_literals(file.text, RecordKind.JOINTTARGET)
    np.testing.assert_array_equal(joints.value[:, 1], [-20.5, 0.0])
    poses = find_literals(file.text, RecordKind.POSE)
    assert len(poses) == 4  # a tool, both frames of a work object, a pose
    moved = Replacements.of(
        Edit(Span(int(a), int(b)), b"1234.500")
        for a, b in zip(found.start[:, 0], found.stop[:, 0], strict=True)
    )
    again = find_literals(
        read_rapid(Source("w.mod", moved.apply(data))).text, RecordKind.ROBTARGET
    )
    assert (again.value[:, 0] == 1234.5).all()
    np.testing.assert_array_equal(again.value[:, 1:], found.value[:, 1:])


def test_numbers_of_one_form_are_found_in_every_statement_of_it():
    """A milling job: thousands of moves, one form."""
    moves = "".join(
        f"MoveL [[{k}.5,-{k},0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],"
        f"v{k},z1,t1;\r\n"
        for k in range(3000)
    )
    file = read_rapid(
        Source("m.mod", f"MODULE m\r\nPROC a()\r\n{moves}ENDPROC\r\nENDMODULE".encode())
    )
    found = find_literals(file.text, RecordKind.ROBTARGET)
    np.testing.assert_array_equal(found.value[:, 1], -np.arange(3000.0))
    np.testing.assert_array_equal(found.row, np.arange(3000) + 2)
    assert len(file.text.said.shapes.texts) == 5 and not file.diagnostics


@pytest.mark.parametrize(
    ("body", "code", "text"),
    [
        ("IF a THEN MoveL p1,v1,z1,t;", "open-block", "'IF a THEN' has no ENDIF"),
        ("ENDFOR", "open-block", "'ENDFOR' ends no FOR"),
        ("CASE 1:", "open-block", "'CASE 1:' stands in no TEST"),
        ("MoveC p1;", "unknown-statement", "'MoveC p1;' has too few positions"),
        ("Fly p1;", "unknown-instruction", "Fly p1;' is neither .* may move"),
        ("MoveL p1 v1;", "unknown-statement", "'MoveL p1 v1;' is not understood"),
        ("%x%;", "late-binding", "may move"),
        ("IF a Fly p1;", "unknown-instruction", "IF a Fly p1;' is neither"),
        ("StepBwdPath 3, 1;", "unknown-instruction", "may move"),
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
    for kind in RecordKind:
        find_literals(file.text, kind)
    rows = [scope for scope in (*file.modules, *file.routines)]
    assert all(0 <= scope.first <= scope.last < len(file.text) for scope in rows)


def test_a_record_without_an_end_hides_no_move():
    data = b"MODULE m\nRECORD r\nnum n;\nMoveL p1,v1,z1,t;\nENDMODULE\n"
    file = read_rapid(Source("m.mod", data))
    assert [move.name for move in file.moves] == ["movel"]
    assert [(d.line, d.code) for d in file.diagnostics] == [
        (2, "open-block"), (3, "unknown-instruction"),
    ]  # fmt: skip


def test_a_routine_without_an_end_does_not_swallow_the_next():
    data = b"MODULE m\nPROC a()\nMoveL p1,v1,z1,t;\nPROC b()\nENDPROC\n"
    file = read_rapid(Source("m.mod", data))
    assert [(s.head.name, s.first, s.last) for s in file.routines] == [
        ("a", 1, 2), ("b", 3, 4),
    ]  # fmt: skip
    assert [one.line for one in file.diagnostics] == [1, 2] and len(file.moves) == 1
