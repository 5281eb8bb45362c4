"""Loops whose bounds no loop reaches neither crash nor hang."""

from __future__ import annotations

import pytest

from postproc.language.language import Start
from postproc.language.rapid.language import Rapid
from postproc.language.text.source import Source
from tests.golden.rapid_cases import go, module
from tests.language.krl.test_visits import job, reasons

BOUNDS = [("1", "1E999", ""), ("1E999", "1E999", ""), ("1", "5", "1E999"),
          ("1", "1E300", "1E-9"), ("-1E308", "1E308", ""),
          ("1", "1E9", "")]  # fmt: skip


def krl(first, last, step, *body):
    end = f" STEP {step}" if step else ""
    return job(f"FOR I={first} TO {last}{end}", *body, "ENDFOR", "LIN XS[I]")


def rapid(first, last, step, *body):
    end = f" STEP {step}" if step else ""
    lines = [f"FOR i FROM {first} TO {last}{end} DO", *body, "ENDFOR", go("p2")]
    return Rapid().read([Source("job.mod", module(*lines))], Start())


@pytest.mark.parametrize(("first", "last", "step"), BOUNDS)
def test_a_huge_bound_is_not_followed_round_by_round(first, last, step):
    found = krl(first, last, step, "LIN XP1")
    assert len(found.visits) == 2 and reasons(found)[1]
    visits = rapid(first, last, step, go("p1")).visits
    assert len(visits) <= 3 and visits.target.names[visits.target.name[-1]] == "p2"


def test_rounds_within_rounds_are_counted_together():
    inner = ["FOR N2=1 TO 10000", "LIN XS[N2]", "ENDFOR"]
    found = krl("1", "20", "", *inner)
    assert len(found.visits) == 21 and all(reasons(found)[:20])
    called = "DEF rows( )\nINT K\nFOR K=1 TO 10000\nLIN XS[K]\nENDFOR\nEND\n"
    found = job("FOR I=1 TO 20", "rows( )", "ENDFOR", more=called)
    assert len(found.visits) == 20 and all(reasons(found))
    few = ["FOR N2=1 TO 3", "LIN XS[N2]", "ENDFOR"]
    assert reasons(krl("1", "3", "", *few))[:9] == [""] * 9


def test_numbers_that_overflow_are_not_known():
    far = go("[[1E999,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]")
    for line in (far, go("Offs(p1,1E300*1E300,0,0)"), go("many{1E999}")):
        text = module(line, go("p2"), declared="VAR num a{2}:=[1,2];")
        visits = Rapid().read([Source("job.mod", text)], Start()).visits
        assert visits.reasons[visits.reason[1]].text and not visits.reason[2]
    found = job("LIN {X 1E999,Y 0,Z 0,A 0,B 0,C 0}", "LIN XS[1E999]", "LIN XP1")
    assert [bool(why) for why in reasons(found)] == [True, True, False]
