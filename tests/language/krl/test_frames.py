"""Frames that BAS links to entries, and entries that the program sets itself."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.language.language import Start
from postproc.language.visits import ELSEWHERE, ZoneRule
from tests.language.krl.test_visits import CONFIG, DATA, NEW, frame, job, reasons

SHIFT = "{X 0,Y 0,Z 5,A 0,B 0,C 0}"
ON = {
    "tool_corr": ["TOOL_CORR_ON=TRUE", f"TOOL_CORR={SHIFT}"],
    "tool_corr_w": ["TOOL_CORR_W_ON=TRUE", f"TOOL_CORR_W={SHIFT}"],
    "base_corr": ["BASE_CORR_ON=TRUE", f"BASE_CORR={SHIFT}"],
    "m_base_corr": ["M_BAS_COR_ON=TRUE", f"M_BASE_CORR={SHIFT}"],
}
TURN = "{X 100,Y 0,Z 0,A 90,B 0,C 0}"
INIT = "BAS(#INITMOV,0)"
SETS = {
    "BAS": ["BAS(#TOOL,1)", "BAS(#BASE,2)", "LIN XP1"],
    "FRAMES": ["FDAT_ACT=FP1", "BAS(#FRAMES)", "LIN XP1"],
    "PARAMS": ["FDAT_ACT=FP1", "LDAT_ACT=LCPDAT1", "BAS(#CP_PARAMS,2)", "LIN XP1"],
    "inline": [f"SLIN XP1{NEW}"],
}


def places(found):
    return frame(found, "tool")[:3], frame(found, "uframe")[:3]


@pytest.mark.parametrize("lines", SETS.values(), ids=SETS)
def test_corrections_that_are_switched_on_are_linked(lines):
    given = (
        (ON["tool_corr"], [10, 20, 305], [1000, 100, 500]),
        (ON["tool_corr_w"], [10, 20, 305], [1000, 100, 500]),
        (ON["base_corr"], [10, 20, 300], [1000, 100, 505]),
        (ON["m_base_corr"], [10, 20, 300], [1000, 100, 505]),
    )
    for switched, tool, base in given:
        found = job(INIT, *switched, *lines)
        assert reasons(found) == [""]
        np.testing.assert_allclose(places(found), (tool, base), atol=1e-9)


def test_corrections_stand_in_front_of_the_entry_or_behind_it():
    """The tool looks along a turned axis, so that the side of the link shows."""
    lines = ["BAS(#TOOL,1)", "BAS(#BASE,2)", "LIN XP1"]
    front = job(INIT, "TOOL_CORR_W_ON=TRUE", f"TOOL_CORR_W={TURN}", *lines)
    behind = job(INIT, "TOOL_CORR_ON=TRUE", f"TOOL_CORR={TURN}", *lines)
    np.testing.assert_allclose(places(front)[0], [80, 10, 300], atol=1e-9)
    np.testing.assert_allclose(places(behind)[0], [10, 120, 300], atol=1e-9)
    front = job(INIT, "BASE_CORR_ON=TRUE", f"BASE_CORR={TURN}", *lines)
    behind = job(INIT, "M_BAS_COR_ON=TRUE", f"M_BASE_CORR={TURN}", *lines)
    np.testing.assert_allclose(places(front)[1], [0, 1000, 500], atol=1e-9)
    np.testing.assert_allclose(places(behind)[1], [1100, 100, 500], atol=1e-9)


@pytest.mark.parametrize("lines", SETS.values(), ids=SETS)
@pytest.mark.parametrize(
    "before",
    [
        ["TOOL_CORR_ON=TRUE"],
        ["TOOL_CORR_ON=$IN[1]"],
        ["IF $IN[1] THEN", *ON["base_corr"], "ENDIF"],
        ["BASE_CORR_ON=TRUE", "BASE_CORR.X=N2"],
        ["BASE_CORR_ON=TRUE", "BASE_CORR=camera( )", "N2=1"],
        ["M_BAS_COR_ON=TRUE", f"M_BASE_CORR={SHIFT}", "M_BASE_CORR.Z=N2"],
        ["set_it(TOOL_CORR_ON)"],
        ["set_it( )"],
    ],
)
def test_switches_and_corrections_that_are_not_known_leave_targets(before, lines):
    more = (
        "DEF set_it(a:OUT)\nBOOL a\nTOOL_CORR_ON=$IN[2]\nEND\n"
        "DEFFCT FRAME camera( )\nRETURN $NULLFRAME\nENDFCT\n"
    )
    corrected = job(*before, *lines, more=more)
    assert reasons(corrected)[-1]


@pytest.mark.parametrize("lines", SETS.values(), ids=SETS)
def test_what_a_list_switches_on_leaves_targets(lines):
    for switch in ("TOOL_CORR_ON", "TOOL_CORR_W_ON", "BASE_CORR_ON", "M_BAS_COR_ON"):
        on = CONFIG.replace("ENDDAT", f"BOOL {switch}=TRUE\nENDDAT")
        assert switch in reasons(job(*lines, config=on))[0]
        assert reasons(job(INIT, *lines, config=on)) == [""]
        off = on.replace("=TRUE", "=FALSE")
        assert reasons(job(*lines, config=off)) == [""]


def test_what_a_routine_never_called_may_switch_leaves_targets():
    local = "DEF other( )\nBASE_CORR_ON=TRUE\nEND\n"
    assert reasons(job(*SETS["BAS"], more=local)) == [""]  # nothing can call it
    more = f"GLOBAL {local}"
    assert "BASE_CORR_ON" in reasons(job(*SETS["BAS"], more=more))[0]
    assert reasons(job(INIT, *SETS["BAS"], more=more)) == [""]
    assert reasons(job("BASE_CORR_ON=FALSE", *SETS["BAS"], more=more)) == [""]


def test_frames_that_are_taken_directly_are_not_corrected():
    direct = ["$TOOL=TOOL_DATA[1]", "$BASE=BASE_DATA[2]", "LIN XP1"]
    found = job(*ON["tool_corr"], *ON["base_corr"], *direct)
    assert reasons(found) == [""]
    np.testing.assert_allclose(places(found), ([10, 20, 300], [1000, 100, 500]))


def test_initial_moves_switch_corrections_off():
    found = job(*ON["tool_corr"], *ON["m_base_corr"], INIT, *SETS["BAS"])
    assert reasons(found) == [""]
    np.testing.assert_allclose(places(found), ([10, 20, 300], [1000, 100, 500]))


def test_initial_moves_take_the_first_tool_and_no_base():
    lines = ["BAS(#TOOL,2)", "$BASE=BASE_DATA[2]", "$IPO_MODE=#TCP", INIT, "LIN XP1"]
    found = job(*lines)
    assert reasons(found) == [""] and not found.visits.frame.tool_remote.any()
    np.testing.assert_allclose(places(found), ([10, 20, 300], [0, 0, 0]))
    on = CONFIG.replace("ENDDAT", "BOOL M_BAS_COR_ON=TRUE\nENDDAT")
    np.testing.assert_allclose(places(job(*lines, config=on))[1], 0.0)


def test_initial_moves_link_no_correction_to_the_tool():
    on = CONFIG.replace("ENDDAT", "BOOL TOOL_CORR_ON=TRUE\nENDDAT")
    np.testing.assert_allclose(
        places(job(INIT, "LIN XP1", config=on))[0], [10, 20, 300]
    )


@pytest.mark.parametrize("entry", ["TOOL_DATA[1].X=N2", "takes(TOOL_DATA[1])"])
def test_the_first_tool_must_be_known(entry):
    assert "TOOL_DATA[1]" in reasons(job(entry, INIT, "LIN XP1", "N2=1"))[0]
    without = CONFIG.replace("TOOL_DATA[1]=", "TOOL_DATA[3]=")
    assert "TOOL_DATA[1]" in reasons(job(INIT, "LIN XP1", config=without))[0]


def test_initial_moves_leave_the_load():
    found = job("$LOAD.M=50", INIT, "LIN XP1")
    assert loads(found)[0, 0] == 50.0
    assert "$LOAD" in reasons(job("$LOAD.M=N2", INIT, "LIN XP1", "N2=1"))[0]


def test_old_controllers_do_not_switch_the_correction_of_the_tool_off():
    """They take the frame back alone: it is linked again once it is set."""
    later = ["TOOL_CORR_ON=TRUE", INIT, f"TOOL_CORR={SHIFT}", *SETS["BAS"]]
    assert "TOOL_CORR_ON" in reasons(job(*later))[0]
    assert "TOOL_CORR_ON" in reasons(job(*later[:2], *later[1:]))[0]
    assert reasons(job(INIT, *later[2:])) == [""]


def test_initial_moves_take_speeds_and_distances_of_the_controller():
    given = "REAL DEF_APO_CDIS=7\nREAL DEF_APO_CPTP=40\nREAL DEF_VEL_PTP=80\n"
    config = CONFIG.replace("ENDDAT", f"{given}ENDDAT")
    lines = [INIT, "PTP XP1 C_PTP", "LIN XP2 C_DIS", "LIN XP1"]
    found = job(*lines, config=config).visits
    assert found.speed.override[0] == 0.8 and found.zone.overlap_percent[0] == 40.0
    assert found.zone.size_mm[1] == 7.0
    rules = [ZoneRule.UNKNOWN] * 2
    assert job("$APO.CDIS=5", *lines).visits.zone.rule.tolist()[:2] == rules
    still = config.replace("ENDDAT", "INT DEF_ADVANCE=0\nENDDAT")
    assert not job(*lines, config=still).visits.motion.fly.any()


def test_a_switch_of_the_program_itself_is_not_that_of_the_controller():
    data = "BOOL TOOL_CORR_ON=FALSE\n"
    found = job(INIT, "TOOL_CORR_ON=TRUE", *SETS["BAS"][:2],
                "LIN {X 1,Y 2,Z 3,A 0,B 0,C 0}", data=data)  # fmt: skip
    assert "TOOL_CORR_ON" in reasons(found)[0]


def test_frames_of_a_fixed_tool_hold_for_no_other_move():
    lines = ["FDAT_ACT=FOUT", "BAS(#FRAMES)", "LIN XP1", "$IPO_MODE=#BASE", "LIN XP1"]
    assert "IPO_FRAME #TCP" in reasons(job(*lines))[1]
    again = [*lines, "FDAT_ACT=FP1", "BAS(#FRAMES)", "LIN XP1"]
    assert reasons(job(*again))[2] == ""
    inline = "SLIN XP1 WITH $TOOL=STOOL2(FOUT), $BASE=SBASE(2)"
    assert "IPO_FRAME #TCP" in reasons(job(inline))[0]


# Entries of tables that the program sets.


def test_entries_that_the_program_sets_are_known_from_there_on():
    new = "BASE_DATA[20]={FRAME: X 5,Y 6,Z 7,A 0,B 0,C 0}"
    for use in ("$BASE=BASE_DATA[20]", "BAS(#BASE,20)"):
        found = job("BAS(#TOOL,1)", new, use, "LIN XP1")
        assert reasons(found) == [""]
        np.testing.assert_allclose(places(found)[1], [5, 6, 7])
    tool = job("TOOL_DATA[1]={X 1,Y 2,Z 3,A 0,B 0,C 0}", "BAS(#TOOL,1)", "LIN XP1")
    np.testing.assert_allclose(places(tool)[0], [1, 2, 3])


@pytest.mark.parametrize(
    "lines",
    [
        [f"BASE_DATA[2]={TURN}", "BASE_DATA[2].Z=7", "$BASE=BASE_DATA[2]"],
        ["BASE_DATA[20]=BASE_DATA[2]", "BASE_DATA[20].X=100", "BASE_DATA[20].Y=0",
         "BASE_DATA[20].Z=7", "BASE_DATA[20].A=90", "BAS(#BASE,20)"],
        [*(f"BASE_DATA[2].{one}" for one in ("X=100", "Y=0", "Z=7", "A=90", "B=0",
                                            "C=0")), "$BASE=BASE_DATA[2]"],
        [f"$BASE={TURN}", "$BASE.Z=9-2"],
    ],
)  # fmt: skip
def test_components_of_frames_are_set_one_by_one(lines):
    found = job(*lines, "LIN XP1")
    whole = job("$BASE={X 100,Y 0,Z 7,A 90,B 0,C 0}", "LIN XP1")
    assert reasons(found) == [""]
    poses = [
        one.visits.frame.poses[one.visits.frame.uframe[0]] for one in (found, whole)
    ]
    np.testing.assert_allclose(*poses, atol=1e-12)


@pytest.mark.parametrize(
    "lines",
    [
        ["BASE_DATA[2].Z=7", "$BASE=BASE_DATA[2]"],
        [f"BASE_DATA[2]={TURN}", "BASE_DATA[N2].Z=7", "$BASE=BASE_DATA[2]"],
        [f"BASE_DATA[2]={TURN}", "IF $IN[1] THEN", "BASE_DATA[2].Z=7", "ENDIF",
         "$BASE=BASE_DATA[2]"],
        [f"BASE_DATA[2]={TURN}", "BASE_DATA[2].Z=N2", "$BASE=BASE_DATA[2]"],
        ["BASE_DATA[2]={X 1,Y 2,Z 3,A 40,B 90,C 0}", "BASE_DATA[2].A=7",
         "$BASE=BASE_DATA[2]"],
        ["IF $IN[1] THEN", "$BASE.X=3", "ENDIF"],
    ],
)  # fmt: skip
def test_components_that_are_not_certain_leave_targets(lines):
    assert reasons(job(*lines, "LIN XP1", "N2=1"))[0]


@pytest.mark.parametrize(
    "lines",
    [
        ["$BASE=BASE_DATA[20]", "BASE_DATA[20]={X 5,Y 6,Z 7,A 0,B 0,C 0}"],
        ["BASE_DATA[2].X=N2", "$BASE=BASE_DATA[2]"],
        ["BASE_DATA[N2]={X 5,Y 6,Z 7,A 0,B 0,C 0}", "$BASE=BASE_DATA[2]"],
        ["BASE_DATA[2]={X N2,Y 6,Z 7,A 0,B 0,C 0}", "$BASE=BASE_DATA[2]"],
        ["IF $IN[1] THEN", "BASE_DATA[2]={X 5,Y 6,Z 7,A 0,B 0,C 0}", "ENDIF",
         "$BASE=BASE_DATA[2]"],
        ["BASE_DATA[2]={X 5,Y 6,Z 7,A 0,B 0,C 0}", "camera(BASE_DATA[2])",
         "$BASE=BASE_DATA[2]"],
        ["BASE_DATA[2]={X 5,Y 6,Z 7,A 0,B 0,C 0}", "other( )", "$BASE=BASE_DATA[2]"],
    ],
)  # fmt: skip
def test_entries_that_are_not_known_leave_targets(lines):
    more = "DEF other( )\nBASE_DATA[2]={X N2,Y 0,Z 0,A 0,B 0,C 0}\nEND\n"
    assert reasons(job(*lines, "LIN XP1", "N2=1", more=more))[0]


def test_other_entries_than_those_that_the_program_sets_stay_known():
    new = "BASE_DATA[20]={X 5,Y 6,Z 7,A 0,B 0,C 0}"
    found = job("$BASE=BASE_DATA[2]", "LIN XP1", new, "$BASE=BASE_DATA[20]", "LIN XP1")
    assert reasons(found) == ["", ""]
    found = job("FOR I=3 TO 4", "BASE_DATA[I]={X 5,Y 6,Z 7,A 0,B 0,C 0}", "ENDFOR",
                "$BASE=BASE_DATA[3]", "LIN XP1")  # fmt: skip
    np.testing.assert_allclose(places(found)[1], [5, 6, 7])


def test_an_interrupt_that_sets_an_entry_leaves_everything():
    line = "INTERRUPT DECL 5 WHEN $IN[1] DO camera( )"
    more = "DEF camera( )\nBASE_DATA[2]={X 5,Y 6,Z 7,A 0,B 0,C 0}\nEND\n"
    found = job(line, "INTERRUPT ON 5", "$BASE=BASE_DATA[2]", "LIN XP1", more=more)
    assert reasons(found)[0]


# Loads.


def loads(found):
    v = found.visits
    return v.motion.loads[v.motion.load]


LOAD = "{M 90,CM {X 10,Y 20,Z 30,A 0,B 0,C 0},J {X 1,Y 1,Z 1}}"


@pytest.mark.parametrize(
    "line",
    [f"$LOAD={LOAD}", f"LOAD_DATA[1]={LOAD}\nBAS(#TOOL,1)",
     f"LOAD_DATA[1]={LOAD}\n$LOAD=SLOAD(1)",
     f"LOAD_DATA[1]={LOAD}\n$LOAD=LOAD_DATA[1]",
     f"LOAD_DATA[1]={LOAD}\nFDAT_ACT=FP1\nBAS(#FRAMES)",
     "$LOAD.M=90\n$LOAD.CM={X 10,Y 20,Z 30,A 0,B 0,C 0}"],
)  # fmt: skip
def test_every_form_that_sets_a_load_is_taken(line):
    found = job("BAS(#TOOL,0)", "LIN XP1", line, "LIN XP1", "LIN XP1")
    assert reasons(found) == [""] * 3
    nan, own = [np.nan] * 4, [90.0, 0.01, 0.02, 0.03]
    np.testing.assert_allclose(loads(found), [nan, own, own])


def test_a_move_may_state_its_own_load():
    found = job("BAS(#TOOL,0)", f"SLIN XP1{NEW}", "SLIN XP1")
    np.testing.assert_allclose(loads(found)[0], [40.0, 0.0, 0.0, 0.0])
    assert np.isnan(loads(found)[1]).all()


def test_a_mass_alone_keeps_the_centre_that_was_stated():
    found = job("$LOAD.M=50", "LIN XP1", f"$LOAD={LOAD}", "$LOAD.M=50", "LIN XP1")
    np.testing.assert_allclose(loads(found)[0], [50, *[np.nan] * 3])
    np.testing.assert_allclose(loads(found)[1], [50, 0.01, 0.02, 0.03])


@pytest.mark.parametrize(
    "line",
    ["$LOAD.M=N2", "$LOAD=camera( )", "$LOAD=LOAD_DATA[N2]", "$LOAD=SLOAD(N2)",
     "LOAD_DATA[1].M=N2\nBAS(#TOOL,1)", "IF $IN[1] THEN\n$LOAD.M=90\nENDIF",
     f"$LOAD={LOAD}\n$LOAD.CM.X=N2", "$LOAD.CM={X 1,Y N2,Z 3}"],
)  # fmt: skip
def test_a_load_that_is_not_known_leaves_targets(line):
    more = "DEFFCT LOAD camera( )\nRETURN $LOAD\nENDFCT\n"
    found = job("BAS(#TOOL,0)", line, "LIN XP1", "N2=1", more=more)
    assert "$LOAD" in reasons(found)[0]


@pytest.mark.parametrize("line", ["$LOAD.M=-1", "$LOAD={M -1}", "BAS(#TOOL,0)"])
def test_a_placeholder_states_no_load(line):
    found = job(line, "LIN XP1")
    assert reasons(found) == [""] and np.isnan(loads(found)).all()


@pytest.mark.parametrize(
    ("call", "left"),
    [("set_it(TOOL_CORR_ON)", True), ("N2=get_it(BASE_CORR_ON)", True),
     ("set_it(BASE_DATA[2])", True), ("set_it(TOOL_DATA[N2])", True),
     ("set_it($BASE)", True), ("set_it(XP2)", False), ("set_it($OUT[1])", False)],
)  # fmt: skip
def test_what_is_handed_over_may_be_changed(call, left):
    more = "DEF set_it(a:OUT)\nBOOL a\na=TRUE\nEND\n"
    more += "DEFFCT BOOL get_it(a:OUT)\nBOOL a\na=TRUE\nRETURN a\nENDFCT\n"
    known = ["BASE_DATA[2]={X 1,Y 2,Z 3,A 0,B 0,C 0}", INIT, "$IPO_MODE=#BASE"]
    known.append("TOOL_DATA[1]={X 1,Y 2,Z 3,A 0,B 0,C 0}")
    lines = ["$BASE=BASE_DATA[2]", call]
    rest = [] if call == "set_it($BASE)" else ["BAS(#TOOL,1)", "BAS(#BASE,2)"]
    found = job(*known, *lines, *rest, "LIN XP1", more=more)
    assert bool(reasons(found)[0]) == left


@pytest.mark.parametrize(
    "line", ["$TECH.MODE=#CYCLE", "$TECH[1].CLASS=#PATH", "$LOAD_A3.M=12"]
)
def test_what_moves_or_loads_the_arm_besides_leaves_targets(line):
    assert reasons(job(line, "LIN XP1"))[0]


BELT = "MACHINE_DEF[3].ROOT,MACHINE_DEF[3].NAME[],BASE_DATA[2],1"


@pytest.mark.parametrize("name", ["EB", "EB_ABS"])
def test_a_base_on_a_conveyor_leaves_the_tool_and_the_load(name):
    lines = [INIT, "BAS(#TOOL,1)", f"$BASE={name}({BELT})", "LIN XP1",
             "BAS(#BASE,2)", "PTP XP1"]  # fmt: skip
    found = job(*lines)
    v = found.visits
    assert "another axis or arm" in reasons(found)[0] and reasons(found)[1] == ""
    assert frame(found, "tool", 1)[:3].tolist() == [10, 20, 300]
    assert v.motion.loads[v.motion.load[1]][0] == 40.0
    assert v.graph.predecessors(0).tolist() == [ELSEWHERE]


def test_the_arm_may_be_taken_along_before_another_base_is_set():
    found = job(INIT, "BAS(#TOOL,1)", "PTP XA", f"$BASE=EB({BELT})", "BAS(#BASE,2)",
                "LIN XP1")  # fmt: skip
    assert found.visits.graph.predecessors(1).tolist() == [ELSEWHERE]


ASSIGNED = {
    "written": ["FR={X 1,Y 2,Z 3,A 0,B 0,C 0}"],
    "copied": ["FB={X 1,Y 2,Z 3,A 0,B 0,C 0}", "FR=FB"],
    "in parts": ["FR={X 1,Y 0,Z 0,A 0,B 0,C 0}", "FR.Y=2", "FR.Z=3"],
    "linked": ["FR={X 1,Y 2,Z 0,A 0,B 0,C 0}:{X 0,Y 0,Z 3,A 0,B 0,C 0}"],
}


@pytest.mark.parametrize("lines", ASSIGNED.values(), ids=ASSIGNED)
@pytest.mark.parametrize("sets", [["$BASE=FR"], ["BASE_DATA[5]=FR", "BAS(#BASE,5)"]])
def test_a_frame_that_is_assigned_on_the_way_is_known(lines, sets):
    found = job("DECL FRAME FR,FB", INIT, "BAS(#TOOL,1)", *lines, *sets, "LIN XP1")
    assert reasons(found) == [""]
    np.testing.assert_allclose(places(found)[1], [1, 2, 3], atol=1e-9)
    ways = [*lines, "IF $IN[1] THEN", "FR.X=7", "ENDIF", *sets]
    found = job("DECL FRAME FR,FB", INIT, "BAS(#TOOL,1)", *ways, "LIN XP1")
    assert "FR" in reasons(found)[0] or "BASE_DATA[5]" in reasons(found)[0]


def test_a_frame_that_is_made_from_a_taught_one_was_taught():
    """By the cell, or by a comment where the numbers stand."""
    marked = CONFIG.replace("Z 500,A 0,B 0,C 0}", "Z 500,A 0,B 0,C 0} ; TAUGHT", 1)
    by_cell = {"start": Start(taught=frozenset({"base_data"}))}
    for more in (by_cell, {"config": marked}):
        lines = "DECL FRAME FR", INIT, "FR=BASE_DATA[2]", "$BASE=FR", "LIN XP1"
        v = job(*lines, **more).visits
        assert v.frame.taught[v.frame.uframe[0]]


FROM_TABLES = [
    ["FR=BASE_DATA[4]"],  # it hangs on an external axis
    ["FR=BASE_DATA[2]", "FR.Z=3"],
    ["FR=BASE_DATA[2]:{X 1,Y 0,Z 0,A 0,B 0,C 0}"],
    ["FB=BASE_DATA[2]", "FR=FB", "FR.X=BASE_DATA[4].X"],
    ["FR=linked( )"],
    ["V=BASE_DATA[4].X", "FR={X V,Y 0,Z 0,A 0,B 0,C 0}"],
]


@pytest.mark.parametrize("lines", FROM_TABLES)
def test_a_frame_that_is_computed_from_an_entry_is_left(lines):
    """Whether it was taught, or hangs on another axis, is that of the entry."""
    more = (
        "DEFFCT FRAME linked( )\nRETURN BASE_DATA[4]:{X 1,Y 0,Z 0,A 0,B 0,C 0}\nENDFCT"
    )
    declared = "DECL FRAME FR,FB", "DECL REAL V", INIT, "BAS(#TOOL,1)"
    found = job(*declared, *lines, "$BASE=FR", "LIN XP1", more=more)
    assert "entry of" in reasons(found)[0] or "MACHINE_FRAME" in reasons(found)[0]


def test_a_speed_that_is_assigned_on_the_way_is_known():
    lines = ["BAS(#TOOL,1)", "BAS(#BASE,2)", "LIN XP1"]
    found = job("DECL REAL V", INIT, "V=0.25", "$VEL.CP=V", *lines)
    assert found.visits.speed.linear.tolist() == [0.25]


XS2 = ["BAS(#TOOL,1)", "BAS(#BASE,2)", "LIN XS[2]"]
OTHERS = ["XS[1]=XP1", "XS[1].X=9", "XS[3]=XS[1]", "known_not(XS[1])"]


@pytest.mark.parametrize("line", OTHERS)
def test_an_element_is_known_although_another_one_is_changed(line):
    found = job(INIT, line, *XS2, more="DEF known_not(P:OUT)\nE6POS P\nP.X=1\nEND\n")
    assert reasons(found) == [""] and found.visits.target.values[0][0] == 2


ANY_ELEMENT = ["XS[K]=XP1", "XS[IX[1]]=XP1", "XS[2].X=9", "known_not(XS[])"]


@pytest.mark.parametrize("line", ANY_ELEMENT)
def test_an_element_that_may_be_changed_is_not_known_behind_it(line):
    more = "DEF known_not(P[]:OUT)\nE6POS P[]\nP[2].X=1\nEND\n"
    data = DATA + "INT K\nDECL INT IX[2]\nIX[1]=1"
    found = job(INIT, "WAIT FOR $IN[1]", line, *XS2, more=more, data=data)
    assert found.visits.target.values[0][0] != 2


def test_the_index_of_an_entry_is_that_of_the_routine_not_of_the_list():
    """What the list calls N is hidden by a parameter: any entry may be changed."""
    changes = "DEF put(N:IN)\nINT N\nBASE_DATA[N]={X 1,Y 2,Z 3,A 0,B 0,C 0}\nEND\n"
    found = job("put(2)", "unknown( )", INIT, *XS2, more=changes)
    assert "BASE_DATA[2] may be changed" in reasons(found)[0]


CELL = (1000.0, 100.0, 500.0, 0.0, 0.0, 0.0)
CHANGES = ["$BASE.X=5", "$BASE=$BASE:{X 1,Y 0,Z 0,A 0,B 0,C 0}"]


@pytest.mark.parametrize("line", CHANGES)
@pytest.mark.parametrize("taught", [True, False])
@pytest.mark.parametrize("before", [[], ["$BASE=BASE_DATA[2]"]])
def test_what_comes_of_a_taught_frame_of_the_cell_was_taught(line, taught, before):
    start = Start(uframe=CELL, taught_records=[CELL] if taught else [])
    v = job(*before, line, "LIN XP1", start=start).visits
    assert v.frame.taught[v.frame.uframe].tolist() == [taught]
