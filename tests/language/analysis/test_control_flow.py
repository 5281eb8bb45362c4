"""Blocks of routines: what closes what, where ways lead, and what fits nowhere."""

from __future__ import annotations

import pytest

from postproc.language import ir
from postproc.language.analysis.control_flow import (
    EXIT,
    ControlFlow,
    FlowReader,
)
from postproc.language.language import Start
from postproc.language.rapid.language import Rapid
from postproc.language.text.source import Source
from postproc.language.visits import START
from tests.golden.rapid_cases import go, module
from tests.language.krl.test_visits import job, origins

WORDS = {
    "if": ir.Branch("if"), "else": ir.BlockWord("else"), "endif": ir.BlockWord("endif"),
    "while": ir.Branch("while"), "endwhile": ir.BlockWord("endwhile"),
    "test": ir.Branch("test"), "case": ir.Branch("case"),
    "endtest": ir.BlockWord("endtest"), "for": ir.ForLoop("i", None, None),
    "endfor": ir.BlockWord("endfor"), "exit": ir.Leave(EXIT),
    "label": ir.LabelMark("here"), "goto": ir.JumpTo("here"), ".": ir.SourceStatement(),
}  # fmt: skip


def flow(words: str) -> ControlFlow:
    reader, said = FlowReader(), [WORDS[word] for word in words.split()]
    for row, one in enumerate(said, start=1):
        reader.take(row, one)
    return reader.flow(1, len(said) + 1)


def test_blocks_within_blocks_close_in_their_order() -> None:
    found = flow("while if . else . endif endwhile .")
    assert found.end == {1: 7, 2: 6, 4: 6} and found.head == {6: 2, 7: 1}
    assert found.divisions == {1: (), 2: (4,)}
    assert found.divisions_behind(2) == (4,) and found.divisions_behind(4) == ()
    assert found.behind(1) == 8 and not found.problems


def test_ways_meet_at_labels_heads_ends_and_behind_loops() -> None:
    found = flow("label for . endfor . goto")
    assert {1, 2, 4, 5} <= found.joins and 3 not in found.joins
    assert found.loops == {2: 4} and found.labels == {"here": 1}


def test_a_word_leaves_the_innermost_loop() -> None:
    found = flow("for while if exit endif endwhile exit endfor exit")
    assert found.exits == {4: 2, 7: 1}


@pytest.mark.parametrize(
    ("words", "lost"),
    [
        ("while . endif endwhile", {3}),
        ("else", {1}),
        ("case if", {1, 2}),
        ("goto", {1}),
        ("if while endif", {1, 2, 3}),
        ("if else endif test case case endtest label goto", set()),
    ],
)
def test_what_fits_nowhere_is_told_and_closes_nothing(words: str, lost: set[int]):
    found = flow(words)
    assert lost == {row for row, _ in (*found.problems, *found.nowhere)}
    if words.startswith("while"):
        assert found.end == {1: 4}


def rapid(*lines: str) -> list[list[int]]:
    found = Rapid().read([Source("job.mod", module(*lines))], Start()).visits
    return [found.graph.predecessors(k).tolist() for k in range(len(found))]


def test_what_stands_behind_an_endless_loop_leads_nowhere():
    """Its first move comes from before, or from its end: nothing else begins it."""
    endless = ("WHILE TRUE DO", go("p1"), go("p2"), "ENDWHILE", go("p3"))
    assert rapid(*endless)[1:] == [[0, 2], [1]]
    assert len(rapid("WHILE di1=1 DO", *endless[1:])) == 4
    assert len(rapid("IF FALSE THEN", go("p1"), "ENDIF", go("p2"))) == 3
    found = job("LIN XP1", "WHILE TRUE", "LIN XP2", "ENDWHILE", "LIN XP1")
    assert origins(found)[1] == [0, 1] and len(found.visits) == 2


def test_who_leaves_a_loop_at_the_end_of_a_branch_does_not_enter_the_next() -> None:
    loop = ["LOOP", "LIN XP2", "IF $IN[1] THEN", "EXIT", "ENDIF", "ENDLOOP"]
    found = job(
        "LIN XP1", "IF $IN[2] THEN", *loop, "ELSE", "LIN XP2", "ENDIF", "LIN XP1"
    )
    assert origins(found) == [[START], [0, 1], [0], [1, 2]]
