"""Windows of programs are cut where nothing but the arm's standing crosses."""

from __future__ import annotations

from dataclasses import fields
from itertools import pairwise

import numpy as np
import pytest

from postproc.compensation import windows as cuts
from postproc.compensation.windows import SHARED, cut_points, lead_in, windows
from postproc.language.pdl2.interpreter import resolve
from postproc.language.pdl2.job import Start
from postproc.language.pdl2.program import parse
from postproc.language.source import source_from_bytes
from postproc.language.visits import Visits
from tests.bench.made import drilling, milling
from tests.language.pdl2.reachable import reachable

HEAD = "PROGRAM job\nVAR p, q : POSITION\nROUTINE there\nBEGIN\n"
HEAD += "  MOVE LINEAR TO POS(900, 0, 900, 0, 180, 0, '')\nEND there\nBEGIN\n"


def read(text: str) -> Visits:
    program = parse(source_from_bytes("job.pdl", text.encode("latin-1")))
    return resolve(program, Start(still=("drill_*", "tool_change"))).visits


def stop(x: float) -> str:
    return f"  MOVE LINEAR TO POS({x}, 0, 900, 0, 180, 0, '')\n"


def quiet(*body: str) -> list[bool]:
    return cut_points(read(HEAD + "".join(body) + "END job\n")).tolist()


def test_every_stop_of_a_straight_program_but_the_last() -> None:
    assert quiet(stop(1000), stop(1010), stop(1020)) == [True, True, False]


def test_fly_points_and_where_arcs_begin_or_pass_are_none() -> None:
    fly = stop(1010).replace("MOVE ", "MOVEFLY ").replace("\n", " ADVANCE\n")
    arc = "  MOVE CIRCULAR TO POS(1040, 0, 900, 0, 180, 0, '') "
    arc += "VIA POS(1030, 10, 900, 0, 180, 0, '')\n"
    body = stop(1000), fly, stop(1020), arc, stop(1050)
    assert quiet(*body) == [True, False, False, False, True, False]


def test_jumps_are_not_cut() -> None:
    loop = "  FOR $INT := 1 TO 3 DO\n" + stop(1010) + stop(1020) + "  ENDFOR\n"
    loop = loop.replace("$INT", "i")
    head = HEAD.replace("VAR ", "VAR i : INTEGER\n    ")
    text = head + stop(1000) + loop + stop(1030) + stop(1040) + "END job\n"
    found = cut_points(read(text))
    assert not found[1:2].any() and found[-2]
    branch = "  IF $DIN[1] THEN\n" + stop(1010) + "  ENDIF\n"
    assert quiet(stop(1000), branch, stop(1020), stop(1030))[:2] == [False, False]


def test_numbers_that_are_used_again_are_not_cut() -> None:
    value = "  p := POS(1000, 0, 900, 0, 180, 0, '')\n"
    move = "  MOVE LINEAR TO p\n"
    found = quiet(value, stop(990), move, stop(1010), move, stop(1020), stop(1030))
    assert found == [True, False, False, True, True, False]
    shift = "  MOVE LINEAR TO POS_SHIFT(p, VEC(0, 0, 50))\n"
    found = quiet(value, move, stop(1010), shift, stop(1020), stop(1030))
    assert found[:2] == [False, False] and found[3]


@pytest.mark.parametrize("seed", range(60))
def test_nothing_crosses(seed: int) -> None:
    visits = read(reachable(seed, exact=seed % 2 == 0, pages=False).text)
    found = np.flatnonzero(cut_points(visits)).tolist()
    to = np.repeat(np.arange(len(visits)), np.diff(visits.pred_start))
    literals = visits.literal, visits.follows
    for c in found:
        assert not visits.fly[c] and not visits.via[c]
        assert visits.predecessors(c + 1).tolist() == [c]
        known = visits.pred >= 0
        across = known & ((visits.pred <= c) != (to <= c))
        assert across.sum() == 1
        left = {k for column in literals for k in column[: c + 1].tolist()}
        right = {k for column in literals for k in column[c + 1 :].tolist()}
        assert left & right <= {-1}


def test_windows_are_the_program() -> None:
    visits = read(drilling(300).source.decode())
    cut = windows(visits, 40)
    assert len(cut) == 300 // 40
    assert cut[0].first == 0 and cut[-1].end == len(visits)
    for before, after in pairwise(cut):
        assert before.end == after.first
    assert min(w.end - w.first for w in cut) >= 40
    for window in cut:
        part = window.of(visits)
        assert len(part) == window.end - window.first + window.seeds
        for f in fields(Visits):
            column, whole = getattr(part, f.name), getattr(visits, f.name)
            if f.name not in SHARED:
                rows = slice(window.first, window.end)
                np.testing.assert_array_equal(column[window.seeds :], whole[rows])
        for v in range(window.seeds, len(part)):
            wanted = visits.predecessors(v + window.first - window.seeds)
            moved = np.where(wanted >= 0, wanted - window.first + window.seeds, wanted)
            np.testing.assert_array_equal(part.predecessors(v), moved)
        if window.seeds:
            assert part.literal[0] == part.follows[0] == -1
            assert len(part.predecessors(0)) == 0


def test_a_short_program_is_one_window() -> None:
    visits = read(drilling(79).source.decode())
    (window,) = windows(visits, 41)
    assert window.of(visits) is visits


@pytest.mark.parametrize("make", [drilling, milling])
def test_a_run_up_is_the_last_targets_from_anywhere(monkeypatch, make) -> None:
    monkeypatch.setattr(cuts, "RUN_UP", 30)
    visits = read(make(300).source.decode())
    window = cuts.Window(250, len(visits))
    found = lead_in(visits, window)
    assert found is not None and 30 <= len(found) < 40
    first = window.first - len(found)
    np.testing.assert_array_equal(found.values, visits.values[first : window.first])
    np.testing.assert_array_equal(found.literal[1:], visits.literal[first + 1 : 250])
    assert found.literal[0] == -1
    before = [found.predecessors(v).tolist() for v in range(len(found))]
    assert before == [[-1], *([v] for v in range(len(found) - 1))]
    assert lead_in(visits, cuts.Window(30, 300)) is None
    assert lead_in(visits, cuts.Window(32, 300)) is not None


def test_no_run_up_begins_where_something_crosses(monkeypatch) -> None:
    monkeypatch.setattr(cuts, "RUN_UP", 2)
    loop = "  FOR i := 1 TO 3 DO\n" + stop(1010) * 8 + "  ENDFOR\n"
    head = HEAD.replace("VAR ", "VAR i : INTEGER\n    ")
    visits = read(head + stop(990) + stop(1000) + loop + stop(1030) + "END job\n")
    found = lead_in(visits, cuts.Window(8, len(visits)))
    assert found is not None and len(found) == 7  # the loop uses its numbers again
