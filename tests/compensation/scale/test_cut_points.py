"""Windows of programs are cut where no jump, number, arc or step crosses."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from postproc.compensation.scale import windowing as cuts
from postproc.compensation.scale.windowing import (
    Window,
    cut_points,
    seams,
    window,
    windows,
)
from postproc.language.language import Start
from postproc.language.pdl2.interpreter import resolve
from postproc.language.pdl2.program import parse
from postproc.language.text.source import source_from_bytes
from postproc.language.visits import Visits
from tests.bench.made import drilling, milling
from tests.language.pdl2.reachable import reachable

HEAD = "PROGRAM job\nVAR p, q : POSITION\nROUTINE there\nBEGIN\n"
HEAD += "  MOVE LINEAR TO POS(900, 0, 900, 0, 180, 0, '')\nEND there\nBEGIN\n"


def read(text: str) -> Visits:
    program = parse(source_from_bytes("job.pdl", text.encode("latin-1")))
    return resolve(program, Start(motionless=("drill_*", "tool_change"))).visits


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


def test_inside_runs_arcs_are_kept_whole() -> None:
    fly = stop(1010).replace("MOVE ", "MOVEFLY ").replace("\n", " ADVANCE\n")
    arc = "  MOVEFLY CIRCULAR TO POS(1040, 0, 900, 0, 180, 0, '') "
    arc += "VIA POS(1030, 10, 900, 0, 180, 0, '') ADVANCE\n"
    visits = read(HEAD + stop(1000) + fly + fly + arc + fly + "END job\n")
    assert seams(visits).tolist() == [True, True, False, False, True, False]


@pytest.mark.parametrize("seed", range(60))
def test_nothing_crosses(seed: int) -> None:
    visits = read(reachable(seed, exact=seed % 2 == 0, pages=False).text)
    assert not (cut_points(visits) & (~seams(visits) | visits.motion.fly)).any()
    found = np.flatnonzero(seams(visits)).tolist()
    to = np.repeat(np.arange(len(visits)), np.diff(visits.graph.pred_start))
    literals = visits.target.literal, visits.target.follows
    for c in found:
        assert not visits.motion.via[c]
        assert visits.graph.predecessors(c + 1).tolist() == [c]
        known = visits.graph.pred >= 0
        across = known & ((visits.graph.pred <= c) != (to <= c))
        assert across.sum() == 1
        left = {k for column in literals for k in column[: c + 1].tolist()}
        right = {k for column in literals for k in column[c + 1 :].tolist()}
        assert left & right <= {-1}


@pytest.fixture
def small(monkeypatch) -> None:
    """Let halos be short."""
    monkeypatch.setattr(cuts, "HALO", 20)


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("make", [drilling, milling])
def test_windows_are_the_program(make) -> None:
    visits = read(make(300).source.decode())
    quiet = seams(visits)
    cut = windows(quiet, 40)
    assert len(cut) == 300 // 40
    assert cut[0].first == cut[0].begin == 0
    assert cut[-1].end == cut[-1].stop == len(visits)
    for before, after in pairwise(cut):
        assert before.end == after.first
        assert before.begin < after.begin < after.first - 20
        assert before.end + 20 <= before.stop
    assert min(w.end - w.first for w in cut) >= 40
    for some in cut:
        assert some.begin == 0 or quiet[some.begin]
        assert some.stop == len(visits) or quiet[some.stop - 1]
        same_columns(some, visits)


def same_columns(some: Window, visits: Visits) -> None:
    """Compare a window with its program."""
    part = some.of(visits)
    assert len(part) == some.stop - some.begin
    for name, column in part.columns.items():
        if name != "block":
            rows = slice(some.begin + some.seeds, some.stop)
            np.testing.assert_array_equal(
                column[some.seeds :], visits.columns[name][rows]
            )
    for v in range(some.seeds, len(part)):
        wanted = visits.graph.predecessors(v + some.begin)
        moved = np.where(wanted >= 0, wanted - some.begin, wanted)
        np.testing.assert_array_equal(part.graph.predecessors(v), moved)
    if some.seeds:
        assert part.target.literal[0] == part.target.follows[0] == -1
        assert len(part.graph.predecessors(0)) == 0


def test_a_short_program_is_one_window() -> None:
    visits = read(drilling(79).source.decode())
    (one,) = windows(seams(visits), 41)
    assert one.of(visits) is visits


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("make", [drilling, milling])
def test_a_run_up_comes_from_anywhere(make) -> None:
    visits = read(make(300).source.decode())
    some = window(seams(visits), 250, len(visits), 30)
    assert 30 <= some.first - some.begin - 1 < 40
    found = some.of(visits, known=False)
    np.testing.assert_array_equal(
        found.target.values, visits.target.values[some.begin :]
    )
    assert found.target.literal[0] == -1
    before = [found.graph.predecessors(v).tolist() for v in range(len(found))]
    assert before == [[-1], *([v] for v in range(len(found) - 1))]
    assert window(seams(visits), 30, len(visits), 30).begin == 0
