"""Programs of KRL whose targets are not where, or not from where, they seem to be."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.language.language import Start
from postproc.language.visits import ELSEWHERE, START
from tests.language.krl.test_visits import (
    CONFIG,
    DATA,
    NEW,
    frame,
    job,
    names,
    origins,
    reasons,
)

FRAMES = ["BAS(#TOOL,1)", "BAS(#BASE,2)"]
THIRD = "$BASE=BASE_DATA[3]"


def reached(found, name):
    """Return where the visits of a point come from."""
    pairs = zip(names(found), origins(found), strict=True)
    return [origin for own, origin in pairs if own == name]


# Loops whose variable changes on the way.

COUNTS = {
    "assigned": ("N2=N2+1", ""),
    "given": ("step(N2)", "DEF step(a:OUT)\nINT a\na=a+1\nEND\n"),
    "read": ("CWRITE(N2)", "DEF CWRITE(a:OUT)\nINT a\na=a+1\nEND\n"),
    "called": ("step( )", "DEF step( )\nN2=N2+1\nEND\n"),
    "counted": ("step( )", "DEF step( )\nFOR N2=1 TO 2\nENDFOR\nEND\n"),
    "asked": ("IF step(N2) THEN\nENDIF",
              "DEFFCT BOOL step(a:OUT)\nINT a\na=a+1\nRETURN TRUE\nENDFCT\n"),
    "within": ("FOR N2=2 TO 3\nENDFOR", ""),
}  # fmt: skip


@pytest.mark.parametrize("kind", COUNTS)
def test_a_loop_whose_variable_changes_is_not_followed_round_by_round(kind):
    line, more = COUNTS[kind]
    loop = ["FOR N2=1 TO 3", "LIN XS[N2]", *line.split("\n"), "ENDFOR", "LIN XP1"]
    found = job(*FRAMES, *loop, more=more)
    assert "xs[2]" not in names(found)
    assert all(why for why, name in zip(reasons(found), names(found), strict=True)
               if name.startswith("xs"))  # fmt: skip


def test_an_interrupt_may_change_the_variable_of_a_loop():
    lines = ["INTERRUPT DECL 5 WHEN $IN[1] DO N2=3", "INTERRUPT ON 5",
             "FOR N2=1 TO 3", "LIN XS[N2]", "ENDFOR"]  # fmt: skip
    assert "xs[2]" not in names(job(*FRAMES, *lines))


STEADY = {
    "own": ("DECL INT I", "step( )", "DEF step( )\nI=5\nEND\n"),
    "calls-nothing": ("", "N=N2", "DEF step( )\nI=5\nEND\n"),
    "calls": ("", "step( )", "DEF step( )\nN=5\nEND\n"),
    "changed-elsewhere": ("I=7", "step( )", "DEF step( )\nN=5\nEND\n"),
}


@pytest.mark.parametrize("kind", STEADY)
def test_a_loop_whose_variable_nothing_changes_is_followed(kind):
    declared, line, more = STEADY[kind]
    lines = [declared, *FRAMES, "FOR I=1 TO 3", "LIN XS[I]", line, "ENDFOR"]
    found = job(*(one for one in lines if one), more=more)
    assert names(found) == ["xs[1]", "xs[2]", "xs[3]"] and not any(reasons(found))


# Routines that call themselves.

AGAIN = "DEF sub( )\nLIN XP1\n{}\nIF $IN[1] THEN\n{}( )\nENDIF\nEND\n{}"
OTHER = "DEF other( )\nsub( )\nEND\n"


@pytest.mark.parametrize("called", ["sub", "other"])
def test_a_routine_that_calls_itself_begins_with_what_holds_there(called):
    found = job(*FRAMES, "sub( )", more=AGAIN.format(THIRD, called, OTHER))
    assert "$TOOL and $BASE are not known" in reasons(found)[0]


@pytest.mark.parametrize("called", ["sub", "other"])
def test_a_routine_that_calls_itself_begins_where_it_does_so(called):
    found = job(*FRAMES, "sub( )", more=AGAIN.format("LIN XLIN", called, OTHER))
    assert reached(found, "xp1") == [[START, 1]]


def test_a_loop_of_a_routine_that_calls_itself_begins_again():
    more = "DEF sub( )\nDECL INT I\nFOR I=1 TO 2\nLIN XS[I]\nsub( )\nENDFOR\nEND\n"
    found = job(*FRAMES, "sub( )", more=more)
    assert ELSEWHERE not in reached(found, "xs[1]")[0]
    assert 0 in reached(found, "xs[1]")[0]


def test_the_program_itself_may_begin_again():
    assert reached(job("LIN XP1", "LIN XP2", "m( )"), "xp1") == [[START, 1]]


# Errors that skip a statement.


def test_an_error_may_skip_a_call_that_moves():
    more = "DEF moves(a:IN)\nINT a\nLIN XP2\nEND\n"
    found = job("LIN XP1", "ON_ERROR_PROCEED", "moves(N)", "LIN XP1", more=more)
    assert reached(found, "xp1") == [[START], [0, 1]]


def test_an_error_may_skip_a_call_that_sets_frames():
    more = f"DEF sets(a:IN)\nINT a\n{THIRD}\nEND\n"
    found = job(*FRAMES, "ON_ERROR_PROCEED", "sets(N)", "LIN XP1", more=more)
    assert "$TOOL and $BASE are not known" in reasons(found)[0]


# Moves that run beside what is followed.

THERE = f"DEF there( )\n{THIRD}\nLIN XP1\nEND\n"
BESIDE = {
    "interrupt": ["INTERRUPT DECL 5 WHEN $IN[1] DO there( )", "LIN XP1", "WAIT SEC 0",
                  "INTERRUPT ON 5", "LIN XP2", "INTERRUPT OFF 5"],
    "trigger": ["LIN XP1", "TRIGGER WHEN DISTANCE=0 DELAY=0 DO there( )", "LIN XP2"],
    "function": ["LIN XP1", "N2=asks( )"],
    "called-too": ["there( )", "N2=asks( )"],
}  # fmt: skip
ASKS = "DEFFCT INT asks( )\nthere( )\nRETURN 1\nENDFCT\n"


@pytest.mark.parametrize("kind", BESIDE)
def test_a_target_of_moves_that_run_beside_keeps_its_numbers(kind):
    found = job(*FRAMES, *BESIDE[kind], more=THERE + ASKS)
    pins = found.visits.literals.pins
    assert any("goes there too" in why and 0 in pins[why].tolist() for why in pins)


def test_a_routine_that_nothing_calls_pins_nothing():
    assert not job("LIN XP1", more=THERE).visits.literals.pins


# Points that shift others.


def test_a_point_that_shifts_another_keeps_its_numbers():
    pins = job("LIN XP2", "LIN XP1:XP2", "LIN XP1").visits.literals.pins
    assert "xp2 is used otherwise than as a destination too" in pins


def test_a_frame_that_shifts_a_point_leaves_it():
    data = DATA + "DECL FRAME F={X 1,Y 0,Z 0,A 0,B 0,C 0}\n"
    assert not job("LIN F:XP1", "LIN XP1", data=data).visits.literals.pins


# Elements that only the run tells.


@pytest.mark.parametrize(
    "line", ["LIN XS[N2]", "LIN BASE_DATA[3]:XS[N2]", "PTP XS[N2]"]
)
def test_an_element_that_only_the_run_tells_may_be_any(line):
    found = job(*FRAMES, "LIN XS[1]", THIRD, line, "LIN XP1").visits
    ((why, own),) = found.literals.pins.items()
    assert "element of xs" in why and own == found.target.literal[:1]


def test_elements_that_are_known_are_no_others():
    assert not job("LIN XS[1]", "LIN XS[2]", "LIN XA").visits.literals.pins


# Lists that set a component.


@pytest.mark.parametrize(("line", "point"), [
    ("XP1.Z=70", "XP1"), ("XS[1].Z=70", "XS[1]"), ("xp1.z=70", "XP1"),
])  # fmt: skip
def test_a_point_whose_component_a_list_sets_is_left(line, point):
    found = job(*FRAMES, f"LIN {point}", data=DATA + line + "\n")
    assert "may be changed" in reasons(found)[0]


@pytest.mark.parametrize("line", ["BASE_DATA[2].Z=7", "TOOL_DATA[1].X=7"])
def test_a_frame_whose_component_a_list_sets_is_not_known(line):
    config = CONFIG.replace("ENDDAT", f"{line}\nENDDAT")
    assert reasons(job(*FRAMES, "LIN XP1", config=config))[0]
    other = job("BAS(#TOOL,0)", "BAS(#BASE,3)", "LIN XP1", config=config)
    assert reasons(other) == [""]


def test_settings_whose_component_a_list_sets_are_not_known():
    lines = ["FDAT_ACT=FP1", "BAS(#FRAMES)", "LIN XP1"]
    assert reasons(job(*lines, data=DATA + "FP1.BASE_NO=3\n"))[0]


# Routines of the files that have the name of one of the controller.

FRAME_3 = "DEFFCT FRAME {}(n:IN)\nINT n\nRETURN BASE_DATA[3]\nENDFCT\n"


@pytest.mark.parametrize(("line", "name"), [
    ("$BASE=SBASE(2)", "sbase"), ("$TOOL=STOOL(1)", "stool"),
    ("$LOAD=SLOAD(1)", "sload"), ("$IPO_MODE=SIPO_MODE(#BASE)", "sipo_mode"),
])  # fmt: skip
def test_a_function_of_the_files_is_not_that_of_the_controller(line, name):
    found = job(*FRAMES, line, "LIN XP1", more=FRAME_3.format(name))
    assert reasons(found)[0]
    inline = job(*FRAMES, f"SLIN XP1 WITH {line}", more=FRAME_3.format(name))
    assert reasons(inline)[0]


def test_bas_of_the_files_is_followed():
    more = f"DEF BAS(c:IN,n:IN)\nINT n\n{THIRD}\nEND\n"
    found = job("BAS(#TOOL,1)", "BAS(#BASE,2)", "LIN XP1", more=more)
    assert frame(found, "uframe")[:3].tolist() == [0, 0, 0]


def test_a_routine_of_the_files_may_change_what_that_of_the_controller_keeps():
    more = "DEF USERSPOT(a:OUT)\nINT a\na=2\nEND\n"
    found = job("USERSPOT(N)", "LIN XS[N]", more=more)
    assert found.visits.target.values[0, 0] == 2.0
    found = job("IF $IN[1] THEN", "USERSPOT(N)", "ENDIF", "LIN XS[N]", more=more)
    assert "no value that is known" in reasons(found)[0]


# Settings that are not those of the controller, and orientations.


@pytest.mark.parametrize("declared", ["DECL FDAT FDAT_ACT", ""])
def test_bas_takes_the_settings_of_the_controller(declared):
    lines = [declared, "FDAT_ACT=FP1", "BAS(#FRAMES)", "LIN XP1"]
    found = job(*(one for one in lines if one))
    assert bool(reasons(found)[0]) is bool(declared)


@pytest.mark.parametrize("word", ["#CONSTANT", "#IGNORE", "N2"])
def test_where_the_tool_need_not_turn_to_a_point_nothing_follows_from_it(word):
    found = job(f"$ORI_TYPE={word}", "LIN XP1", "PTP XP2")
    assert (
        "$ORI_TYPE" in reasons(found)[0]
        and np.isnan(found.visits.target.values[0]).all()
    )


@pytest.mark.parametrize("lines", [
    ["$ORI_TYPE=#CONSTANT", "LIN XP1", "$ORI_TYPE=#VAR"],
    ["SLIN XP1 WITH $ORI_TYPE=#IGNORE"],
    ["CIRC XP2,XP1,CA N2"],
    ["PTP_SPLINE", "SLIN XP1", "ENDSPLINE"],
])  # fmt: skip
def test_a_point_that_a_move_need_not_reach_keeps_its_numbers(lines):
    found = job(*FRAMES, *lines, "LIN XP1")
    assert reasons(found)[-1] == ""
    last = int(found.visits.target.literal[-1])
    assert any(last in rows.tolist() for rows in found.visits.literals.pins.values())


# Home positions.


@pytest.mark.parametrize(
    ("line", "why"),
    [("XHOME.A1=30", "a1 set in line"), ("sub(XHOME)", "a1 set in line")],
)
def test_a_home_position_that_the_program_sets_is_not_known(line, why):
    more = "DEF sub(a:OUT)\nE6AXIS a\na.A1=5\nEND\n"
    found = job(line, "PTP XHOME", "LIN XP1", more=more)
    assert why in reasons(found)[0]


@pytest.mark.parametrize("name", ["XHOME3", "$AXIS_HOME[2]"])
def test_a_home_position_other_than_the_first_is_not_that_of_the_cell(name):
    assert (
        "declared in none of the given files"
        in reasons(job(f"PTP {name}", "LIN XP1"))[0]
    )


def test_the_home_position_of_the_controller_may_be_set():
    assert reasons(job("$H_POS=XA", "PTP $H_POS"))[0] != reasons(job("PTP $H_POS"))[0]


def test_a_home_position_that_is_a_pose_is_where_it_says():
    home = "DECL E6POS HOME={X 1,Y 2,Z 3,A 0,B 0,C 180,S 2,T 35}\n"
    found = job("PTP HOME", data=DATA + home)
    assert "home position" in reasons(found)[0]
    assert found.visits.target.values[0].tolist()[:3] == [1, 2, 3]


# Interrupts that come in moves before they are switched on: the program is ahead.

MOVES = "DEF found_it( )\nLIN XP2\nEND\n"
DECLARED = "INTERRUPT DECL 10 WHEN $IN[1]==TRUE DO found_it( )"


def left(found):
    return ["interrupt" in why for why in reasons(found)]


def test_an_interrupt_comes_in_moves_that_the_program_is_ahead_of():
    lines = [DECLARED, *["LIN XP1"] * 8, "INTERRUPT ON 10", "LIN XP1"]
    assert left(job(*lines, more=MOVES)) == [False] * 2 + [True] * 7


@pytest.mark.parametrize("line", ["WAIT SEC 0", "$OUT[1]=TRUE", "WAIT FOR $IN[2]"])
def test_what_waits_for_the_arm_keeps_an_interrupt_out_of_the_moves_before(line):
    lines = [DECLARED, "LIN XP1", line, "INTERRUPT ON 10", "LIN XP1"]
    assert left(job(*lines, more=MOVES)) == [False, True]
    before = [DECLARED, "LIN XP1", line, "LIN XP1", "INTERRUPT ON 10", "LIN XP1"]
    assert left(job(*before, more=MOVES)) == [False, True, True]


def test_an_interrupt_of_a_routine_comes_in_moves_before_the_call():
    more = f"DEF sub( )\n{DECLARED}\nINTERRUPT ON 10\nEND\n{MOVES}"
    assert left(job("LIN XP1", "sub( )", more=more)) == [True]


# External axes that do not go where targets say.


@pytest.mark.parametrize(
    ("use", "lines", "left"),
    [
        ("track", ["$EX_AX_IGNORE='B1'"], True),
        ("track", ["$EX_AX_IGNORE=1", "$EX_AX_IGNORE=0"], False),
        ("track", ["IF $IN[1] THEN", "$EX_AX_IGNORE=1", "ENDIF"], True),
        ("gun", ["$EX_AX_IGNORE=1"], False),
    ],
)
def test_a_track_that_need_not_go_where_targets_say(use, lines, left):
    found = job(*FRAMES, *lines, "LIN XP1", start=Start(aux={1: use}))
    assert ("$EX_AX_IGNORE" in reasons(found)[0]) == left


# Statements that are not understood.

AS_BEFORE = [*FRAMES, "$IPO_MODE=#BASE", "$ORI_TYPE=#VAR", "$APO.CDIS=5", "PTP XP1"]
NAMING = {
    "point": "XP2.Z=1 ?? 2",
    "entry": "BASE_DATA[2]= ?? 3",
    "switch": "IF $IN[1] THEN M_BAS_COR_ON=TRUE ENDIF",
    "interrupt": "?? INTERRUPT ON 5",
}


@pytest.mark.parametrize("kind", NAMING)
def test_a_statement_that_is_not_understood_may_change_what_it_names(kind):
    more = "DEF never( )\n" + NAMING[kind] + "\nEND\n"
    assert reasons(job(NAMING[kind], *AS_BEFORE, "LIN XP2"))[-1]
    assert reasons(job(*AS_BEFORE, "LIN XP2", more=more))[-1]


def test_a_statement_that_is_not_understood_may_change_the_variable_of_a_loop():
    lines = ["FOR N2=1 TO 3", "LIN XS[N2]", "?? N2", "ENDFOR"]
    assert "xs[2]" not in names(job(*FRAMES, *lines))


JUMPING = {
    "label": ([THIRD, "IF $IN[1] THEN GOTO out ENDIF", *AS_BEFORE, "out:"], ""),
    "routine": (["sub( )"], "\n".join(["DEF sub( )", THIRD, "?? RETURN", *AS_BEFORE,
                                       "END\n"])),
    "loop": (["LOOP", THIRD, "IF $IN[1] THEN EXIT ENDIF", *AS_BEFORE,
              "IF $IN[2] THEN", "EXIT", "ENDIF", "ENDLOOP"], ""),
}  # fmt: skip


@pytest.mark.parametrize("kind", JUMPING)
def test_a_statement_that_is_not_understood_may_lead_elsewhere(kind):
    lines, more = JUMPING[kind]
    found = job(*AS_BEFORE, *lines, "LIN XP2", more=more)
    assert ELSEWHERE in origins(found)[-1] and "not known" in reasons(found)[-1]


def test_a_move_that_is_not_understood_sets_nothing():
    found = job("SLIN XP1 WITH ?? XP2, $TOOL=STOOL2(FP1)", *AS_BEFORE, "LIN XP2")
    assert reasons(found)[-1] == "" and any(found.visits.literals.pins)
    modern = job(f"SLIN XP1 {NEW} ?? 3", *AS_BEFORE, f"SLIN XG{NEW}")
    assert reasons(modern)[-1] == ""


def test_an_entry_of_a_list_that_is_not_understood_is_no_other():
    config = CONFIG.replace("ENDDAT", "LOAD_DATA[9]={M ?? 3}\nBASE_DATA[9]=?\nENDDAT")
    assert reasons(job(*AS_BEFORE, "LIN XP2", config=config)) == ["", ""]
