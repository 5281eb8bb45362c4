"""What a KRL job does: visits, where they come from, and what is left."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.exceptions import ProgramError
from postproc.language.krl.language import Krl
from postproc.language.language import Start
from postproc.language.text.source import Source
from postproc.language.visits import (
    ELSEWHERE,
    START,
    Blend,
    Meaning,
    OrientationLaw,
    Switch,
    ZoneRule,
)
from postproc.robot.pose import record_from_pose

E = "E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0"
DATA = f"""
DECL E6POS XP1={{X 1,Y 2,Z 3,A 0,B 0,C 180,S 2,T 35,{E}}}
DECL E6POS XP2={{x 4.5, y -5, z 6, a 10, b 20, c 30, s 'B010', t 'H23'}}
DECL GLOBAL E6POS XG={{X 7,Y 8,Z 9,A 0,B 0,C 0,S 2,T 2}}
DECL POS XLIN={{X 1,Y 1,Z 1,A 0,B 0,C 0}}
DECL E6AXIS XA={{A1 1,A2 2,A3 3,A4 4,A5 5,A6 6,{E}}}
DECL E6POS XS[3]
XS[1]={{X 1,Y 0,Z 0,A 0,B 0,C 0,S 2,T 2}}
XS[2]={{X 2,Y 0,Z 0,A 0,B 0,C 0,S 2,T 2}}
XS[3]={{X 3,Y 0,Z 0,A 0,B 0,C 0,S 2,T 2}}
DECL FDAT FP1={{TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE,POINT2[] " ",TQ_STATE FALSE}}
DECL FDAT FOUT={{TOOL_NO 1,BASE_NO 3,IPO_FRAME #TCP,POINT2[] " "}}
DECL FDAT FEX={{TOOL_NO 1,BASE_NO 4,IPO_FRAME #BASE}}
DECL PDAT PPDAT1={{VEL 100,ACC 100,APO_DIST 50,APO_MODE #CPTP}}
DECL LDAT LCPDAT1={{VEL 2,ACC 100,APO_DIST 12.5,ORI_TYP #VAR,CIRC_TYP #BASE}}
DECL LDAT LJOINT={{VEL 2,ACC 100,APO_DIST 12.5,ORI_TYP #JOINT,CIRC_TYP #BASE}}
INT N=3
"""
CONFIG = """DEFDAT $CONFIG
DECL FRAME TOOL_DATA[16]
TOOL_DATA[1]={X 10,Y 20,Z 300,A 90,B 0,C 0}
DECL FRAME BASE_DATA[32]
BASE_DATA[2]={X 1000,Y 100,Z 500,A 0,B 0,C 0}
BASE_DATA[3]={X 0,Y 0,Z 0,A 0,B 0,C 0}
BASE_DATA[4]={X 0,Y 0,Z 0,A 0,B 0,C 0}
DECL MACHINE_FRAME_T MACHINE_FRAME_DAT[32]
MACHINE_FRAME_DAT[4]={MACH_DEF_INDEX 2,PARENT[] "WORLD"}
DECL LOAD LOAD_DATA[16]
LOAD_DATA[1]={M 40.0,CM {X 0,Y 0,Z 0,A 0,B 0,C 0},J {X 0,Y 0,Z 0}}
DECL E6AXIS XHOME={A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}
DECL E6POS XCONF={X 7,Y 8,Z 9,A 0,B 0,C 0,S 2,T 2}
ENDDAT
"""
OLD = "FDAT_ACT=FP1\nLDAT_ACT=LCPDAT1\nBAS(#CP_PARAMS,2)\n"
NEW = (
    " WITH $VEL=SVEL_CP(2, , LCPDAT1), $TOOL=STOOL2(FP1), $BASE=SBASE(FP1.BASE_NO), "
    "$IPO_MODE=SIPO_MODE(FP1.IPO_FRAME), $LOAD=SLOAD(FP1.TOOL_NO), "
    "$ACC=SACC_CP(LCPDAT1), $ORI_TYPE=SORI_TYP(LCPDAT1), $APO=SAPO(LCPDAT1), "
    "$JERK=SJERK(LCPDAT1)"
)


def job(*lines, more="", data=DATA, start=None, config=CONFIG, others=()):
    text = "&ACCESS RVP\r\nDEF m ( )\n" + "\n".join(lines) + "\nEND\n" + more
    sources = [Source("m.src", text.encode())]
    sources.append(Source("m.dat", f"DEFDAT m PUBLIC\n{data}\nENDDAT\n".encode()))
    sources += [Source(f"{name}.src", text.encode()) for name, text in others]
    sources.append(Source("$config.dat", config.encode()))
    return Krl().read(sources, start or Start())


def names(found):
    v = found.visits
    return [v.target.names[k] for k in v.target.name.tolist()]


def origins(found):
    v = found.visits
    return [v.graph.predecessors(k).tolist() for k in range(len(v))]


def reasons(found):
    v = found.visits
    return [v.reasons[k].text for k in v.reason.tolist()]


def codes(found):
    return {d.code for d in found.diagnostics}


def frame(found, column, k=0):
    pose = found.visits.frame.poses[found.visits.columns[column][k]]
    return record_from_pose(pose[None])[0]


def test_points_by_name():
    found = job("PTP XP1", "LIN XP2", "PTP XA", "PTP {A1 1,A2 2,A3 3,A4 4,A5 5,A6 6}")
    v = found.visits
    assert reasons(found) == [""] * 4 and names(found) == ["xp1", "xp2", "xa", ""]
    assert v.target.meaning.tolist() == [Meaning.POSE] * 2 + [Meaning.JOINTS] * 2
    assert v.target.values[0].tolist() == [1, 2, 3, 0, 0, 180, 2, 35]
    assert v.target.values[1].tolist() == [4.5, -5, 6, 10, 20, 30, 2, 35]
    assert v.target.values[2].tolist() == [1, 2, 3, 4, 5, 6, 0, 0]
    assert origins(found) == [[START], [0], [1], [2]]
    assert np.isnan(v.target.aux).all() and v.target.config_given.tolist() == [
        True,
        False,
        False,
        False,
    ]
    data = f"DEFDAT m PUBLIC\n{DATA}\nENDDAT\n"
    own = v.literals.places
    start, end = own.start[v.target.literal[0]], own.end[v.target.literal[0]]
    cut = [data[a:b] for a, b in zip(start, end, strict=True)]
    assert cut == ["1", "2", "3", "0", "0", "180", "2", "35"]
    start, end = own.start[v.target.literal[1]], own.end[v.target.literal[1]]
    cut = [data[a:b] for a, b in zip(start, end, strict=True)]
    assert cut[-2:] == ["'B010'", "'H23'"] and cut[1] == "-5"


@pytest.mark.parametrize("line", [OLD + "LIN XP1 C_DIS", f"SLIN XP1{NEW} C_SPL"])
def test_inline_forms_old_and_modern(line):
    found = job(line, line, line.replace(" C_DIS", "").replace(" C_SPL", ""))
    assert reasons(found) == ["", "", ""]
    np.testing.assert_allclose(frame(found, "tool")[:3], [10, 20, 300])
    np.testing.assert_allclose(frame(found, "uframe"), [1000, 100, 500, 0, 0, 0])
    v = found.visits
    assert v.zone.size_mm[0] == 12.5 and v.motion.fly.tolist() == [True, True, False]
    np.testing.assert_allclose(v.speed.linear, 2.0)
    assert v.motion.orientation_law.tolist() == [OrientationLaw.ONE_AXIS] * 3


def test_inline_settings_hold_for_one_move():
    found = job(f"SLIN XP1{NEW}", "SLIN XP2")
    np.testing.assert_allclose(frame(found, "uframe", 1), 0.0)
    np.testing.assert_allclose(frame(found, "tool", 1), 0.0)


def test_frames_of_the_program():
    found = job(
        "$TOOL=TOOL_DATA[1]", "$BASE=BASE_DATA[2]", "LIN XP1",
        "$BASE=$BASE:{X 0,Y 0,Z 7,A 0,B 0,C 0}", "LIN XP1",
        "$BASE={FRAME: X 1,Y 2,Z 3,A 0,B 0,C 0}", "$TOOL=$NULLFRAME", "LIN XP1",
        "BAS(#TOOL,1)", "BAS(#BASE,0)", "LIN XP1",
    )  # fmt: skip
    assert reasons(found) == [""] * 4
    assert frame(found, "uframe", 1)[2] == pytest.approx(507.0)
    np.testing.assert_allclose(frame(found, "uframe", 2)[:3], [1, 2, 3])
    np.testing.assert_allclose(frame(found, "tool", 2), 0.0)
    np.testing.assert_allclose(frame(found, "tool", 3)[:3], [10, 20, 300])
    np.testing.assert_allclose(frame(found, "uframe", 3), 0.0)


def test_the_cell_says_what_holds_at_first():
    start = Start(tool=(1.0,) * 6, base=(2.0,) * 6, uframe=(3.0,) * 6)
    found = job("LIN XP1", start=start)
    assert [frame(found, name)[0] for name in ("tool", "base", "uframe")] == [1, 2, 3]


@pytest.mark.parametrize(
    ("lines", "why"),
    [
        (["FDAT_ACT=FOUT", "BAS(#FRAMES)", "LIN XP1"], ""),
        (["FDAT_ACT=FEX", "BAS(#FRAMES)", "LIN XP1"], "another axis"),
        (["$BASE=EK(MACHINE_DEF[2].ROOT,x,y)", "LIN XP1"], "another axis or arm (EK)"),
        (["$BASE=LK(a)", "LIN XP1"], "another axis or arm (LK)"),
        (["$BASE=BASE_DATA[N]", "N=N+1", "LIN XP1"], "when the program runs"),
        (["$BASE=BASE_DATA[9]", "LIN XP1"], "BASE_DATA[9]"),
        (["$BASE.X=I", "LIN XP1", "I=I+1"], "component"),
        (["$IPO_MODE=x", "LIN XP1"], "$IPO_MODE"),
        (["$ROBROOT={X 0,Y 0,Z 0,A 0,B 0,C 0}", "LIN XP1"], "$ROBROOT"),
        (["$SOFT_PLCL[1]=TRUE", "LIN XP1"], "soft"),
        (["PTP XLIN"], "without S and T"),
        (["PTP {X 1,Y 2,Z 3,A 0,B 0,C 0}"], "without S and T"),
        (["LIN {X 1,Y 2}"], "does not state all of its numbers"),
        (["LIN {Z 500,A 0,B 0,C 0}"], "does not state all of its numbers"),
        (["PTP {A1 5}"], "does not state all of its numbers"),
        (["LIN XA"], "joint angles"),
        (["PTP {X 1,Y 2,Z 3,A 0,B 0,C 0,S 18,T 2}"], "accuracy model"),
        (["LIN {X 1,Y 2,Z 3,A 0,B 0,C 0,S 22,T 2}"], "accuracy model"),
        (["PTP {X 1,Y 2,Z 3,A 0,B 0,C 0,S 99,T 2}"], "no valid number"),
        (["CIRC XP1,XP2,CA XP1.X+$POS_ACT.X"], "CA"),
        (["LIN XNOT"], "declared in none of the given files"),
        (["XP1.X=5", "LIN XP1"], "x set in line"),
        (["LIN XS[I]", "I=I+1"], "no value that is known"),
        (["other(XP1)", "LIN XP1"], "may be changed"),
        (["PTP INVERSE(XP1,XA,I)"], "run"),
        (["LIN XP1:{X I,Y 0,Z 0,A 0,B 0,C 0}", "I=I+1"], "run"),
        (["LIN XP2:{X 0,Y 0,Z 4+5,A 0,B 0,C 0}"], "no move goes to"),
        (["PTP_SPLINE", "SPTP XP1", "SPTP XP2", "ENDSPLINE"], "spline of joint"),
        (["SPLINE", "SPTP XP1", "ENDSPLINE"], "spline of joint"),
        (["SPL XP1"], "spline of joint"),
        (["$ORI_TYPE=#CONSTANT", "LIN XP1"], "#CONSTANT"),
        (["LIN XCONF"], ""),
    ],
)  # fmt: skip
def test_what_is_not_known_is_left(lines, why):
    found = job(*lines)
    given = [*reasons(found), *found.visits.literals.pinned]
    if not why:
        remote = found.visits.frame.tool_remote.tolist()
        assert True in remote or "all programs share" in given[-1]
    else:
        assert any(why in one for one in given)


@pytest.mark.parametrize(
    "lines",
    [
        ["BAS(#VEL_PTP,100)", "BAS(#ACC_PTP,20)", "$VEL.CP=0.2", "$ADVANCE=5"],
        ["$OUT[3]=TRUE", "WAIT SEC 0.5", "PULSE($OUT[1],TRUE,0.1)", "HALT"],
        [
            "GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )",
            "INTERRUPT ON 3",
        ],
        ["TRIGGER WHEN DISTANCE=0 DELAY=20 DO $OUT[1]=TRUE"],
        ["$ORI_TYPE=#CONSTANT", "$ORI_TYPE=#VAR"],
        ["I=N*2+ABS(N)", "EXT other(REAL :IN)", "$H_POS=XHOME", "CONTINUE"],
    ],
)
def test_what_is_known_does_no_harm(lines):
    found = job(*lines, "LIN XP1")
    assert reasons(found) == [""] and codes(found) == set()
    assert origins(found) == [[START]]


def test_speeds_and_blending():
    found = job(
        "BAS(#VEL_PTP,50)", "$VEL.CP=0.3", "$APO.CDIS=5", "$APO.CPTP=40",
        "PTP XP1 C_PTP", "PTP XP2 C_PTP C_DIS", "LIN XP1 C_DIS", "LIN XP2",
    )  # fmt: skip
    v = found.visits
    assert reasons(found) == [""] * 4
    assert v.motion.fly.tolist() == [True, True, True, False]
    assert v.zone.blend.tolist() == [Blend.OVERLAP, Blend.ZONE, Blend.ZONE, Blend.UNSET]
    assert v.zone.overlap_percent[0] == 40.0
    assert v.zone.size_mm[1:3].tolist() == [5.0, 5.0]
    assert v.speed.override.tolist() == [0.5, 0.5, 1.0, 1.0]
    np.testing.assert_allclose(v.speed.linear, 0.3)


def test_blending_of_inline_settings():
    """Both functions of bas.src take APO_DIST for it, whatever APO_MODE is."""
    line, joint = "$APO=SAPO(LCPDAT1)", "$APO=SAPO_PTP(PPDAT1)"
    found = job(
        f"SLIN XP1 WITH {line} C_SPL", f"SPTP XP2 WITH {joint} C_SPL", "SLIN XP1"
    )
    assert found.visits.zone.size_mm[:2].tolist() == [12.5, 50.0]
    assert reasons(found) == [""] * 3
    lost = job(f"SPTP XP2 WITH {joint} C_SPL", "SLIN XP1", "PPDAT1.APO_DIST=3")
    assert reasons(lost) == ["", ""] and lost.visits.zone.rule[0] == ZoneRule.UNKNOWN


@pytest.mark.parametrize(
    ("between", "fly"),
    [
        ("$VEL.CP=0.1", True),
        ("N2=5", True),
        ("WAIT SEC 1", False),
        ("$OUT[1]=TRUE", False),
        ("CONTINUE\n$OUT[1]=TRUE", True),
        ("IF $IN[1] THEN\nENDIF", False),
        ("TRIGGER WHEN DISTANCE=0 DELAY=0 DO $OUT[1]=TRUE", True),
        ("$FLAG[1]=TRUE", None),
        ("IF $IN[1] THEN\nWAIT SEC 1\nENDIF", False),
        ("IF N2 THEN\nWAIT SEC 1\nENDIF", None),
    ],
)
def test_what_stops_the_advance_run_ends_blending(between, fly):
    found = job("$APO.CDIS=5", "LIN XP1 C_DIS", between, "LIN XP2")
    if fly is None:
        assert reasons(found) == ["", ""]
        assert found.visits.zone.rule.tolist() == [ZoneRule.UNKNOWN, ZoneRule.UNSET]
    else:
        assert reasons(found) == ["", ""] and found.visits.motion.fly.tolist() == [
            fly,
            False,
        ]


@pytest.mark.parametrize("word", ["LIN XP1 C_DIS", "PTP XP1 C_PTP", "SLIN XP1 C_SPL"])
def test_a_distance_of_blending_that_is_not_known(word):
    found = job(word, "SLIN XP2" if "S" in word[0] else "LIN XP2")
    assert reasons(found) == ["", ""] and found.visits.motion.fly.tolist() == [
        True,
        False,
    ]
    assert found.visits.zone.rule[0] == ZoneRule.UNKNOWN


def test_planners_do_not_blend_into_each_other():
    found = job("$APO.CDIS=5", "LIN XP1 C_DIS", "SLIN XP2 C_DIS", "SLIN XP1")
    assert found.visits.motion.fly.tolist() == [False, True, False]
    found = job("$APO.CDIS=5", "LIN XP1 C_DIS")  # nothing stands behind it
    assert found.visits.motion.fly.tolist() == [False]
    found = job("$ADVANCE=0", "$APO.CDIS=5", "LIN XP1 C_DIS", "LIN XP2")
    assert found.visits.motion.fly.tolist() == [False, False]


def test_arcs():
    through = "$CIRC_MODE={AUX_PT {ORI #INTERPOLATE},TARGET_PT {ORI #INTERPOLATE}}"
    found = job(
        "CIRC XP1,XP2", "SCIRC XP1,XP2", through, "SCIRC XP1,XP2", "CIRC XP1,XP2"
    )
    v, law = found.visits, OrientationLaw
    assert v.motion.via.tolist() == [True, False] * 4
    known = [law.ALONG_PATH] * 4 + [law.ONE_AXIS] * 2 + [law.ALONG_PATH] * 2
    assert v.motion.orientation_law.tolist() == known


CIRCLES = {
    "not known": ([], "ALONG_PATH"),
    "set": (["$CIRC_TYPE=#BASE"], "START_TO_END"),
    "along the path": (["$CIRC_TYPE=#PATH"], "ALONG_PATH"),
    "of an unknown value": (["$CIRC_TYPE=#BASE", "$CIRC_TYPE=N"], "ALONG_PATH"),
    "of path data": (["LDAT_ACT=LCPDAT1", "BAS(#CP_DAT)"], "START_TO_END"),
    "of path data along it": (["LDAT_ACT=LPATH", "BAS(#CP_PARAMS,1)"], "ALONG_PATH"),
    "left out of path data": (["LDAT_ACT=LNONE", "BAS(#CP_DAT)"], "ALONG_PATH"),
    "of data that are not known": (
        ["LDAT_ACT=LCPDAT1", "LDAT_ACT.VEL=N", "BAS(#CP_DAT)"], "UNKNOWN"),
    "forgotten": (["$CIRC_TYPE=#BASE", "grip( )"], "UNKNOWN"),
    "the default of no file": (["$CIRC_TYPE=#BASE", "BAS(#INITMOV,0)"], "ALONG_PATH"),
}  # fmt: skip
LDATS = """
DECL LDAT LPATH={VEL 2,ACC 100,APO_DIST 5,ORI_TYP #VAR,CIRC_TYP #PATH}
DECL LDAT LNONE={VEL 2,ACC 100,APO_DIST 5,ORI_TYP #VAR}
"""


@pytest.mark.parametrize(("lines", "law"), CIRCLES.values(), ids=CIRCLES)
def test_how_the_tool_turns_on_arcs(lines, law):
    found = job(*lines, "CIRC XP1,XP2", data=DATA + LDATS)
    assert found.visits.motion.orientation_law.tolist() == [OrientationLaw[law]] * 2


@pytest.mark.parametrize("first", ["LDAT_ACT=LNONE\nBAS(#CP_DAT)", "BAS(#INITMOV,0)"])
def test_the_default_of_the_controller_for_arcs(first):
    config = CONFIG.replace("ENDDAT", "DECL CIRC_TYPE DEF_CIRC_TYP=#BASE\nENDDAT")
    found = job(first, "CIRC XP1,XP2", data=DATA + LDATS, config=config)
    law = OrientationLaw
    assert found.visits.motion.orientation_law.tolist() == [law.START_TO_END] * 2


def test_arcs_of_the_spline_planner_along_the_path():
    through = "$CIRC_MODE={AUX_PT {ORI #INTERPOLATE},TARGET_PT {ORI #INTERPOLATE}}"
    found = job(through, "$CIRC_TYPE=#PATH", "SCIRC XP1,XP2", "$CIRC_TYPE=#BASE",
                "SCIRC XP1,XP2", "SCIRC XP1,XP2 WITH $CIRC_TYPE=SCIRC_TYP(LPATH)",
                data=DATA + LDATS)  # fmt: skip
    law = OrientationLaw
    known = [law.ALONG_PATH] * 2 + [law.ONE_AXIS] * 2 + [law.ALONG_PATH] * 2
    assert found.visits.motion.orientation_law.tolist() == known


def test_a_submit_program_may_set_how_the_tool_turns_on_arcs():
    text = "DEF m ( )\n$CIRC_TYPE=#BASE\nCIRC XP1,XP2\nEND\n"
    sources = [Source("m.src", text.encode()),
               Source("m.dat", f"DEFDAT m\n{DATA}\nENDDAT\n".encode()),
               Source("sps.sub", b"DEF sps( )\n$CIRC_TYPE=#PATH\nEND\n")]  # fmt: skip
    found = Krl().read(sources, Start())
    assert (
        found.visits.motion.orientation_law.tolist() == [OrientationLaw.ALONG_PATH] * 2
    )


def test_orientation_joint_by_joint():
    found = job("LDAT_ACT=LJOINT", "FDAT_ACT=FP1", "BAS(#CP_PARAMS,1)", "LIN XP1")
    assert found.visits.motion.orientation_law.tolist() == [OrientationLaw.WRIST_JOINTS]
    assert found.visits.motion.wrist_joint.tolist() == [True]


def test_steps_hold_no_target():
    found = job(
        "LIN_REL {X 5,Z -1}", "LIN_REL {X 5} #TOOL", "PTP_REL {A1 10}",
        "SLIN_REL {Y 1}", "PTP_REL {X 5}", "LIN_REL {A 10}", "PTP $AXIS_INT",
    )  # fmt: skip
    assert found.visits.target.meaning.tolist() == [
        Meaning.RELATIVE_UFRAME, Meaning.RELATIVE_TOOL, Meaning.BY,
        Meaning.RELATIVE_UFRAME, *[Meaning.UNKNOWN] * 3,
    ]  # fmt: skip
    assert all("holds no target" in why for why in reasons(found))
    assert found.visits.target.values[0, :3].tolist() == [5, 0, -1]
    assert found.visits.target.values[2, :6].tolist() == [10, 0, 0, 0, 0, 0]


def test_missing_numbers_stay_what_they_were():
    found = job(
        "PTP {A1 5}", "LIN {Z 500}", "SLIN {X 1,Y 2,Z 3,E1 0}", "SPTP {A6 1,A2 -90}",
    )  # fmt: skip
    v, nan = found.visits, np.nan
    pose, joints = Meaning.PARTIAL_POSE, Meaning.PARTIAL_JOINTS
    assert v.target.literal.tolist() == [-1] * 4
    assert all("does not state all of its numbers" in why for why in reasons(found))
    assert v.target.meaning.tolist() == [joints, pose, pose, joints]
    numbers = [[5, *[nan] * 5], [nan, nan, 500, *[nan] * 3], [1, 2, 3, *[nan] * 3],
               [nan, -90, *[nan] * 3, 1]]  # fmt: skip
    assert np.array_equal(v.target.values[:, :6], numbers, equal_nan=True)


@pytest.mark.parametrize(
    "lines",
    [
        ["LIN {A 10}"], ["LIN {X 5,A 10}"], ["LIN {X 5,Y 1,Z 2,A 10}"], ["PTP {X 5}"],
        ["LIN {X 5,S 2}"], ["PTP {A1 5,X 2}"], ["LIN {E1 0}"], ["LIN XPART"],
        ["PTP XAPART"], ["CIRC {X 5},XP1"], ["CIRC XP1,{X 5}"],
        ["CIRC XP2,XP1,CA 90", "LIN {Z 5}"],
        ["CIRC XP2,XP1,CA 90", "PTP {A1 5}"],
        ["SPLINE", "SLIN {X 5}", "ENDSPLINE"],
        ["PTP_SPLINE", "SPTP {A1 5}", "ENDSPLINE"],
        ["BAS(#TOOL,N)", "N=N+1", "LIN {Z 5}"], ["BAS(#BASE,3)", "LIN {Z 5}"],
        ["$TOOL=$NULLFRAME", "LIN {Z 5}"], ["$IPO_MODE=#TCP", "LIN {Z 5}"],
        ["$ORI_TYPE=#CONSTANT", "LIN {Z 5}"], ["FDAT_ACT=FOUT", "BAS(#FRAMES)",
        "LIN {Z 5}"], ["IF $IN[1] THEN", "BAS(#BASE,3)", "LIN XP1", "ENDIF",
        "LIN {Z 5}"], ["SLIN {Z 5} WITH $BASE=BASE_DATA[3]"],
    ],
)  # fmt: skip
def test_where_missing_numbers_lead_is_not_always_known(lines):
    data = DATA + "DECL POS XPART={X 1,Y 2}\nDECL E6AXIS XAPART={A1 1}\n"
    found = job("FDAT_ACT=FP1", "BAS(#FRAMES)", "LIN XP1", *lines, data=data)
    goals = found.visits.target.meaning.tolist()
    assert {Meaning.PARTIAL_POSE, Meaning.PARTIAL_JOINTS}.isdisjoint(goals)
    assert Meaning.UNKNOWN in goals


def test_where_the_arm_is_holds_no_target():
    """It stays there, and reading that stops what is planned ahead."""
    found = job("$APO.CDIS=5", "LIN XP1 C_DIS", "LIN $POS_ACT", "PTP $AXIS_ACT")
    v = found.visits
    meanings = [Meaning.POSE, Meaning.RELATIVE_UFRAME, Meaning.BY]
    assert v.target.meaning.tolist() == meanings
    assert v.motion.fly.tolist() == [False] * 3 and not v.target.values[1:].any()
    assert all("stays where it is" in why for why in reasons(found)[1:])
    lines = ["CIRC XP1,$POS_ACT", "SPLINE", "SPL XP2", "SLIN $POS_ACT", "ENDSPLINE"]
    # where arc or block began
    goals = job("LIN XP1", *lines).visits.target.meaning.tolist()
    known, lost = Meaning.POSE, Meaning.UNKNOWN
    assert goals == [known, known, lost, known, lost]


def test_where_the_arm_was_is_not_where_it_is():
    """A point keeps the place where the arm was when it was given that place."""
    found = job("LIN XP1", "Q=$POS_ACT", "LIN XP2", "LIN Q", data=f"{DATA}DECL POS Q")
    meanings = [Meaning.POSE, Meaning.POSE, Meaning.UNKNOWN]
    assert found.visits.target.meaning.tolist() == meanings
    assert "known only when the program runs" in reasons(found)[2]


@pytest.mark.parametrize("name", ["I", "K"])
def test_an_element_by_reference_is_the_one_that_the_call_decides(name):
    """Its index may be changed before the routine moves to it."""
    data = f"{DATA}DECL POS ARR[2]\nDECL INT I\nDECL INT K\n"
    data += "".join(f"ARR[{k}]={{X {k},Y 0,Z 0,A 0,B 0,C 0}}\n" for k in (1, 2))
    more = f"DEF GO(P:OUT)\nDECL POS P\n{name}=2\nLIN P\nEND\n"
    target = job("I=1", "GO(ARR[I])", more=more, data=data).visits.target
    known = name != "I"
    assert target.meaning.tolist() == [Meaning.POSE if known else Meaning.UNKNOWN]
    assert not known or target.values[0, 0] == 1.0


def test_home_holds_no_target():
    v = job("PTP XHOME", "PTP HOME").visits
    assert v.target.meaning.tolist() == [Meaning.HOME] * 2
    assert v.target.literal.tolist() == [-1, -1]
    assert v.target.values[0, :6].tolist() == [0, -90, 90, 0, 0, 0]
    assert np.isnan(v.target.values[1]).all()


def test_a_remote_tool():
    found = job("FDAT_ACT=FOUT", "BAS(#FRAMES)", "LIN XP1")
    assert found.visits.frame.tool_remote.tolist() == [True]


def test_external_axes_count_where_they_are_not_0_or_the_arm_has_some():
    point = "LIN {X 1,Y 2,Z 3,A 0,B 0,C 0,E1 0,E2 12.5}"
    aux = job(point).visits.target.aux
    assert np.isnan(aux[0, 0]) and aux[0, 1] == 12.5 and aux.shape == (1, 2)
    aux = job(point, start=Start(aux={1: "track"})).visits.target.aux
    assert aux[0].tolist() == [0.0, 12.5]


def test_products_follow_their_point():
    found = job(
        "LIN XP1", "LIN XP1:{X 0,Y 0,Z 50,A 0,B 0,C 0}",
        "LIN XP2", "LIN {X 0,Y 0,Z 50,A 0,B 0,C 0}:XP2",
    )  # fmt: skip
    v = found.visits
    assert reasons(found) == [""] * 4
    literal, follows = v.target.literal.tolist(), v.target.follows.tolist()
    assert sorted(literal) == [0, 1, 2, 3]
    assert follows == [-1, literal[0], -1, literal[2]]
    np.testing.assert_allclose(v.target.values[1, :3], [1, 2, -47])  # XP1 looks down
    np.testing.assert_allclose(v.target.values[3, :3], [4.5, -5, 56])
    assert set(v.literals.pinned) == {""}
    assert v.target.values[1, 6:].tolist() == [-1, -1]
    assert v.target.values[3, 6:].tolist() == [2, 35]
    turned = job("LIN XP1", "LIN XP1:{X 0,Y 0,Z 5,A 4+5,B 0,C 0}").visits
    assert "turned" in turned.literals.pinned[0]


def test_points_that_must_keep_their_numbers():
    assert "otherwise" in job("LIN XP1", "N2=XP1.X").visits.literals.pinned[0]
    assert job("LIN XG").visits.literals.shared.tolist() == [True]
    taught = job("LIN XP1", start=Start(taught=["XP1"])).visits
    assert taught.literals.taught.tolist() == [True]
    for given in ("XQ=XP1", "XQ=XP1:{X 5,Y 0,Z 0,A 0,B 0,C 0}"):
        lines = "DECL E6POS XQ", given, "LIN XQ"
        taught = job(*lines, start=Start(taught=["XP1"])).visits
        assert taught.literals.taught.tolist() == [True]
        assert not job(*lines, start=Start(taught=["XP2"])).visits.literals.taught.any()


def test_branches_meet():
    found = job(
        "PTP XP1", "IF N2>1 THEN", "LIN XP2", "ELSE", "LIN XP1", "ENDIF", "LIN XP2"
    )
    assert origins(found) == [[START], [0], [0], [1, 2]]
    found = job(
        "PTP XP1", "SWITCH N2", "CASE 1,2", "LIN XP2", "DEFAULT", "LIN XP1",
        "ENDSWITCH", "LIN XP2",
    )  # fmt: skip
    assert origins(found) == [[START], [0], [0], [1, 2]]


def test_loops_and_jumps():
    found = job("WHILE N2", "LIN XP1", "LIN XP2", "ENDWHILE", "LIN XP1")
    assert origins(found) == [[START, 1], [0], [START, 1]]
    found = job("LOOP", "LIN XP1", "IF N2 THEN", "EXIT", "ENDIF", "LIN XP2", "ENDLOOP",
                "LIN XP1")  # fmt: skip
    assert origins(found) == [[START, 1], [0], [0]]
    found = job("REPEAT", "LIN XP1", "LIN XP2", "UNTIL N2==1", "LIN XP1")
    assert origins(found) == [[START, 1], [0], [1]]
    found = job("again:", "LIN XP1", "IF N2 THEN", "GOTO again", "ENDIF", "LIN XP2")
    assert origins(found) == [[START, 0], [0]]


def test_rounds_of_a_loop_are_told_apart():
    found = job("FOR I=3 TO 1 STEP -1", "LIN XS[I]", "ENDFOR")
    assert names(found) == ["xs[3]", "xs[2]", "xs[1]"]
    assert found.visits.target.values[:, 0].tolist() == [3.0, 2.0, 1.0]
    assert origins(found) == [[START], [0], [1]]
    assert len(job("FOR I=3 TO 1", "LIN XS[I]", "ENDFOR").visits) == 0
    found = job("FOR I=1 TO 3", "LIN XS[I]", "IF N2 THEN", "EXIT", "ENDIF", "ENDFOR",
                "LIN XP1")  # fmt: skip
    assert origins(found) == [[START], [0], [1], [0, 1, 2]]


def test_calls_are_followed():
    more = "DEF weld ( )\nLIN XP2\nEND\n"
    found = job("weld( )", "LIN XP1", "weld( )", more=more)
    assert names(found) == ["xp2", "xp1", "xp2"] and origins(found) == [
        [START],
        [0],
        [1],
    ]
    other = ("weld", "DEF weld ( )\nLIN XG\nLIN XP1\nEND\nDEF own ( )\nEND\n")
    found = job("weld( )", "own( )", others=[other])
    assert names(found) == ["xg", "xp1"] and "declared" in reasons(found)[1]
    assert "motion-unknown" in codes(found)  # own is another file's


@pytest.mark.parametrize("way", ["IN", "OUT"])
def test_a_point_that_is_handed_over(way):
    more = f"DEF weld (p:{way})\nE6POS p\nLIN p\nEND\n"
    found = job("weld(XP1)", "PTP XP1", more=more)
    assert reasons(found) == ["", ""]
    assert found.visits.target.literal.tolist() == [0, 0]


def test_a_point_that_a_routine_changes_keeps_its_numbers():
    more = "DEF weld (p:IN)\nE6POS p\np.Z=p.Z+5\nLIN p\nEND\n"
    found = job("weld(XP1)", "PTP XP1", more=more)
    assert found.visits.target.values[:, 2].tolist() == [8.0, 3.0]
    assert reasons(found) == ["", ""]
    assert found.visits.target.follows.tolist() == [0, -1]
    assert "used otherwise" in found.visits.literals.pinned[0]


def test_numbers_that_routines_get_and_change():
    more = "DEF next (k:OUT)\nINT k\nk=k+1\nEND\n"
    more += "DEF go (k:IN)\nINT k\nLIN XS[k]\nEND\n"
    found = job("N=1", "go(N)", "next(N)", "go(N)", "go(N+1)", more=more)
    assert found.visits.target.values[:, 0].tolist() == [1.0, 2.0, 3.0]


def test_a_routine_of_another_file_may_be_meant():
    other = "DEF other( )\nnext(N)\nEND\nDEF next(k:OUT)\nINT k\nk=3\nEND\n"
    more = "DEF next (k:IN)\nINT k\nEND\n"
    found = job("N=1", "next(N)", "LIN XS[N]", more=more, others=[("other", other)])
    assert found.visits.target.meaning[0] == Meaning.UNKNOWN


def test_what_may_move_forgets_where_the_arm_is():
    found = job("LIN XP1", "grip( )", "LIN XP2")
    assert origins(found)[1] == [ELSEWHERE] and "motion-unknown" in codes(found)
    found = job(
        "LIN XP1", "grip( )", "LIN XP2", start=Start(routines={"Grip": "motionless"})
    )
    assert origins(found) == [[START], [0]] and codes(found) == set()
    moves = Start(routines={"grip": "moves"}, motionless=("g*",))  # the name counts
    found = job("LIN XP1", "grip( )", "LIN XP2", start=moves)
    assert origins(found)[1] == [ELSEWHERE] and reasons(found) == ["", ""]


@pytest.mark.parametrize(
    "line", ["ASYPTP XP1", "N2=ours()", "?? x", "$NOBODY_KNOWS=1", "LINE XP1", "PTP"]
)
def test_statements_that_may_move_are_listed(line):
    found = job("LIN XP1", line, "LIN XP2")
    assert codes(found) & {"motion-unknown", "unknown-statement"}
    assert reasons(found)[-1] and origins(found)[-1] == [ELSEWHERE]


def test_interrupts_that_move_leave_everything():
    line = "INTERRUPT DECL 5 WHEN $IN[1]==TRUE DO stop_it( )"
    assert "interrupt" in reasons(job(line, "LIN XP1"))[0]
    moves, still = "DEF stop_it ( )\nLIN XP2\nEND", "DEF stop_it ( )\n$OUT[1]=TRUE\nEND"
    assert "interrupt" in reasons(job(line, "LIN XP1", more=moves))[0]
    assert reasons(job(line, "LIN XP1", more=still)) == [""]
    assert (
        "RESUME"
        in reasons(job(line, "LIN XP1", more=still.replace("$", "BRAKE\n$")))[0]
    )


def test_a_spline_block_is_a_curve_of_its_points():
    found = job(
        "$APO.CDIS=5", "SPTP XP1", "SPLINE WITH $VEL.CP=0.4", "SPL XP1",
        "SPL XP2 WITH $VEL.CP=0.2", "SLIN XP1", "SCIRC XP1,XP2", "ENDSPLINE C_SPL",
        "SLIN XP2", "SPLINE", "SPL XP1", "ENDSPLINE",
    )  # fmt: skip
    v = found.visits
    assert not any(reasons(found))
    assert v.motion.block.tolist() == [-1, 1, 1, 1, 1, 1, -1, 7]
    assert v.motion.curved.tolist() == [False, True, True, *[False] * 4, True]
    passed = ZoneRule.PASS
    assert v.zone.rule[1:4].tolist() == [passed] * 3
    assert v.motion.fly.tolist() == [False, *[True] * 5, False, False]
    assert v.zone.size_mm[5] == 5.0 and v.zone.rule[5] == ZoneRule.FROM
    assert v.speed.linear[1:6].tolist() == [0.4, 0.2, 0.4, 0.4, 0.4]


def test_where_a_spline_of_joint_moves_ends_is_known():
    """Its points are left; how the joints come to them is not known."""
    found = job("PTP_SPLINE", "SPTP XP1", "SPTP XP2", "ENDSPLINE", "SLIN XP1")
    v = found.visits
    assert v.target.meaning.tolist() == [Meaning.POSE] * 3 and origins(found)[2] == [1]
    assert ["spline of joint" in why for why in reasons(found)] == [True, True, False]
    assert v.motion.block.tolist() == [0, 0, -1]
    assert v.motion.curved.tolist() == [True, True, False]


@pytest.mark.parametrize(
    "line",
    ["TIME_BLOCK START", "TIME_BLOCK PART=40", "TIME_BLOCK END=2.5",
     "CONST_VEL START=+50", "CONST_VEL END=-50.5 ONSTART"],
)  # fmt: skip
def test_how_fast_a_spline_is_run_changes_nothing_of_it(line):
    found = job("SPTP XP1", "SPLINE", "SPL XP2", line, "SPL XP1", "ENDSPLINE")
    assert reasons(found) == [""] * 3 and codes(found) == set()


def test_a_frame_that_nobody_knows_is_told_so():
    found = job("SLIN XP1", "grip( )", "SLIN XP2", f"SLIN XP1{NEW}")
    assert "$TOOL and $BASE are not known here" in reasons(found)[1]
    assert reasons(found)[2] == ""


def test_dead_moves_are_listed():
    found = job("LIN XP1", "RETURN", "LIN XP2", more="DEF never ( )\nLIN XP1\nEND")
    assert "never-reached" in codes(found) and len(found.visits) == 1
    (told,) = (d.message for d in found.diagnostics if d.code == "never-reached")
    assert "or remove them" in told


@pytest.mark.parametrize(
    "line",
    ["INTERRUPT DECL 5 WHEN $IN[1] DO stopped ( )",
     "TRIGGER WHEN DISTANCE=0 DELAY=0 DO stopped ( ) PRIO=-1"],
)  # fmt: skip
def test_moves_that_an_interrupt_runs_are_not_to_be_removed(line):
    more = "DEF stopped ( )\nback ( )\nEND\nDEF back ( )\nLIN XP2\nEND\n"
    found = job(line, "LIN XP1", more=f"{more}DEF never ( )\nLIN XP1\nEND")
    told = [d.message for d in found.diagnostics if d.code == "never-reached"]
    assert len(told) == 2 and len(found.visits) == 1
    (run,) = (text for text in told if "an interrupt, a trigger" in text)
    (dead,) = (text for text in told if "remove" in text)
    assert "1 (lines" in run and "1 (lines" in dead and "remove" not in run


@pytest.mark.parametrize("lines", [["IF N2 THEN", "LIN XP1"], ["ENDLOOP"], ["LOOP"]])
def test_a_block_without_end_is_refused(lines):
    with pytest.raises(ProgramError, match=r"m\.src:\d+: "):
        job(*lines)


def test_the_controllers_own_accuracy_is_refused():
    with pytest.raises(ProgramError, match="compensates on its own"):
        job("$ABS_ACCUR=TRUE", "LIN XP1")
    assert reasons(job("$ABS_ACCUR=FALSE", "LIN XP1")) == [""]


@pytest.mark.parametrize(
    "more",
    ["DECL E6POS XP1={X 1,Y 2,Z 3,A 0,B 0,C 180,S 2,T 35}", "XS[2]={X 5}",
     "DECL E6AXIS XA={A1 1,A2 2,A3 3,A4 4,A5 5,A6 6}", "XP1={X 1}",
     "DECL FDAT FP1={TOOL_NO 1,BASE_NO 3}", "DECL LDAT LCPDAT1={VEL 1}"],
)  # fmt: skip
def test_a_point_with_two_values_in_a_list_is_refused(more):
    with pytest.raises(ProgramError, match=r"m\.dat:\d+: gives \w+ a second value"):
        job("LIN XP1", data=f"{DATA}{more}\n")
    assert reasons(job("LIN XP1", data=f"{DATA}INT N=4\nDECL E6POS XNEW\n")) == [""]


def test_a_number_with_two_values_in_a_list_is_not_known():
    assert reasons(job("LIN XS[N]")) == [""]
    assert reasons(job("LIN XS[N]", data=f"{DATA}INT n=2\n")) != [""]


def test_a_data_list_alone_is_refused():
    with pytest.raises(ProgramError, match="no routine"):
        Krl().read([Source("m.dat", b"DEFDAT m\nENDDAT\n")], Start())


def test_routines_that_call_themselves_are_not_followed():
    found = job("again( )", more="DEF again ( )\nLIN XP1\nagain( )\nEND")
    assert "motion-unknown" in codes(found)


def test_sides_of_axis_5_that_s_and_t_tell_otherwise():
    point = "PTP {{X 1,Y 2,Z 3,A 0,B 0,C 0,S {},T {}}}"
    lines = [point.format(2, 2), point.format(6, 18), point.format(6, 2)]
    assert [bool(why) for why in reasons(job(*lines))] == [False, False, True]
    lines = [point.format(6, 2), point.format(2, 18), point.format(2, 2)]
    assert [bool(why) for why in reasons(job(*lines))] == [False, False, True]


def test_flags_are_checked_on_joint_moves_alone():
    care = job("PTP XP1", "LIN XP1").visits.motion.care
    assert care[:, 0].tolist() == [Switch.ON, Switch.OFF]


@pytest.mark.parametrize("line", ['CREAD(H,S,M,T,O,"%r",XP2)', "CAST_FROM(B,O,XP2)"])
def test_what_is_read_into_a_point_changes_it(line):
    found = job(line, "PTP XP1", "LIN XP2")
    assert reasons(found)[0] == "" and "may be changed" in reasons(found)[1]


def test_numbers_of_other_data_stay():
    """Constants that a point is built from may serve other points too."""
    numbers = {"dx": 100.0, "dy": 200.0, "dz": 300.0, "da": 0.0, "db": 0.0, "dc": 180.0}
    data = "\n".join(f"DECL REAL {name}={value}" for name, value in numbers.items())
    lines = ["LIN {X dx,Y dy,Z dz,A da,B db,C dc}", "LIN {X dx,Y dy,Z 0,A 0,B 0,C 0}"]
    found = job(*OLD.split("\n"), *lines, data=f"{DATA}\n{data}").visits
    texts = {found.reasons[k].text for k in found.reason.tolist()}
    assert texts == {"the target is computed from other data"}
    assert found.target.literal.tolist() == [-1, -1]
    np.testing.assert_array_equal(found.target.values[0, :6], [*numbers.values()])
