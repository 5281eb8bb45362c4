"""Handlers, recursion and functions: what they may do is found in every file."""

from __future__ import annotations

import pytest

from postproc.language.language import JobReading
from postproc.language.pdl2.interpreter import resolve
from postproc.language.pdl2.program import parse
from postproc.language.text.source import Source
from postproc.language.visits import ELSEWHERE, Meaning

AT = "POS(1, 2, 3, 0, 180, 0, '')"
ON = ["ENABLE CONDITION[1]"]


def program(name: str, head: list[str], body: list[str]) -> str:
    return "\n".join([f"PROGRAM {name}", *head, "BEGIN", *body, f"END {name}", ""])


def handler(*actions: str) -> list[str]:
    return ["CONDITION[1] :", "WHEN $DIN[1]+ DO", *actions, "ENDCONDITION", *ON]


def routine(name: str, *body: str, takes: str = "") -> list[str]:
    return [f"ROUTINE {name}{takes}", "BEGIN", *body, f"END {name}"]


def resolved(main: str, **pages: str) -> JobReading:
    found = {n: parse(Source(f"{n}.pdl", t.encode())) for n, t in pages.items()}
    return resolve(parse(Source("job.pdl", main.encode())), others=found)


def codes(found: JobReading) -> set[str]:
    return {d.code for d in found.diagnostics}


def last(found: JobReading, file: int = 0) -> tuple[Meaning, list[int], str]:
    """Return target, origins and reason of the last visit in a file."""
    v = found.visits
    row = max(n for n in range(len(v)) if v.place.file[n] == file)
    reason = v.reasons[v.reason[row]].text
    return Meaning(v.target.meaning[row]), v.graph.predecessors(row).tolist(), reason


def test_a_handler_changes_what_a_parameter_stands_for():
    head = [
        "VAR p : POSITION",
        *routine("r", "MOVE LINEAR TO a", takes="(a : POSITION)"),
    ]
    body = [*handler("p.X := 9"), f"p := {AT}", "r(p)"]
    target, _, reason = last(resolved(program("job", head, body)))
    assert target == Meaning.UNKNOWN and "handler changes it" in reason


def test_a_handler_changes_a_component_that_is_copied():
    head = ["VAR p, q : POSITION"]
    copy = [f"q := {AT}", f"p := {AT}", "q.X := p.X", "MOVE LINEAR TO q"]
    body = [*handler("p.X := 9"), *copy]
    assert last(resolved(program("job", head, body)))[0] == Meaning.UNKNOWN


def test_a_handler_moves_by_a_routine_of_another_file():
    page = program("page", routine("s", f"MOVE LINEAR TO {AT}"), [])
    head = ["IMPORT 'page'", "ROUTINE s EXPORTED FROM page"]
    found = resolved(program("job", head, [*handler("s"), f"MOVE LINEAR TO {AT}"]),
                     page=page)  # fmt: skip
    assert "handler-moves" in codes(found)
    assert ELSEWHERE in last(found)[1]


def test_a_handler_changes_variables_by_a_routine_of_another_file():
    share = "g : POSITION EXPORTED FROM page"
    page = program("page", [f"VAR {share} GLOBAL", *routine("s", "g.X := 9")], [])
    head = ["IMPORT 'page'", f"VAR {share}", "ROUTINE s EXPORTED FROM page"]
    body = [*handler("s"), f"g := {AT}", "MOVE LINEAR TO g"]
    found = resolved(program("job", head, body), page=page)
    assert last(found)[0] == Meaning.UNKNOWN


def test_a_loop_whose_counter_a_handler_changes_has_any_number_of_rounds():
    loop = ["FOR i := 1 TO 3 DO", f"MOVE LINEAR TO {AT}", "ENDFOR"]
    found = resolved(program("job", ["VAR i : INTEGER"], [*handler("i := 3"), *loop]))
    assert len(found.visits) == 1
    assert sorted(last(found)[1]) == [-1, 0]


def test_a_page_calls_a_routine_of_the_program_that_calls_it():
    head = ["IMPORT 'job'", "ROUTINE r EXPORTED FROM job"]
    page = program("page", [*head, *routine("s", "r")], [])
    head = ["IMPORT 'page'", "ROUTINE s EXPORTED FROM page"]
    head += routine("r", f"MOVE LINEAR TO {AT}")
    found = resolved(program("job", head, ["s"]), page=page)
    assert "routine-assumed-motionless" not in codes(found) and len(found.visits) == 1


def test_recursion_through_another_file_forgets_what_that_file_changes():
    share = "g : POSITION EXPORTED FROM page"
    back = ["IMPORT 'job'", "ROUTINE r EXPORTED FROM job", f"VAR {share} GLOBAL"]
    page = program("page", [*back, *routine("s", "r", "g.X := 9")], [])
    head = ["IMPORT 'page'", "ROUTINE s EXPORTED FROM page", f"VAR {share}"]
    inside = ["IF $DIN[1] THEN", "s", "ENDIF"]
    head += routine("r", *inside)
    body = [f"g := {AT}", "r", "MOVE LINEAR TO g"]
    found = resolved(program("job", head, body), page=page)
    assert "recursion" in codes(found)
    assert last(found)[0] == Meaning.UNKNOWN


def test_moves_that_a_function_may_make_are_listed_with_their_points():
    moving = routine("r", f"MOVE LINEAR TO {AT}")
    head = [*moving, "ROUTINE f : INTEGER", "BEGIN", "r", "RETURN(1)", "END f"]
    found = resolved(program("job", ["VAR n : INTEGER", *head], ["r", "n := f"]))
    v = found.visits
    origins = [v.graph.predecessors(n).tolist() for n in range(len(v))]
    assert sorted(origins) == [[ELSEWHERE], [-1]]
    unknown = origins.index([ELSEWHERE])
    assert "f, which is not followed" in v.reasons[v.reason[unknown]].text
    assert len(set(v.target.literal.tolist())) == 1  # so that its numbers stay


LINES = [[f"again:: MOVE LINEAR TO {AT}"],
         ["SELECT n OF", f"ELSE: MOVE LINEAR TO {AT}", "ENDSELECT"],
         ["SELECT n OF", f"CASE (1): MOVE LINEAR TO {AT}", "ENDSELECT"]]  # fmt: skip


@pytest.mark.parametrize("lines", LINES, ids=["label", "else", "case"])
def test_a_move_behind_another_word_of_its_line_is_listed_too(lines: list[str]):
    head = ["ROUTINE f : INTEGER", "BEGIN", *lines, "RETURN(1)", "END f"]
    found = resolved(program("job", ["VAR n : INTEGER", *head], ["n := f"]))
    assert len(found.visits) == 1 and not found.missed


def test_a_point_given_to_a_function_keeps_its_numbers():
    head = ["ROUTINE f(a : POSITION) : INTEGER", "BEGIN", "MOVE LINEAR TO a"]
    head += ["RETURN(1)", "END f"]
    body = [f"p := {AT}", "MOVE LINEAR TO p", "n := f(p)"]
    found = resolved(program("job", ["VAR p : POSITION", "n : INTEGER", *head], body))
    assert found.visits.literals.pinned == ("f may move to it",)


WAITS = [
    "WAIT FOR sets(1)",
    "WAIT FOR NOT ($DIN[1] AND sets(1) = 2)",
    "WAIT FOR sets",
    "MOVE JOINT TO {0, 0, -90, 0, 90, 0} TIL sets(1)",
]


@pytest.mark.parametrize("wait", WAITS)
def test_a_function_in_a_condition_has_its_effects(wait):
    takes = "(n : INTEGER) : BOOLEAN" if "(1)" in wait else " : BOOLEAN"
    sets = routine("sets", "$TOOL := POS(0, 0, 9, 0, 0, 0, '')", takes=takes)
    target, _, reason = last(
        resolved(program("job", sets, [wait, f"MOVE LINEAR TO {AT}"]))
    )
    assert target == Meaning.UNKNOWN or "$TOOL is not known here" in reason


@pytest.mark.parametrize("wait", ["WAIT FOR tf(1, 1) = 3", "MOVE TO {0} TIL x > rtf()"])
def test_a_function_from_elsewhere_in_a_condition_may_set_frames(wait):
    found = resolved(program("job", [], [wait, f"MOVE LINEAR TO {AT}"]))
    assert "$TOOL" in last(found)[2]


def test_words_before_brackets_in_a_condition_call_nothing():
    body = ["WAIT FOR ($DIN[1] OR (NOT ($DIN[2])))", f"MOVE LINEAR TO {AT}"]
    assert codes(resolved(program("job", [], body))) == codes(
        resolved(program("job", [], body[1:]))
    )
