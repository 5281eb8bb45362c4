"""Statements of KRL: the core against regular expressions, and what they say."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from postproc import _native
from postproc.exceptions import ProgramError
from postproc.language import ir
from postproc.language.krl import syntax as said
from postproc.language.krl.program import read_krl
from postproc.language.text.source import NumberSpans, Source
from tests.reference.krl_lines import krl_lines

PIECES = st.sampled_from([
    "DECL", "E6POS", "XP1", "E1", "A1", "STOOL2", "IF", "a", "$", "#", "&", ".", ",",
    ";", ":", "=", "==", "(", ")", "[", "]", "{", "}", "-", "+", "-1.5", "1E+3", "1",
    ".5", "X", "Y 2", "'B010'", "'HFF'", "'B012'", "'", "'H'", "; it \"s\"", "\n",
    "\r\n", "\r", " ", "\t", '"a;b"', '"open', '""', "\xe4\xb2", "\x01",
    '"\x01"', "x1y",
    "_2", "?", "|", "*", "/", "@", "\x7f", "{X ", "[i",
])  # fmt: skip
TEXTS = st.lists(PIECES, max_size=30).map("".join)
SHARED = Path(os.environ.get("POSTPROC_SHARED", Path(__file__).parents[4] / "shared"))
CORPUS = [
    *sorted(SHARED.glob("corpus/kuka_experimental/*.src")),
    *sorted(SHARED.glob("corpus/kuka_experimental/*.dat")),
    *sorted(SHARED.glob("corpus/robodk/*.src")),
]
ROOT = Path(__file__).parents[3]
OWN = sorted(p for p in (ROOT / "programs").rglob("*") if p.suffix in (".src", ".dat"))


def scanned(data):
    """Return what the core reads, statement by statement."""
    forms, by_statement, numbers, (names, name), opened = _native.scan_krl(data)
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


@settings(deadline=None, max_examples=400)
@given(TEXTS)
@example("\xef\xbb\xbfDEF m ( )")
@example("{X -1,Y - 2,Z a-3} ; -4")
@example("x=a-1\r\n&b\r\nx='B01'")
def test_the_core_reads_what_the_expressions_say(text):
    wanted = krl_lines(text)
    found, opened = scanned(text.encode("latin-1"))
    assert found == [(s.form, s.begin, s.end, s.numbers, s.names) for s in wanted]
    assert opened == [s.open for s in wanted if s.open >= 0]


def test_quoted_numbers():
    text = read_krl(Source("m.src", b"a={S 'B010',T 'h2F',X -'HF'}")).text
    assert text.value.tolist() == [2.0, 47.0, -15.0]
    new = _native.rewrite_numbers(
        b"'B010' 'HFE'", np.array([0, 7]), np.array([6, 12]), np.array([2.0, 3.0]),
        np.array([0, 0]),
    )  # fmt: skip
    assert new[0].tolist() == [1] and bytes(new[1].ravel()).rstrip(b"\0") == b"3"


def test_a_string_must_end():
    with pytest.raises(ProgramError, match=r"m\.src:2: a string"):
        read_krl(Source("m.src", b'x=1\r\ny="a\r\n'))


def one(text):
    """Parse the only statement of a text."""
    found = read_krl(Source("x.src", text.encode("latin-1"))).text
    assert len(found) == 1
    return found.statement(0)


X = ir.DataObject("x")


def given_as(name, way="in"):
    """Return a parameter, which a routine may change."""
    return ir.RoutineParameter(name, way == "out")


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("&ACCESS RVP", ir.SourceStatement()),
        ("GLOBAL DEF Weld1(a :IN, b[] :OUT)",
         ir.RoutineHead("def", "weld1", (given_as("a"), given_as("b", "out")))),
        ("deffct real f ( )", ir.RoutineHead("deffct", "f", (), True)),
        ("DEFDAT $CONFIG", ir.ScopeHead("defdat", "$config")),
        ("DEFDAT m PUBLIC", ir.ScopeHead("defdat", "m")),
        ("END", ir.BlockWord("end")),
        ("ENDSWITCH", ir.BlockWord("endtest")),
        ("DECL GLOBAL CONST INT N=3", ir.Declaration(
            "int", (ir.DeclaredItem("n", (), ir.Num(0)),), "const", "global")),
        ("INT i, j[4]", ir.Declaration("int", (
            ir.DeclaredItem("i"), ir.DeclaredItem("j", (ir.Num(0),))))),
        ("EXT weld(REAL :IN)", ir.SourceStatement()),
        ("GLOBAL ENUM kind a, b", ir.SourceStatement()),
        ("CONTINUE", said.ContinueWord()),
        ("WAIT SEC 0.5", said.Waiting(ir.Num(0))),
        ("HALT", said.Waiting()),
        ("RETURN x", ir.Leave("return", X)),
        ("again:", ir.LabelMark("again")),
        ("x[2].y = x", ir.Assignment(
            ir.DataObject("x", (ir.ElementStep((ir.Num(0),)), "y")), X)),
        ("f(1, , #a)", ir.Instruction("f", (
            ir.Argument(ir.Num(0)), ir.Argument(None),
            ir.Argument(said.EnumValue("#a"))))),
        ("f( )", ir.Instruction("f")),
        ("PTP x C_PTP C_DIS", said.KrlMove("ptp", X, words=("c_ptp", "c_dis"))),
        ("CIRC x,x,CA -90", said.KrlMove("circ", X, X, ir.Operation(
            "-", (ir.Num(0),)))),
        ("LIN_REL {X 5} #TOOL", said.KrlMove("lin_rel", said.KrlAggregate(
            "", (said.NamedField("x", ir.Num(0)),)), words=("#tool",))),
        ("SLIN x WITH $VEL.CP=1 C_SPL", said.KrlMove("slin", X, words=("c_spl",),
            settings=(ir.Assignment(
                ir.DataObject("$vel", ("cp",)), ir.Num(0)),))),
        ("x={FRAME: X 1}", ir.Assignment(X, said.KrlAggregate(
            "frame", (said.NamedField("x", ir.Num(0)),)))),
        ("x=x:x", ir.Assignment(X, ir.Operation(":", (X, X)))),
        ("INTERRUPT DECL 3 WHEN x DO f()", said.InterruptDeclared(
            ir.Num(0), X, ir.Instruction("f"))),
        ("TRIGGER WHEN PATH=-20 DELAY=0 DO f() PRIO=-1", said.PathTrigger(
            ir.Instruction("f"), (ir.Num(0), ir.Num(1), ir.Num(2)))),
    ],
)  # fmt: skip
def test_what_a_statement_says(text, wanted):
    assert one(text) == wanted


@pytest.mark.parametrize("text", ["ASYPTP XP1", "PTP IF", "LIN", "x = = 1"])
def test_what_is_not_understood(text):
    assert isinstance(one(text), ir.NotUnderstood)


@pytest.mark.skipif(not CORPUS, reason="no KRL programs of others at hand")
def test_programs_of_others_are_read_without_loss():
    for path in [*CORPUS, *OWN]:
        source = Source(path.name, path.read_bytes())
        file = read_krl(source)
        assert not file.diagnostics, file.diagnostics
        at = 3 if source.data.startswith(b"\xef\xbb\xbf") else 0
        for row in range(len(file.text)):
            span = file.text.span(row)
            between = source.data[at : span.start].decode("latin-1")
            for line in between.replace("\r", "\n").split("\n"):
                assert not line.partition(";")[0].strip()
            at = span.end
        again = read_krl(Source(path.name, bytes(source.data)))
        assert again.text.shapes == file.text.shapes


@pytest.mark.parametrize(
    "type_",
    ["CHAR[128]", "CHAR [128]", "CHAR[]", "REAL[6]", "INT[2,3]", "INT", "E6POS"],
)
def test_functions_return_arrays_too(type_):
    for begin in ("", "GLOBAL "):
        found = one(f"{begin}DEFFCT {type_} Label(n:IN)")
        wanted = ir.RoutineHead("deffct", "label", (given_as("n"),), not begin)
        assert found == wanted
