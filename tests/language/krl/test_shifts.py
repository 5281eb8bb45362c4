"""Numbers of shifts in moves, which stay where one of their points is not known."""

from __future__ import annotations

import pytest

from tests.language.krl.test_visits import DATA, job, reasons

BY = "{X 0,Y 0,Z 20,A 0,B 0,C 0}"
LAST = "XS[3]={X 3,Y 0,Z 0,A 0,B 0,C 0,S 2,T 2}"
POINTS = {
    "known": LAST,
    "without a value": "",
    "computed": LAST.replace("X 3", "X 1+2"),
    "with missing numbers": "XS[3]={X 3,Y 0,Z 0}",
    "with S of a controller's own model": LAST.replace("S 2", "S 18"),
    "without S and T": LAST.replace(",S 2,T 2", ""),
}
WORDS = {"behind": f"LIN XS[I]:{BY}", "before": f"LIN {BY}:XS[I]",
         "of a joint move": f"PTP {BY}:XS[I]"}  # fmt: skip


def read(*lines, last=LAST):
    data = DATA.replace(LAST, last) + "DECL INT I\nDECL INT K\n"
    return job(*lines, data=data)


def pin_of_shift(found):
    """Return why the numbers in the move must stay: it is the only literal of m.src."""
    v = found.visits.literals
    own = [
        pin for pin, file in zip(v.pinned, v.file.tolist(), strict=True) if file == 0
    ]
    assert len(own) == 1
    return own[0]


@pytest.mark.parametrize("move", WORDS.values(), ids=WORDS)
@pytest.mark.parametrize("point", POINTS)
def test_a_shift_of_a_point_that_is_not_known_keeps_its_numbers(move, point):
    found = read("FOR I=1 TO 3", "LIN XS[I]", move, "ENDFOR", last=POINTS[point])
    joint = move.startswith("PTP")
    known = point == "known" or (point == "without S and T" and not joint)
    pin = pin_of_shift(found)
    assert ("shifts a point, too" in pin) != known and (pin == "") == known
    assert reasons(found)[:4] == [""] * 4 and (reasons(found)[5] == "") == known


def test_an_element_that_a_joint_move_cannot_go_to_holds_no_other():
    lines = ["FOR I=1 TO 3", "LIN XS[I]", WORDS["of a joint move"], "ENDFOR"]
    found = read(*lines, last=POINTS["without S and T"]).visits.literals
    pins = dict(zip(found.name, found.pinned, strict=True))
    assert pins["xs[1]"] == pins["xs[2]"] == ""
    assert pins["xs[3]"] == "xs[3] is shifted without S and T"


@pytest.mark.parametrize("move", WORDS.values(), ids=WORDS)
def test_a_shift_of_an_element_that_only_the_run_tells_keeps_its_numbers(move):
    lines = ["FOR I=1 TO 2", move.replace("[I]", "[1]"), "ENDFOR"]
    assert not pin_of_shift(read(*lines))
    lines = ["FOR I=1 TO K", move, "ENDFOR"]
    found = read(*lines, "K=2")
    assert all(reasons(found)) and not len(found.visits.literals)


def test_a_shift_in_a_routine_keeps_its_numbers_where_one_call_is_not_followed():
    """One of its points is known in the first round of a loop alone."""
    move = f"LIN XS[I]:{BY}"
    known = read("FOR I=1 TO 2", move, "ENDFOR", "FOR I=1 TO 3", "LIN XS[I]", "ENDFOR")
    assert not pin_of_shift(known)
    lost = read("FOR I=2 TO 3", move, "ENDFOR", last=POINTS["without a value"])
    assert "shifts a point, too" in pin_of_shift(lost)
