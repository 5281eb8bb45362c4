"""What runs beside the program: interrupts, triggers; and what packages hold."""

from __future__ import annotations

import pytest

from postproc.diagnostics import Code
from postproc.language.krl.symbols import package_routines
from postproc.language.language import Start
from postproc.language.visits import ELSEWHERE, START
from tests.language.krl.test_visits import codes, job, names, origins, reasons

SEARCH = "INTERRUPT DECL 10 WHEN $IN[1]==TRUE DO found_it( )"
FRAMES = ["FDAT_ACT=FP1", "LDAT_ACT=LCPDAT1", "BAS(#CP_PARAMS,2)"]
MOVES = "DEF found_it( )\nLIN XP2\nEND\n"
SETS = "DEF found_it( )\n$BASE=BASE_DATA[3]\nEND\n"
BRAKES = "DEF found_it( )\nBRAKE\n$OUT[1]=TRUE\nEND\n"
RESUMES = "DEF found_it( )\nBRAKE\nRESUME\nEND\n"
STILL = "DEF found_it( )\n$OUT[1]=TRUE\nN2=3\nEND\n"
AGAIN = "DEF found_it( )\nother( )\nEND\nDEF other( )\nfound_it( )\nBRAKE\nEND\n"


def left(found):
    return ["interrupt" in why or "RESUME" in why for why in reasons(found)]


@pytest.mark.parametrize("more", [MOVES, SETS, BRAKES, AGAIN])
def test_an_interrupt_leaves_what_it_may_interrupt(more):
    lines = ["LIN XP1", SEARCH, "LIN XP1", "WAIT SEC 0", "INTERRUPT ON 10", "LIN XP1",
             "LIN XP1", "INTERRUPT OFF 10", *FRAMES, "LIN XP1", "LIN XP1"]  # fmt: skip
    found = job(*lines, more=more)
    assert left(found) == [False, False, True, True, False, False]
    assert origins(found)[4] == [ELSEWHERE] and reasons(found)[5] == ""


def test_behind_an_interrupt_that_may_set_frames_they_are_not_known():
    lines = [SEARCH, "INTERRUPT ON 10", "LIN XP1", "INTERRUPT OFF 10", "LIN XP1"]
    assert "$TOOL and $BASE are not known" in reasons(job(*lines, more=SETS))[1]


def test_resume_leaves_everything_from_the_declaration_on():
    lines = ["LIN XP1", "WAIT SEC 0", SEARCH, "INTERRUPT ON 10", "LIN XP1",
             "INTERRUPT OFF 10", *FRAMES, "LIN XP1"]  # fmt: skip
    assert left(job(*lines, more=RESUMES)) == [False, True, True]


FOUND = "DEF found_it( )\nINTERRUPT OFF 10\nBRAKE F\nRESUME\nEND\n"
SEEK = "DEF seek( )\nINTERRUPT ON 10\nLIN XP2\nWAIT SEC 0\nINTERRUPT OFF 10\nEND\n"
SEARCHES = [SEARCH, *FRAMES, "LIN XP1", "WAIT SEC 0", "seek( )", "LIN XP1", *FRAMES,
            "LIN XP1"]  # fmt: skip


def test_resume_ends_the_routine_in_which_it_may_come():
    found = job(*SEARCHES, more=SEEK + FOUND)
    assert left(found) == [False, True, False, False]
    assert (
        "$TOOL and $BASE are not known" in reasons(found)[2] and reasons(found)[3] == ""
    )
    assert origins(found)[2] == [ELSEWHERE]


def test_routines_between_are_ended_too():
    more = SEEK + FOUND + "DEF around( )\nseek( )\nPTP XA\nEND\n"
    found = job(*[x.replace("seek", "around") for x in SEARCHES], more=more)
    assert names(found) == ["xp1", "xp2", "xa", "xp1", "xp1"]
    assert origins(found)[3] == [ELSEWHERE, 2]
    assert (
        "$TOOL and $BASE are not known" in reasons(found)[3] and reasons(found)[4] == ""
    )


def test_other_routines_end_where_they_say():
    lines = [*SEARCHES, "plain( )", "LIN XP1"]
    found = job(*lines, more=SEEK + FOUND + "DEF plain( )\nPTP XA\nEND\n")
    assert names(found)[-2:] == ["xa", "xp1"]
    assert origins(found)[-1] == [4] and reasons(found)[-1] == ""


KEPT_ON = {
    "not switched off": RESUMES,
    "another is": FOUND.replace("OFF 10", "OFF 11"),
    "on one way alone": FOUND.replace(
        "INTERRUPT OFF 10", "IF $IN[3] THEN\nINTERRUPT OFF 10\nENDIF"),
    "of a number that is not known": FOUND.replace("OFF 10", "OFF N2"),
}  # fmt: skip


@pytest.mark.parametrize("action", KEPT_ON.values(), ids=KEPT_ON)
def test_an_interrupt_that_stays_on_leaves_what_comes_behind(action):
    found = job(*SEARCHES, "N2=1", more=SEEK + action)
    assert left(found) == [False, True, True, True]


EVERYTHING = {
    "switched on where it is declared": ["INTERRUPT ON 10", "INTERRUPT OFF 10"],
    "all are": ["INTERRUPT ON", "INTERRUPT OFF"],
    "of a number that is not known": ["INTERRUPT ON N2", "N2=3"],
}


@pytest.mark.parametrize("lines", EVERYTHING.values(), ids=EVERYTHING)
def test_resume_leaves_everything_where_it_may_end_the_program_itself(lines):
    assert all(left(job(*SEARCHES, *lines, more=SEEK + FOUND)))


def test_resume_of_a_routine_that_moves_leaves_everything():
    found = job(*SEARCHES, more=SEEK + FOUND.replace("BRAKE F", "LIN XP2"))
    assert all(left(found))


def test_a_resume_may_come_in_moves_before_the_routine_that_awaits_it():
    lines = [x for x in SEARCHES if x != "WAIT SEC 0"]
    assert left(job(*lines, more=SEEK + FOUND)) == [True, True, False, False]


def test_an_interrupt_that_does_no_harm_leaves_nothing():
    lines = [SEARCH, "INTERRUPT ON 10", "LIN XP1", "INTERRUPT OFF 10", "LIN XP1"]
    assert reasons(job(*lines, more=STILL)) == ["", ""]


def test_an_interrupt_that_nothing_switches_on_may_be_on_from_its_declaration():
    assert left(job("LIN XP1", "WAIT SEC 0", SEARCH, "LIN XP1", more=MOVES)) == [
        False,
        True,
    ]


@pytest.mark.parametrize("off", ["INTERRUPT OFF 11", "INTERRUPT OFF N2",
                                 "INTERRUPT DISABLE 10"])  # fmt: skip
def test_what_does_not_switch_it_off_for_sure_leaves_on(off):
    lines = [SEARCH, "INTERRUPT ON 10", "LIN XP1", off, "N2=1", *FRAMES, "LIN XP1"]
    assert left(job(*lines, more=MOVES)) == [True, True]


@pytest.mark.parametrize("on", ["INTERRUPT ON", "INTERRUPT ON N2"])
def test_all_interrupts_are_switched_on_and_off(on):
    lines = [SEARCH, "LIN XP1", "WAIT SEC 0", on, "LIN XP1", "INTERRUPT OFF", *FRAMES,
             "LIN XP1"]  # fmt: skip
    assert left(job(*lines, more=MOVES)) == [False, True, False]


def test_an_interrupt_may_be_on_where_ways_meet():
    lines = [SEARCH, "IF $IN[2] THEN", "INTERRUPT ON 10", "ENDIF", "LIN XP1"]
    assert left(job(*lines, more=MOVES)) == [True]


def test_an_interrupt_of_a_routine_that_is_not_followed_leaves_everything():
    hidden = f"DEF never( )\n{SEARCH}\nEND\n{MOVES}"
    assert left(job("LIN XP1", more=hidden)) == [True]
    switched = f"DEFFCT BOOL on_now( )\nINTERRUPT ON 10\nRETURN TRUE\nENDFCT\n{MOVES}"
    lines = [SEARCH, "INTERRUPT ON 10", "INTERRUPT OFF 10", "N2=on_now( )", *FRAMES,
             "LIN XP1"]  # fmt: skip
    assert left(job(*lines, more=switched)) == [True]


@pytest.mark.parametrize(
    "line",
    ["TRIGGER WHEN DISTANCE=0 DELAY=0 DO found_it( ) PRIO=-1",
     "TRIGGER WHEN PATH=-20 ONSTART DELAY=5 DO $BASE=BASE_DATA[3]",
     "TRIGGER WHEN DISTANCE=1 DELAY=0 DO BASE_CORR_ON=TRUE",
     "TRIGGER WHEN DISTANCE=1 DELAY=0 DO unknown_it( )",
     "TRIGGER WHEN DISTANCE=1 DELAY=0 DO takes($BASE)"],
)  # fmt: skip
def test_a_trigger_that_sets_what_moves_need_leaves_what_comes_behind(line):
    """The program is ahead: setting it again may be read before the trigger comes."""
    more = SETS + "DEF takes(a:OUT)\nFRAME a\na=$NULLFRAME\nEND\n"
    found = job(*FRAMES, "LIN XP1", line, "LIN XP1", *FRAMES, "LIN XP1", more=more)
    assert left(found) == [False, True, True]


@pytest.mark.parametrize("what", ["unknown_it( )", "2*unknown_it( )"])
def test_a_function_in_a_trigger_may_do_anything(what):
    line = f"TRIGGER WHEN DISTANCE=0 DELAY={what} DO $OUT[1]=TRUE"
    found = job(line, "LIN XP1")
    assert reasons(found)[0] and "motion-unknown" in codes(found)


def test_a_point_that_a_trigger_changes_is_left():
    line = "TRIGGER WHEN DISTANCE=0 DELAY=0 DO XP1.Z=5"
    assert "may be changed" in reasons(job(line, "LIN XP1"))[0]


# Routines of packages.

ARC = [
    "TRIGGER WHEN DISTANCE = 1 DELAY = ArcGetDelay(#PreDefinition, WDAT1) DO "
    "ArcMainNG(#PreDefinition, WDAT1, WP1) PRIO = -1",
    "TRIGGER WHEN PATH = ArcGetPath(#OnTheFlyArcOn, WDAT1) DELAY = 0 DO "
    "ArcMainNG(#ArcOnMoveStd, WDAT1, WP1) PRIO = -1",
    "ArcMainNG(#ArcOnBeforeMoveStd, WDAT1, WP1)", "LIN XP1",
    "ArcMainNG(#ArcOnAfterMoveStd, WDAT1, WP1)",
]  # fmt: skip


@pytest.mark.parametrize("name", sorted(package_routines()))
def test_routines_of_packages_are_still(name):
    found = job("LIN XP1", f"{name}(1, XP1)", "LIN XP1")
    assert reasons(found) == ["", ""] and origins(found) == [[START], [0]]
    notes = [d for d in found.diagnostics if d.code == Code.ROUTINE_ASSUMED_MOTIONLESS]
    assert len(notes) == (package_routines()[name] != "ahead")
    strict = job(
        "LIN XP1", f"{name}(1, XP2)", "LIN XP1", start=Start(assume_motion=True)
    )
    assert origins(strict)[1] == [ELSEWHERE] and "motion-unknown" in codes(strict)
    moves = Start(routines={name: "moves"})
    assert origins(job("LIN XP1", f"{name}( )", "LIN XP1", start=moves))[1] == [
        ELSEWHERE
    ]


def test_inline_forms_of_arc_welding_are_read():
    found = job("$APO.CDIS=5", *ARC, *ARC)
    assert reasons(found) == ["", ""]
    assert (
        len([d for d in found.diagnostics if d.code == Code.ROUTINE_ASSUMED_MOTIONLESS])
        == 1
    )


def test_inline_forms_blend_across_the_collision_monitor():
    form = ["FDAT_ACT=FP1", "LDAT_ACT=LCPDAT1", "BAS(#CP_PARAMS, 2.0)",
            "SET_CD_PARAMS (0)"]  # fmt: skip
    found = job(*form, "LIN XP1 C_DIS", *form, "LIN XP2")
    assert reasons(found) == ["", ""] and found.visits.motion.fly.tolist() == [
        True,
        False,
    ]


def test_a_routine_of_the_files_comes_before_one_of_a_package():
    more = "DEF h50(A:IN)\nINT A\nLIN XP2\nEND\n"
    assert origins(job("LIN XP1", "H50(1)", "LIN XP1", more=more)) == [
        [START],
        [0],
        [1],
    ]


def test_what_moves_beside_is_named_with_its_line():
    found = job("LIN XP1", "TRIGGER WHEN DISTANCE=1 DELAY=0 DO glue( )", "LIN XP2")
    assert reasons(found)[-1].endswith(": line 4 of m.src calls GLUE")
