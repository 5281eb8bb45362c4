"""What expressions are worth, and which numbers they leave free."""

from __future__ import annotations

import pytest

from postproc.language.pdl2.interpreter import resolve
from postproc.language.pdl2.program import parse
from postproc.language.text.source import source_from_bytes
from postproc.language.visits import Visits

HEAD = """PROGRAM job
VAR p, q : POSITION
  n : INTEGER
BEGIN
p := POS(1, 2, 3, 4, 5, 6, '')
MOVE LINEAR TO p
q := p
"""


def visits(*lines: str, head: str = HEAD) -> Visits:
    text = "\n".join([head, *lines, "END job"])
    return resolve(parse(source_from_bytes("job.pdl", text.encode()))).visits


ALONG = {
    "p.x + 1": 2.0,
    "p.x - 1": 0.0,
    "(p.x)": 1.0,
    "(p.x) + 1": 2.0,
    "p.x + 1 + 2": 4.0,
    "p.x - (n + 1)": -4.0,
}


@pytest.mark.parametrize(("sum_", "x"), ALONG.items())
def test_a_part_plus_constants_moves_along_with_its_point(sum_: str, x: float):
    found = visits("n := 4", f"q.x := {sum_}", "MOVE LINEAR TO q")
    assert found.target.values[1][0] == x
    assert found.target.follows[1] == found.target.literal[0] == 0
    assert found.literals.pinned == ("",)


@pytest.mark.parametrize("used", ["1 + p.x", "p.x * 1", "-p.x", "ABS(p.x)"])
def test_a_part_that_is_computed_with_otherwise_stays(used: str):
    found = visits(f"q.x := {used}")
    assert found.literals.pinned == ("the program computes with a part of it",)


@pytest.mark.parametrize("line", ["n := p.x + 1", "IF p.x + 1 > 2 THEN\nENDIF"])
def test_a_sum_that_no_point_takes_keeps_the_part(line: str):
    found = visits(line)
    assert found.literals.pinned == ("the program computes with a part of it",)


FUNCTION = """PROGRAM job
VAR n : INTEGER
ROUTINE f : {}
BEGIN
  RETURN({})
END f
BEGIN
"""
ANSWERS = [("INTEGER", "0", "f = 0"), ("INTEGER", "1", "f = 1"),
           ("BOOLEAN", "FALSE", "NOT f"), ("BOOLEAN", "TRUE", "f")]  # fmt: skip


@pytest.mark.parametrize(("type_", "answer", "condition"), ANSWERS)
def test_what_a_function_returns_decides_a_way(type_: str, answer: str, condition: str):
    body = [f"IF {condition} THEN", "MOVE JOINT TO {1, 2, 3, 4, 5, 6}", "ELSE"]
    body += ["MOVE JOINT TO {2, 2, 3, 4, 5, 6}", "ENDIF"]
    found = visits(*body, head=FUNCTION.format(type_, answer))
    assert found.target.values[:, 0].tolist() == [1.0]


HIDING = """PROGRAM job
VAR p : POSITION FOR ARM[2]
ROUTINE go(p : POSITION)
BEGIN
  p := POS(1, 2, 3, 4, 5, 6, '')
  MOVE LINEAR TO p
END go
BEGIN
"""


def test_a_parameter_hides_a_variable_of_another_arm():
    found = visits("go(POS(2, 2, 3, 4, 5, 6, ''))", head=HIDING)
    assert found.target.values[:, 0].tolist() == [1.0]


def test_a_variable_is_named_as_it_is_declared():
    head = "PROGRAM job\nVAR MyPoint : POSITION\nBEGIN\n"
    found = visits("mypoint := POS(1, 2, 3, 4, 5, 6, '')", "MOVE TO MYPOINT", head=head)
    assert found.target.names[found.target.name[0]] == "MyPoint"


def test_one_assignment_asks_for_few_of_many_variables():
    many = "\n".join(f"  wp_{k} : POSITION" for k in range(500))
    text = (
        f"PROGRAM job\nVAR\n{many}\nBEGIN\nwp_7 := POS(1, 2, 3, 4, 5, 6, '')\nEND job"
    )
    program = parse(source_from_bytes("job.pdl", text.encode()))
    resolve(program)
    assert len(program.variables._made) < 5
