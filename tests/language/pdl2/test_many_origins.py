"""Moves that may come from very many places: no origin is lost, work stays linear."""

import pytest

from postproc.language.analysis.interpreter import Interpreter
from postproc.language.pdl2.abstract_state import MOST_ORIGINS
from postproc.language.pdl2.interpreter import Resolved, resolve
from postproc.language.pdl2.program import parse
from postproc.language.text.source import source_from_bytes
from postproc.language.visits import ELSEWHERE, START

MAYBE = "IF $DIN[1] THEN\nMOVE LINEAR TO POS({0},2,3,4,5,6,'')\nENDIF\n"


def body(text: str) -> Resolved:
    return resolve(
        parse(source_from_bytes("a", f"PROGRAM a\nBEGIN\n{text}END a".encode()))
    )


def looped(rounds: int) -> str:
    return f"FOR i := 1 TO {rounds} DO\n{MAYBE.format(1)}ENDFOR\n"


def written(count: int) -> str:
    return "".join(MAYBE.format(n) for n in range(count))


@pytest.mark.parametrize("text", [looped(4900), written(1500)])
def test_origins_are_told_apart_up_to_a_number_of_them(text: str) -> None:
    visits = body(text).visits
    for n in range(len(visits)):
        found = visits.graph.predecessors(n).tolist()
        every = [START, *range(n)]
        assert found == (every if len(every) <= MOST_ORIGINS else [ELSEWHERE])
    assert len(visits.graph.pred) < MOST_ORIGINS**2 / 2 + MOST_ORIGINS + len(visits)


def test_it_is_said_where_the_side_is_lost() -> None:
    found = body(written(MOST_ORIGINS + 1))
    assert [(d.line, d.code) for d in found.diagnostics] == [
        (3 + 3 * MOST_ORIGINS + 1, "many-origins")
    ]
    assert body(written(MOST_ORIGINS)).diagnostics == ()


def test_a_move_that_is_always_run_tells_the_side_again() -> None:
    end = "MOVE LINEAR TO POS(7,2,3,4,5,6,'')\n"
    visits = body(written(600) + end + end).visits
    assert visits.graph.predecessors(600).tolist() == [ELSEWHERE]
    assert visits.graph.predecessors(601).tolist() == [600]


@pytest.mark.parametrize("count", [300, 700])
def test_a_cycle_of_them_settles(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    taken = []
    run = Interpreter._run
    monkeypatch.setattr(
        Interpreter, "_run", lambda *args: taken.append(0) or run(*args)
    )
    visits = body(f"REPEAT\n{written(count)}UNTIL $DIN[2]\n").visits
    assert len(taken) < 10 * count  # a row is run anew a few times, not once an origin
    every = [START, *range(count)]
    wanted = every if len(every) <= MOST_ORIGINS else [ELSEWHERE]
    assert all(visits.graph.predecessors(n).tolist() == wanted for n in range(count))
