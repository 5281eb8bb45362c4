"""What a run leaves in variables is what the next run may begin with."""

from __future__ import annotations

import pytest

from postproc.language.pdl2.interpreter import resolve
from postproc.language.pdl2.program import parse
from postproc.language.pdl2.variable_file import read_variables
from postproc.language.text.source import source_from_bytes
from postproc.language.visits import Meaning, Visits

FILE = b"""p POS Priv
 X: 1.5  Y: 2.5  Z: 3.5  A: 4.5  E: 5.5  R: 6.5
 CNFG: ''
q POS Priv
 X: 7.5  Y: 2.5  Z: 3.5  A: 4.5  E: 5.5  R: 6.5
 CNFG: ''
n INT Priv 2
t APOS[3] Priv
 [1]:
  X: 10  Y: 2.5  Z: 3.5  A: 4.5  E: 5.5  R: 6.5
  CNFG: ''
 [2]:
  X: 20  Y: 2.5  Z: 3.5  A: 4.5  E: 5.5  R: 6.5
  CNFG: ''
 [3]:
  X: 30  Y: 2.5  Z: 3.5  A: 4.5  E: 5.5  R: 6.5
  CNFG: ''
"""
HEAD = """PROGRAM job
VAR p, q, s : POSITION
  n, k : INTEGER
  t : ARRAY[3] OF POSITION
  f : BOOLEAN
BEGIN
"""


def visits(*lines: str) -> Visits:
    text = HEAD + "\n".join(lines) + "\nEND job\n"
    values = read_variables(source_from_bytes("job.lsv", FILE))
    return resolve(
        parse(source_from_bytes("job.pdl", text.encode())), None, values
    ).visits


def known(found: Visits) -> list[bool]:
    """Tell which targets are known, and may be edited."""
    own = found.target.literal.tolist()
    free = [k >= 0 and not found.literals.pinned[k] for k in own]
    poses = found.target.meaning == Meaning.POSE
    return [f and bool(p) for f, p in zip(free, poses, strict=True)]


@pytest.mark.parametrize(
    ("lines", "wanted"),
    [
        (["MOVE TO p", "p := q"], [False]),
        (["MOVE TO p", "p := q", "MOVE TO p"], [False, False]),
        (["p := q", "MOVE TO p"], [True]),
        (["p := p", "MOVE TO p"], [True]),
        (["MOVE TO p", "n := n + 1"], [True]),
        (["MOVE TO t[n]", "n := n + 1"], [False]),
        (["n := 1", "MOVE TO t[n]", "n := n + 1"], [True]),
        (["n := n + 1", "MOVE TO t[2]"], [True]),
        (["MOVE TO t[2]", "t[2] := q"], [False]),
        (["MOVE TO t[1]", "t[2] := q"], [True]),
        (["MOVE TO t[1]", "t[k] := q"], [False]),
        (["IF f THEN", "p := q", "ENDIF", "MOVE TO p"], [False]),
        (["MOVE TO p", "READ (p)"], [False]),
        (["MOVE TO p", "p.Z := 80", "MOVE TO q"], [False, True]),
        (["s := p", "MOVE TO s", "MOVE TO p", "p := q"], [False, False]),
    ],
)  # fmt: skip
def test_what_is_taken_before_it_is_assigned(
    lines: list[str], wanted: list[bool]
) -> None:
    assert known(visits(*lines)) == wanted


def test_the_reason_says_so() -> None:
    found = visits("MOVE TO p", "p := q")
    assert "the next run begins with" in found.reasons[found.reason[0]].text


def test_a_number_set_before_it_is_used_is_known() -> None:
    found = visits("p.Z := 80", "MOVE TO p", "MOVE TO q")
    assert found.target.values[0].tolist() == [1.5, 2.5, 80, 4.5, 5.5, 6.5]
    assert known(found) == [False, True]  # its numbers stand in two files


def test_a_position_without_a_value_may_be_what_the_last_run_left() -> None:
    last = "s := POS(1, 2, 3, 4, 5, 6, '')"
    assert known(visits("MOVE TO s", last, "MOVE TO s")) == [False, False]
    assert known(visits(last, "MOVE TO s")) == [True]


def test_a_routine_begins_anew() -> None:
    text = """PROGRAM job
ROUTINE go
VAR p : POSITION
BEGIN
  MOVE TO p
  p := POS(1, 2, 3, 4, 5, 6, '')
  MOVE TO p
END go
BEGIN
  go
  go
END job
"""
    source = source_from_bytes("job.pdl", text.encode())
    assert known(resolve(parse(source)).visits) == [False, True, False, True]


def test_numbers_stay_of_what_a_shift_of_unknown_size_may_move_to() -> None:
    lines = ["s := POS_SHIFT(p, VEC(n, 0, 0))", "MOVE TO s", "MOVE TO p", "READ (n)"]
    assert known(visits(*lines)) == [False, False]
    assert known(visits(*lines[2:])) == [True]
