"""Variables that another program may write."""

from __future__ import annotations

import pytest

from postproc.language.language import JobReading, Start
from postproc.language.pdl2.interpreter import resolve
from postproc.language.pdl2.program import parse
from postproc.language.pdl2.variable_file import read_variables
from postproc.language.text.source import Source, source_from_bytes
from postproc.language.visits import Meaning
from tests.language.pdl2.test_opaque_calls import handler, program, routine

P = "POS({}, 2, 3, 0, 180, 0, '')"
TAB = ["tab : ARRAY[2] OF POSITION", "i, n : INTEGER EXPORTED FROM job",
       "x : BOOLEAN (FALSE) EXPORTED FROM job"]  # fmt: skip
FILL = [f"tab[1] := {P.format(1)}", f"tab[2] := {P.format(2)}"]
VALUES = """g POS Arm: 1 Xport
 X: 1.00  Y: 2.00  Z: 3.00  A: 0.00  E: 180.00  R: 0.00
 CNFG: ''
"""


def followed(
    *body: str, head: list[str], values: str = "", **said: object
) -> JobReading:
    text = program("job", head, list(body))
    files = [source_from_bytes("job.lsv", values.encode())] if values else []
    start = Start(**said)  # type: ignore[arg-type]
    found = parse(Source("job.pdl", text.encode()))
    return resolve(found, start, *map(read_variables, files))


def places(found: JobReading) -> list[float]:
    """Return x of every target that is known, 0 of others."""
    v = found.visits
    known = (v.target.meaning == Meaning.POSE) & (v.target.literal >= 0)
    return [
        x if k else 0
        for x, k in zip(v.target.values[:, 0].tolist(), known, strict=True)
    ]


def indexed(*between: str, **said: object) -> list[float]:
    body = [*FILL, "i := 1", *between, "MOVE LINEAR TO tab[i]"]
    return places(followed(*body, head=["VAR " + TAB[0], *TAB[1:]], **said))


@pytest.mark.parametrize(
    "waiting",
    ["DELAY 10", "WAIT FOR $DIN[1]", "PAUSE", "READ lun (n)", "spot(1)", "CYCLE",
     "GOTO on\non::", "WHILE FALSE DO\nENDWHILE", "SIGNAL s", "PULSE $DOUT[1] FOR 3",
     "\n".join(handler("s := 1"))],
)  # fmt: skip
def test_an_exported_index_is_not_known_once_others_may_run(waiting: str) -> None:
    assert indexed(waiting) == [0]
    assert indexed(waiting, constant=("job.i",)) == [1]


def test_an_exported_index_is_known_until_then() -> None:
    assert indexed() == [1]
    assert indexed("n := 2", "i := n") == [2]


def test_the_first_value_of_an_exported_index_is_not_known() -> None:
    head = ["VAR " + TAB[0], "i : INTEGER (1) EXPORTED FROM job"]
    body = [*FILL, "MOVE LINEAR TO tab[i]"]
    found = followed(*body, head=head)
    assert places(found) == [0]
    assert places(followed(*body, head=head, constant=("i",))) == [1]
    values = "i INT Xport\n 1\n"
    alone = ["VAR " + TAB[0], "i : INTEGER"]
    assert places(followed(*body, head=alone, values=values)) == [0]
    assert places(followed(*body, head=alone, values="i INT Priv\n 1\n")) == [1]


def test_an_exported_index_by_another_name_is_forgotten_too() -> None:
    inner = routine("r", "a := 1", "DELAY 10", takes="(a : INTEGER)")
    head = ["VAR " + TAB[0], *TAB[1:], *inner]
    found = followed(*FILL, "r(i)", "MOVE LINEAR TO tab[i]", head=head)
    assert places(found) == [0]


@pytest.mark.parametrize(
    "loop",
    ["REPEAT\nDELAY 10\nUNTIL x", "REPEAT\nUNTIL x", "WHILE NOT x DO\nENDWHILE",
     "again::\nIF NOT x THEN\nGOTO again\nENDIF"],
)  # fmt: skip
@pytest.mark.parametrize("before", ["", "x := FALSE"])
def test_what_stands_behind_a_loop_that_waits_for_others_is_reached(
    loop: str, before: str
) -> None:
    body = [*filter(None, [before]), loop, f"MOVE LINEAR TO {P.format(7)}"]
    assert places(followed(*body, head=["VAR " + TAB[0], *TAB[1:]])) == [7]


IMPORTED = ["VAR g : POSITION EXPORTED FROM other"]
TO_G = "MOVE LINEAR TO g"


def test_an_imported_position_is_known_only_if_the_cell_says_so() -> None:
    found = followed(TO_G, head=IMPORTED, values=VALUES)
    assert places(found) == [0]
    (why,) = (found.visits.reasons[k].text for k in found.visits.reason)
    assert "[variables] constant" in why
    for pattern in ("g", "other.g", "other.*"):
        said = followed(TO_G, head=IMPORTED, values=VALUES, constant=(pattern,))
        assert places(said) == [1]


def test_an_imported_position_that_is_written_at_hand_is_not_constant() -> None:
    body = [TO_G, f"g := {P.format(5)}", TO_G]
    found = followed(*body, head=IMPORTED, values=VALUES, constant=("g",))
    assert places(found) == [0, 5]


def test_a_frame_that_is_imported_is_not_known() -> None:
    move = f"MOVE LINEAR TO {P.format(3)}"
    found = followed("$UFRAME := g", move, head=IMPORTED, values=VALUES)
    assert "$UFRAME is not known" in found.visits.reasons[found.visits.reason[0]].text


def test_a_position_of_our_own_that_is_exported_keeps_its_value() -> None:
    found = followed(TO_G, head=["VAR g : POSITION EXPORTED FROM job"], values=VALUES)
    assert places(found) == [1] and found.visits.literals.shared.tolist() == [True]
