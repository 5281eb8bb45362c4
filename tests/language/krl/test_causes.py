"""docs/krl.md: every row between two moves, and every word of the language."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from postproc.exceptions import ProgramError
from postproc.language.krl.symbols import FUNCTIONS, STILL
from postproc.language.krl.syntax import NAMES
from postproc.language.visits import ELSEWHERE, ZoneRule
from tests.language.krl.test_visits import job, origins, reasons

PAGE = (Path(__file__).parents[3] / "docs" / "krl.md").read_text("utf-8")
MORE = """DEF moves( )
LIN XP2
END
DEF sets( )
$BASE=BASE_DATA[3]
END
DEF brakes( )
BRAKE
END
DEF resumes( )
BRAKE
RESUME
END
DEF still( )
$OUT[3]=TRUE
END
DEF takes(a:OUT)
FRAME a
a=$NULLFRAME
END
DEFFCT INT asks( )
$BASE=BASE_DATA[3]
RETURN 1
ENDFCT
"""
BEGIN = ["BAS(#INITMOV,0)", "$TOOL=TOOL_DATA[1]", "$BASE=BASE_DATA[2]", "$APO.CDIS=5"]
CANNOT = frozenset(
    """
    and b_and b_exor b_not b_or case const decl def default defdat deffct do else end
    enddat endfct endfor endif endloop endspline endswitch endwhile enum exit exor ext
    extfct for global goto if import loop not or ptp lin circ sptp slin scirc spl spline
    ptp_spline ptp_rel circ_rel sptp_rel slin_rel scirc_rel spl_rel repeat return
    signal struc switch then time_block to until const_vel when while with c_ptp c_ori
    c_vel c_spl anin anout digin channel confirm public sec maximum minimum ca delay
    """.split()
)
"""Words that neither end a move elsewhere nor change settings by themselves."""
WORDS = NAMES["reserved"] | frozenset(
    """
    anin anout asycancel asycont asyptp asystop ca channel confirm delay digin distance
    maximum minimum move_emi on_error_proceed path prio public pulse sec rsi_on
    rsi_movecorr touchsense brake resume halt
    """.split()
)  # of the keyword lists of editors


def rows():
    """Read the rows of the page: lines of a program, and the result."""
    for line in PAGE.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split(" | ")]
        if line.startswith("| `") and len(cells) == 3:
            yield pytest.param(
                re.findall(r"`([^`]+)`", cells[0]), cells[2], id=cells[0]
            )


@pytest.mark.parametrize(("lines", "result"), [*rows()])
def test_a_row_of_the_page(lines, result):
    program = [*BEGIN, "LIN XP1 C_DIS", *lines, "LIN XP2"]
    if result == "refused":
        with pytest.raises(ProgramError):
            job(*program, more=MORE)
        return
    found = job(*program, more=MORE)
    names = [found.visits.target.names[k] for k in found.visits.target.name.tolist()]
    first, last = 0, len(names) - 1 - names[::-1].index("xp2")
    if "moves( )" in lines:
        last = len(names) - 1
    why, fly = reasons(found), found.visits.motion.fly.tolist()
    lost = origins(found)[last] == [ELSEWHERE]
    assert bool(why[last]) == (result in ("not corrected", "lost"))
    assert lost == (result == "lost")
    if result in ("nothing", "stops"):
        assert why[first] == "" and fly[first] == (result == "nothing")
    if result == "may stop":
        rule = found.visits.zone.rule[first]
        assert why[first] == "" and fly[first] and rule == ZoneRule.UNKNOWN


def test_every_word_stands_on_the_page_or_can_do_nothing():
    words = {word.lower() for word in re.findall(r"[A-Za-z_]\w*", PAGE)}
    missing = WORDS - words - CANNOT
    assert not missing, missing
    assert not (CANNOT - WORDS), CANNOT - WORDS


def test_routines_that_are_still_are_no_causes():
    shown = {"pulse", "on_error_proceed", "ir_stopm", "ek", "lk"}
    called = {word.lower() for word in re.findall(r"`(\w+) ?\(", PAGE)}
    assert not called & (STILL | FUNCTIONS) - shown
