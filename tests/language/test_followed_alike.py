"""What a program decides and gives on its ways is followed alike in all languages."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from postproc.compensation.program import read_program
from postproc.diagnostics import Code
from postproc.language.visits import ELSEWHERE, START, Visits
from postproc.robot.cell import Cell

RAPID = """MODULE job
PERS wobjdata w1:=[FALSE,TRUE,"",[[600,0,800],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
PERS wobjdata w2:=[FALSE,TRUE,"",[[600,0,800],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
PERS wobjdata w3:=[FALSE,TRUE,"",[[600,9,800],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
PERS wobjdata w:=[FALSE,TRUE,"",[[600,0,800],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
PERS tooldata t:=[TRUE,[[0,0,300],[1,0,0,0]],[80,[0,0,100],[1,0,0,0],0,0,0]];
CONST robtarget p1:=[[1,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
CONST robtarget p2:=[[2,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
VAR robtarget v;
VAR robtarget s{2};
VAR num n;
VAR num k;
VAR num m;
PROC main()
%s
EXIT;
ENDPROC
%s
ENDMODULE
"""
KRL = """DEF job( )
DECL INT n
DECL INT k
DECL E6POS v
DECL E6POS s[2]
$TOOL={X 0,Y 0,Z 300,A 0,B 0,C 0}
$BASE={X 600,Y 0,Z 800,A 0,B 0,C 0}
%s
END
%s
"""
DATA = """DEFDAT job PUBLIC
DECL E6POS p1={X 1,Y 0,Z 0,A 0,B 0,C 0,S 2,T 2}
DECL E6POS p2={X 2,Y 0,Z 0,A 0,B 0,C 0,S 2,T 2}
DECL INT m
ENDDAT
"""
PDL2 = """PROGRAM job
VAR
  n, k, m : INTEGER
  p1, p2, v : POSITION
  s : ARRAY[2] OF POSITION
%s
BEGIN
  $TOOL := POS(0, 0, 300, 0, 0, 0, '')
  $UFRAME := POS(600, 0, 800, 0, 0, 0, '')
  p1 := POS(1, 0, 0, 0, 0, 0, '')
  p2 := POS(2, 0, 0, 0, 0, 0, '')
  %s
END job
"""
WORDS = {
    "rapid": {
        "set {} := {}": "{}:={};", "if {}": "IF {} THEN", "input": "di1=1",
        "else": "ELSE", "end": "ENDIF", "go {}": "MoveL {},v200,fine,t\\WObj:=w;",
        "frame {}": "w:=w{};", "call {}": "next {};", "arc": "MoveC p1,p2,v200,fine,"
        "t\\WObj:=w;", "inner": "inner;",
    },
    "krl": {
        "set {} := {}": "{}={}", "if {}": "IF {} THEN", "input": "$IN[1]",
        "else": "ELSE", "end": "ENDIF", "go {}": "LIN {}",
        "frame {}": "$BASE={{X 600,Y {},Z 800,A 0,B 0,C 0}}", "call {}": "next({})",
        "arc": "CIRC p1,p2", "inner": "inner( )",
    },
    "pdl2": {
        "set {} := {}": "{} := {}", "if {}": "IF {} THEN", "input": "$DIN[1]",
        "else": "ELSE", "end": "ENDIF", "go {}": "MOVE LINEAR TO {}",
        "frame {}": "$UFRAME := POS(600, {}, 800, 0, 0, 0, '')", "call {}": "next({})",
        "arc": "MOVE CIRCULAR TO p2 VIA p1", "inner": "inner",
    },
}  # fmt: skip
LANGUAGES = [*WORDS]
ROUTINES_WITH_LOCALS = {
    "rapid": "PROC inner()\nLINES\nIF l<3 THEN\nMoveL p1,v200,fine,t\\WObj:=w;\nELSE"
    "\nMoveL p2,v200,fine,t\\WObj:=w;\nENDIF\nENDPROC\n",
    "krl": "DEF inner( )\nDECL INT l\nLINES\nIF l<3 THEN\nLIN p1\nELSE\nLIN p2\n"
    "ENDIF\nEND\n",
    "pdl2": "ROUTINE inner\nVAR\n  l : INTEGER\nBEGIN\n  LINES\n  IF l < 3 THEN\n"
    "    MOVE LINEAR TO p1\n  ELSE\n    MOVE LINEAR TO p2\n  ENDIF\nEND inner\n",
}
FRAME_Y = {"1": "0", "2": "0", "3": "9"}
ROUTINES = {
    "rapid": """
PROC next(INOUT num a)
a:=a+1;
ENDPROC
FUNC num plus(num a)
RETURN a+1;
ENDFUNC
FUNC num sets(num a)
m:=a;
RETURN a;
ENDFUNC
FUNC robtarget up(num a)
VAR robtarget r;
r:=p1;
r.trans.x:=r.trans.x+a;
RETURN r;
ENDFUNC
""",
    "krl": """
DEF next(a:OUT)
DECL INT a
a=a+1
END
DEFFCT INT plus(a:IN)
DECL INT a
RETURN (a+1)
ENDFCT
DEFFCT INT sets(a:IN)
DECL INT a
m=a
RETURN (a)
ENDFCT
DEFFCT E6POS up(a:IN)
DECL INT a
DECL E6POS r
r=p1
r.X=r.X+a
RETURN (r)
ENDFCT
""",
    "pdl2": """
ROUTINE next(a : INTEGER)
BEGIN
  a := a + 1
END next
ROUTINE plus(a : INTEGER) : INTEGER
BEGIN
  RETURN(a + 1)
END plus
ROUTINE sets(a : INTEGER) : INTEGER
BEGIN
  m := a
  RETURN(a)
END sets
ROUTINE up(a : INTEGER) : POSITION
VAR
  r : POSITION
BEGIN
  r := p1
  r.X := r.X + a
  RETURN(r)
END up
""",
}


def visits(cell: Cell, language: str, *lines: str) -> Visits:
    """Write a program in a language and follow it."""
    body = "\n".join(_say(language, line) for line in lines)
    match language:
        case "rapid":
            files = {"job.mod": RAPID % (body, ROUTINES[language])}
        case "krl":
            files = {"job.src": KRL % (body, ROUTINES[language]), "job.dat": DATA}
        case _:
            files = {"job.pdl": PDL2 % (ROUTINES[language], body)}
    given = {name: text.encode() for name, text in files.items()}
    return read_program(given, cell).visits


def _say(language: str, line: str) -> str:
    """Write one line: its words, and what they are about."""
    words = WORDS[language]
    for form, text in words.items():
        begin, *rest = form.split(" ")
        if not line.startswith(begin):
            continue
        parts = line.split(" ", 1)[1:]
        if len(rest) == 3:
            parts = line.split(" ", 1)[1].split(" := ")
        parts = [part.replace("input", words["input"]) for part in parts]
        if language == "rapid":
            parts = [part.replace("[", "{").replace("]", "}") for part in parts]
        if begin == "frame" and language != "rapid":
            parts = [FRAME_Y[parts[0]]]
        return text.format(*parts)
    raise ValueError(line)


def codes(found: Visits) -> Sequence[str]:
    """Return the codes of what keeps visits from being corrected."""
    return [found.reasons[k].code or "" for k in found.reason.tolist()]


def branch(*lines: str, other: Sequence[str] = ()) -> tuple[str, ...]:
    """Run lines where an input is on, others where it is not."""
    return ("if input", *lines, *(("else", *other) if other else ()), "end")


@pytest.mark.parametrize("language", LANGUAGES)
def test_equal_frames_on_two_ways(language: str, bench_cell: Cell) -> None:
    lines = branch("frame 2", other=("frame 1",))
    assert codes(visits(bench_cell, language, *lines, "go p1")) == [""]
    lines = branch("frame 3", other=("frame 1",))
    wanted = [Code.FRAME_UNKNOWN]
    assert codes(visits(bench_cell, language, *lines, "go p1")) == wanted


@pytest.mark.parametrize("language", LANGUAGES)
def test_an_element_that_is_a_copy_of_what_is_not_known_holds_its_numbers(
    language: str, bench_cell: Cell
) -> None:
    either = ("set v := p1", *branch("set v := p2", "go v"))
    found = visits(bench_cell, language, *either, "set s[1] := v", "go s[1]", "go p1")
    assert codes(found)[1] and found.target.literal[1] == -1
    moved = found.target.literal[[0, 2]]
    assert (moved >= 0).all() and all(found.literals.pinned[k] for k in moved)


@pytest.mark.parametrize("language", LANGUAGES)
def test_an_element_that_only_the_run_tells_holds_all_of_them(
    language: str, bench_cell: Cell
) -> None:
    two = "set s[1] := p1", "set s[2] := p2"
    found = visits(bench_cell, language, *two, "set v := s[m]", "go v", "go s[1]")
    assert codes(found)[0] and found.literals.pinned[found.target.literal[1]]


@pytest.mark.parametrize("index", [1, 2])
def test_an_element_of_which_one_that_only_the_run_tells_is_a_copy(
    index: int, bench_cell: Cell
) -> None:
    """A move to any element of `s` may go to the numbers of `row{1}`."""
    point = RAPID.partition("p1:=")[2].partition(";")[0]
    row = f"CONST robtarget row{{2}}:=[{point},{point}];\nVAR num n;"
    body = "\n".join(
        [
            f"s{{1}}:=row{{{index}}};",
            *(_say("rapid", f"go {to}") for to in ("s[m]", "row[1]")),
        ]
    )
    text = RAPID.replace("VAR num n;", row, 1) % (body, ROUTINES["rapid"])
    found = read_program({"job.mod": text.encode()}, bench_cell).visits
    why = found.literals.pinned[found.target.literal[1]]
    assert codes(found)[0] and "a move goes to s, which row is copied to" in why


@pytest.mark.parametrize("language", LANGUAGES)
def test_points_that_are_copied_on_two_ways(language: str, bench_cell: Cell) -> None:
    same = branch("set v := p1", other=("set v := p2", "set v := p1"))
    found = visits(bench_cell, language, *same, "go v", "go p1")
    assert codes(found) == ["", ""]
    assert found.target.literal[0] == found.target.literal[1] >= 0
    other = branch("set v := p1", other=("set v := p2",))
    found = visits(bench_cell, language, *other, "go v", "go p1")
    assert codes(found)[0] == Code.RUNTIME_VALUE
    assert found.literals.pinned[found.target.literal[1]]


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        (("set n := 2",), [1.0]),
        (("set n := 4",), [2.0]),
        (branch("set n := 2", other=("set n := 1",)), [1.0, 2.0]),
        (branch("set n := 2", other=("set k := 2", "set n := k")), [1.0]),
        (("set n := 2", "call n"), [2.0]),
        (("set n := 2", *branch("call n")), [1.0, 2.0]),
    ],
)
def test_conditions_of_known_numbers(
    language: str, given: Sequence[str], wanted: list[float], bench_cell: Cell
) -> None:
    lines = (*given, "if n < 3", "go p1", "else", "go p2", "end")
    found = visits(bench_cell, language, *lines)
    assert found.target.values[:, 0].tolist() == wanted


@pytest.mark.parametrize("language", LANGUAGES)
def test_one_side_decides_a_condition(language: str, bench_cell: Cell) -> None:
    lines = ("set n := 2", "if (input) AND (n > 3)", "go p1", "end", "go p2")
    found = visits(bench_cell, language, *lines)
    assert found.target.values[:, 0].tolist() == [2.0]


@pytest.mark.parametrize("language", LANGUAGES)
def test_an_arc_from_two_places_ends_behind_its_middle(
    language: str, bench_cell: Cell
) -> None:
    lines = ("go p1", *branch("go p2"), "arc", "go p1")
    found = visits(bench_cell, language, *lines)
    before = [found.graph.predecessors(k).tolist() for k in range(len(found))]
    assert before == [[START], [0], [0, 1], [2], [3]]


@pytest.mark.parametrize("language", LANGUAGES)
def test_numbers_that_functions_return(language: str, bench_cell: Cell) -> None:
    lines = ("set n := 2", "set k := plus(plus(n))", "if k < 4", "go p1", "end")
    found = visits(bench_cell, language, *lines, "if n < 3", "go p2", "end")
    assert found.target.values[:, 0].tolist() == [2.0]


@pytest.mark.parametrize("language", LANGUAGES)
def test_functions_that_do_more_are_not_followed(
    language: str, bench_cell: Cell
) -> None:
    lines = ("set n := sets(2)", "if n < 3", "go p1", "end", "go p2")
    found = visits(bench_cell, language, *lines)
    assert found.target.values[:, 0].tolist() == [1.0, 2.0]
    assert found.graph.predecessors(1).tolist() == [START, 0]


@pytest.mark.parametrize("language", LANGUAGES)
def test_points_that_functions_return_are_not_corrected(
    language: str, bench_cell: Cell
) -> None:
    found = visits(bench_cell, language, "set n := 5", "go up(n)", "go p1")
    assert found.target.values[:, 0].tolist() == [6.0, 1.0]
    assert codes(found) == [Code.COMPUTED_TARGET, ""]
    assert found.target.literal.tolist() == [-1, 0] and found.literals.pinned[0]


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_call_that_is_not_followed_changes_no_data_of_a_routine(
    language: str, bench_cell: Cell
) -> None:
    unknown = {"rapid": "VAR num l;\nl:=2;\nelsewhere;", "krl": "l=2\nelsewhere( )",
               "pdl2": "l := 2\n  elsewhere"}  # fmt: skip
    text = ROUTINES_WITH_LOCALS[language].replace("LINES", unknown[language])
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(ROUTINES, language, ROUTINES[language] + text)
        found = visits(bench_cell, language, "inner")
    assert [found.target.names[k] for k in found.target.name.tolist()] == ["p1"]
    assert found.graph.predecessors(0).tolist() == [ELSEWHERE]


# Who may call a routine that nothing in the job calls.

ALONE = {
    "rapid": ("LOCAL PROC own()\nv:=Offs(p2,0,0,5);\nk:=v.trans.x;\nENDPROC", "LOCAL "),
    "krl": ("GLOBAL DEF own( )\nDECL E6POS w\nw=p2\nw.X=w.X+w.Y\nEND", "GLOBAL "),
    "pdl2": ("ROUTINE own EXPORTED FROM job\nBEGIN\n  v := p2\n  v.X := v.X + 5\n"
             "END own\n", " EXPORTED FROM job"),
}  # fmt: skip


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("alone", [True, False])
def test_a_routine_that_nothing_calls_counts_where_others_may_call_it(
    language: str, alone: bool, bench_cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    text, word = ALONE[language]
    if alone != (language == "rapid"):
        text = text.replace(word, "")
    monkeypatch.setitem(ROUTINES, language, ROUTINES[language] + text)
    found = visits(bench_cell, language, "go p1", "go p2")
    assert bool(found.literals.pinned[found.target.literal[1]]) != alone


@pytest.mark.parametrize("language", LANGUAGES)
def test_numbers_that_only_rounding_tells_apart_decide_no_way(
    language: str, bench_cell: Cell
) -> None:
    """Controllers compute with fewer digits: to them 0.1 * 3 may be less than 0.3."""
    ways = ("if 0.1*3<0.3", "go p1", "else", "go p2", "end")
    assert len(visits(bench_cell, language, *ways)) == 2
    ways = ("if 0.1*3<0.31", "go p1", "else", "go p2", "end")
    assert len(visits(bench_cell, language, *ways)) == 1
