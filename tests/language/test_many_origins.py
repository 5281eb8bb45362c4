"""Moves that may come from very many places: no origin is lost, work stays linear."""

import pytest

from postproc.compensation.program import ParsedProgram, read_program
from postproc.compensation.solver.targets import find_open_corners
from postproc.language.analysis.interpreter import Interpreter
from postproc.language.analysis.origins import MOST_ORIGINS
from postproc.language.visits import ELSEWHERE, START

POINT = "[[{},0,900],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
STOP = {
    "pdl": "MOVE LINEAR TO POS({},2,3,4,5,6,'')\n",
    "mod": f"MoveL {POINT},v200,fine,tool0;\n",
    "src": "LIN {{X {},Y 2,Z 3,A 4,B 5,C 6}}\n",
}
FLY = {
    "pdl": "MOVEFLY LINEAR TO POS({},2,3,4,5,6,'') ADVANCE\n",
    "mod": f"MoveL {POINT},v200,z50,tool0;\n",
    "src": "LIN {{X {},Y 2,Z 3,A 4,B 5,C 6}} C_DIS\n",
}
MAYBE = {
    "pdl": "IF $DIN[1] THEN\n{}ENDIF\n",
    "mod": "IF DI1=1 THEN\n{}ENDIF\n",
    "src": "IF $IN[1] THEN\n{}ENDIF\n",
}
LOOP = {
    "pdl": "FOR i := 1 TO {} DO\n{}ENDFOR\n",
    "mod": "FOR i FROM 1 TO {} DO\n{}ENDFOR\n",
    "src": "FOR i = 1 TO {}\n{}ENDFOR\n",
}
AGAIN = {
    "pdl": "REPEAT\n{}UNTIL $DIN[2]\n",
    "mod": "WHILE DI2=1 DO\n{}ENDWHILE\n",
    "src": "REPEAT\n{}UNTIL $IN[2]\n",
}
JOB = {
    "pdl": "PROGRAM job\nBEGIN\n$FLY_TYPE := FLY_CART\n{}END job\n",
    "mod": "MODULE job\nPROC main()\n\n{}EXIT;\nENDPROC\nENDMODULE\n",
    "src": "DEF job( )\n$BASE=$NULLFRAME\n$APO.CDIS=30\n{}END\n",
}
languages = pytest.mark.parametrize("kind", JOB)


@pytest.fixture
def body(kind: str, bench_cell):
    """Read a program of some statements."""

    def read(text: str) -> ParsedProgram:
        job = JOB[kind].format(text)
        return read_program({f"job.{kind}": job.encode()}, bench_cell)

    return read


def looped(kind: str, rounds: int) -> str:
    return LOOP[kind].format(rounds, MAYBE[kind].format(STOP[kind].format(1)))


def written(kind: str, count: int, move=STOP) -> str:
    moves = (move[kind].format(n) for n in range(count))
    return "".join(map(MAYBE[kind].format, moves))


@languages
@pytest.mark.parametrize(
    "write", [lambda k: looped(k, 4900), lambda k: written(k, 1500)]
)
def test_origins_are_told_apart_up_to_a_number_of_them(write, kind: str, body) -> None:
    visits = body(write(kind)).visits
    for n in range(len(visits)):
        found = visits.graph.predecessors(n).tolist()
        every = [START, *range(n)]
        assert found == (every if len(every) <= MOST_ORIGINS else [ELSEWHERE])
    assert len(visits.graph.pred) < MOST_ORIGINS**2 / 2 + MOST_ORIGINS + len(visits)


@languages
def test_it_is_said_where_the_side_is_lost(kind: str, body) -> None:
    found = body(written(kind, MOST_ORIGINS + 1))
    told = [d.line for d in found.diagnostics if d.code == "many-origins"]
    assert told == [5 + 3 * MOST_ORIGINS]
    found = body(written(kind, MOST_ORIGINS))
    assert "many-origins" not in {d.code for d in found.diagnostics}


@languages
def test_a_move_that_is_always_run_tells_the_side_again(kind: str, body) -> None:
    end = STOP[kind].format(7)
    visits = body(written(kind, 600) + end + end).visits
    assert visits.graph.predecessors(600).tolist() == [ELSEWHERE]
    assert visits.graph.predecessors(601).tolist() == [600]


@languages
def test_a_corner_is_open_where_the_next_move_is_not_told_apart(kind, body) -> None:
    visits = body(written(kind, 600, FLY) + STOP[kind].format(7)).visits
    assert find_open_corners(visits).tolist() == [True] * 600 + [False]


@languages
@pytest.mark.parametrize("count", [300, 700])
def test_a_cycle_of_them_settles(
    count: int, kind: str, body, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken = []
    run = Interpreter._run
    monkeypatch.setattr(
        Interpreter, "_run", lambda *args: taken.append(0) or run(*args)
    )
    visits = body(AGAIN[kind].format(written(kind, count))).visits
    assert len(taken) < 10 * count  # a row is run anew a few times, not once an origin
    every = [START, *range(count)]
    wanted = every if len(every) <= MOST_ORIGINS else [ELSEWHERE]
    assert all(visits.graph.predecessors(n).tolist() == wanted for n in range(count))


def test_an_interrupt_may_come_in_any_move_that_is_not_told_apart(bench_cell) -> None:
    """The program is ahead of the arm where it switches the interrupt on."""
    moves = (f"IF n==1 THEN\n{FLY['src'].format(n)}ENDIF\n" for n in range(600))
    on = "INTERRUPT DECL 3 WHEN $IN[3]==TRUE DO other( )\nINTERRUPT ON 3\n"
    job = JOB["src"].format("".join(moves) + on + STOP["src"].format(7))
    job += "DEF other( )\nPTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}\nEND\n"
    visits = read_program({"job.src": job.encode()}, bench_cell).visits
    codes = {visits.reasons[k].code for k in visits.reason[:601].tolist()}
    assert codes == {"beside-program"}
