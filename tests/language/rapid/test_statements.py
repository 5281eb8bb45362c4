"""Statements of RAPID: the core against regular expressions, and what they say."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from postproc import _native
from postproc.exceptions import ProgramError
from postproc.language import ir
from postproc.language.rapid import syntax as said
from postproc.language.rapid.parser import parse_statement
from postproc.language.rapid.program import read_statements
from postproc.language.text.source import NumberSpans, Source
from tests.reference.statements import BEGINNING, statements

PIECES = st.sampled_from([
    *sorted(BEGINNING), "IF", "THEN", "FOR", "DO", "WHILE", "MoveL", "p10", "a",
    "Local", "task", "\\On", "\\", ".", ",", ";", ":", ":=", "(", ")", "[", "]", "{",
    "}", "=", "-", "+", "-1.5", "9E+09", "1", ".5", "0x1F", "2e", "! it; \"s\"", "\n",
    "\r\n",
    " ", "\t", '"a;b"', '"a""b"', '"open', '""', "%%%", "%", "<", "\xe4\xb2",
    "\x01", '"\x01"', "x1y", "_2", "?", "|", "*", "/", "@", "\x7f",
])  # fmt: skip
TEXTS = st.lists(PIECES, max_size=30).map("".join)


def scanned(data):
    """Return what the core reads, statement by statement."""
    forms, by_statement, numbers, (names, name), opened = _native.scan_statements(data)
    form, begin, end, first, name_first = by_statement
    where = NumberSpans(*numbers[0])
    places = list(zip(where.start.tolist(), where.end.tolist(), strict=True))
    found = []
    for k in range(len(form)):
        own = name[name_first[k] : name_first[k + 1]]
        found.append((
            forms[form[k]].decode("latin-1"), int(begin[k]), int(end[k]),
            tuple(places[first[k] : first[k + 1]]), tuple(names[n] for n in own),
        ))  # fmt: skip
    return found, opened


@settings(deadline=None)
@given(TEXTS)
@example("LOCAL TASK PROC p1()ENDPROC")
@example("ALIAS9E+09.ALIAS")
@example("\xef\xbb\xbfMODULE m")
def test_the_core_reads_what_the_expressions_say(text):
    wanted = statements(text)
    found, opened = scanned(text.encode("latin-1"))
    assert found == [(s.form, s.begin, s.end, s.numbers, s.names) for s in wanted]
    assert opened == [s.open for s in wanted if s.open >= 0]


@settings(deadline=None)
@given(TEXTS)
def test_between_statements_there_is_nothing_but_blanks_and_comments(text):
    at = 3 if text.startswith("\xef\xbb\xbf") else 0
    for _, begin, end, _, _ in [
        *scanned(text.encode("latin-1"))[0],
        ("", len(text), 0, (), ()),
    ]:
        for line in text[at:begin].replace("\r", "\n").split("\n"):
            assert not line.partition("!")[0].strip(
                "".join(map(chr, [*range(33), 127]))
            )
        at = end


def one(text):
    """Parse the only statement of a text."""
    source = Source("x.mod", text.encode("latin-1"))
    found = read_statements(source)
    assert len(found) == 1 and found.text(0) == text
    return found.statement(0)


given = ir.RoutineParameter
X, P10 = ir.DataObject("x"), ir.DataObject("p10")


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("MODULE Main(SYSMODULE, NOSTEPIN)",
         ir.ScopeHead("module", "main", ("sysmodule", "nostepin"))),
        ("LOCAL PROC weld1(num a, \\switch b | INOUT robtarget p{*}, \\VAR num c)",
         ir.RoutineHead("proc", "weld1", (
             given("a", type="num"), given("b", True, True),
             given("p", True), given("c", True, True)), True)),
        ("PROC weld(num a\\switch b|switch c,\\num d{*,*})",
         ir.RoutineHead("proc", "weld", (
             given("a", type="num"), given("b", True, True),
             given("c", type="switch"), given("d", True, True)))),
        ("FUNC robtarget near2(robtarget p)",
         ir.RoutineHead("func", "near2", (given("p", type="robtarget"),))),
        ("TRAP t_stop", ir.RoutineHead("trap", "t_stop")),
        ("LOCAL RECORD seam", ir.ScopeHead("record", "seam")),
        ("EndProc", ir.BlockWord("endproc")),
        ("TASK PERS num n{2, 3};",
         ir.Declaration("num", (
             ir.DeclaredItem("n", (ir.Num(0), ir.Num(1))),), "pers", "task")),
        ("CONST string s:=\"a;\"\"!b\";",
         ir.Declaration("string", (
             ir.DeclaredItem("s", (), ir.StringLiteral('"a;""!b"')),), "const")),
        ("ALIAS num level;", said.TypeAlias("num", "level")),
        ("IF x = 1 OR NOT y THEN", ir.Branch("if", (ir.Operation("OR", (
            ir.Operation("=", (X, ir.Num(0))),
            ir.Operation("NOT", (ir.DataObject("y"),)))),))),
        ("IF x p10:=x;", ir.CompactIf(X, ir.Assignment(P10, X))),
        ("FOR i FROM 1 TO 5 STEP -1 DO", ir.ForLoop("i", ir.Num(0), ir.Num(1),
            ir.Operation("-", (ir.Num(2),)))),
        ("WHILE x<2 DO",
         ir.Branch("while", (ir.Operation("<", (X, ir.Num(0))),))),
        ("CASE 1, 2:", ir.Branch("case", (ir.Num(0), ir.Num(1)))),
        ("DEFAULT:", ir.Branch("default")),
        ("again:", ir.LabelMark("again")),
        ("GOTO again;", ir.JumpTo("again")),
        ("RETURN x;", ir.Leave("return", X)),
        ("RAISE;", ir.Leave("raise")),
        ("TRYNEXT;", ir.Leave("trynext")),
        ("CONNECT i1 WITH t_stop;",
         said.ConnectTrap(ir.DataObject("i1"), "t_stop")),
        ("ERROR (ERR_A, ERR_B)", said.ErrorHandler((
            ir.DataObject("err_a"), ir.DataObject("err_b")))),
        ("p.trans.z:=list{2}.z+1;", ir.Assignment(
            ir.DataObject("p", ("trans", "z")),
            ir.Operation("+", (
                ir.DataObject("list", (ir.ElementStep((ir.Num(0),)), "z")),
                ir.Num(1))))),
        ("%\"weld\"% 1;", said.LateCall(ir.StringLiteral('"weld"'),
                                        (ir.Argument(ir.Num(0)),))),
        ("MoveL\\Conc,Offs(p10,0,0,-5),v100\\V:=x,fine,tool0\\WObj?w;",
         ir.Instruction("movel", (
             ir.Argument(None, "conc"),
             ir.Argument(ir.FunctionCall("offs", (
                 ir.Argument(P10), ir.Argument(ir.Num(0)),
                 ir.Argument(ir.Num(1)), ir.Argument(ir.Num(2))))),
             ir.Argument(ir.DataObject("v100")), ir.Argument(X, "v"),
             ir.Argument(ir.DataObject("fine")),
             ir.Argument(ir.DataObject("tool0")),
             ir.Argument(ir.DataObject("w"), "wobj", True)))),
        ("MoveL [[1,-2,3]],v1,\\Z:=x;", ir.Instruction("movel", (
            ir.Argument(ir.Composite((ir.Composite(
                (ir.Num(0), ir.Num(1), ir.Num(2))),))),
            ir.Argument(ir.DataObject("v1")), ir.Argument(X, "z")))),
        ("home;", ir.Instruction("home")),
        ("MoveL;x", None),
        ("MoveL THEN", None),
        ("ok(1);", ir.Instruction("ok", (ir.Argument(ir.Num(0)),))),
    ],
)  # fmt: skip
def test_what_a_statement_says(text, wanted):
    if wanted is not None:
        assert one(text) == wanted


def test_what_is_no_statement_is_not_understood():
    for text in ("MoveL then, v1;", "to:=1;", "MODULE else", "p 1 2;"):
        found = read_statements(Source("x.mod", text.encode()))
        assert any(
            isinstance(found.statement(k), ir.NotUnderstood) for k in range(len(found))
        ), text


def test_what_is_nested_too_deeply_is_not_understood():
    for opening, closing in ("[]", ("f(", ")"), ("-[", "]")):
        deep = f"x:={opening * 5000}1{closing * 5000};"
        assert isinstance(one(deep), ir.NotUnderstood)
    brackets = f"x:={'(' * 5000}1{')' * 5000};"  # say nothing, and count as nothing
    assert one(brackets) == ir.Assignment(X, ir.Num(0))
    long = parse_statement("x:=[" + ",".join("\0" * 200_000) + "];")
    assert isinstance(long, ir.NotUnderstood)


@pytest.mark.parametrize(
    ("data", "said_of_it"),
    [
        (b'MODULE m\n  TPWrite "open;\nENDMODULE', r"m\.mod:2: a string is not term"),
        (b"%%%\n  VERSION:1\nMODULE m", r"m\.mod:1: the header does not end.*%%%"),
    ],
)
def test_what_does_not_end_is_refused(data, said_of_it):
    with pytest.raises(ProgramError, match=said_of_it):
        read_statements(Source("m.mod", data))


def test_numbers_are_where_they_stand_and_what_they_are_worth():
    text = "MoveAbsJ [[-1.50,+2,9E+09,- 3,.5,0x10],[1,1,1,1,1,1]],v5,z1,t;"
    found = read_statements(Source("x.mod", text.encode()))
    cut = [
        text[a:b] for a, b in zip(found.numbers.start, found.numbers.end, strict=True)
    ]
    assert cut == ["-1.50", "+2", "9E+09", "- 3", ".5", "0x10", *"111111"]
    np.testing.assert_array_equal(
        found.value, [-1.5, 2.0, 9e9, -3.0, 0.5, 16.0] + [1.0] * 6
    )
