"""Jobs in the style of archives: inline forms, technology calls, loads, handshakes."""

from __future__ import annotations

from postproc.diagnostics import Code
from tests.language.krl.test_interrupts import ARC
from tests.language.krl.test_visits import NEW, codes, job, reasons

INI = [
    ";FOLD INI;%{PE}", "GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )",
    "INTERRUPT ON 3", "BAS (#INITMOV,0 )", "USERSPOT(#INIT)",
    "USER_GRP(0,DUMMY,DUMMY,GDEFAULT)", ";ENDFOLD (INI)",
]  # fmt: skip
HOME = ["$BWDSTART=FALSE", "PDAT_ACT=PPDAT1", "FDAT_ACT=FP1", "BAS(#PTP_PARAMS,100)",
        "$H_POS=XHOME", "PTP XHOME"]  # fmt: skip


def ptp(point, blend=""):
    """Write an inline form of KSS 8."""
    return [
        f";FOLD PTP {point} CONT Vel=100 % PDAT1 Tool[1]:GRIPPER Base[2];%{{PE}}",
        "$BWDSTART = FALSE", "PDAT_ACT = PPDAT1", "FDAT_ACT = FP1",
        "BAS(#PTP_PARAMS, 100.0)", "SET_CD_PARAMS (0)", f"PTP {point} {blend}",
        ";ENDFOLD",
    ]  # fmt: skip


def lin(point, blend=""):
    """Write an inline form of KSS 8."""
    return [
        "$BWDSTART = FALSE", "LDAT_ACT = LCPDAT1", "FDAT_ACT = FP1",
        "BAS(#CP_PARAMS, 2.0)", "SET_CD_PARAMS (0)", f"LIN {point} {blend}",
    ]  # fmt: skip


def left(found):
    home = {k for k, name in enumerate(found.visits.target.names) if name in ("xhome",)}
    names = found.visits.target.name.tolist()
    why = reasons(found)
    return [w for w, name in zip(why, names, strict=True) if w and name not in home]


def test_handling_with_a_gripper():
    found = job(
        *INI, *HOME, "AC_ready = TRUE", "GRPg_SetStateAndCheck(1, 1, 0.2, 1)",
        "WAIT FOR ( NOT $IN[253] ) AND ( NOT $IN[254] )",
        "TRIGGER WHEN DISTANCE = 0 DELAY = 0 DO NUT_STAR=TRUE",
        *ptp("XP1"), *lin("XP2", "C_DIS C_DIS"), *ptp("XP1", "C_DIS"), *lin("XP2"),
        "GRPg_SetStateAndCheck(1, 2, 0.2, 1)", "GRPg_Check(1, 2, FALSE, 1)",
        "IF di004==TRUE THEN", "GOTO DRY", "ELSE", "WAIT FOR $IN[253]",
        "$OUT[18]=TRUE", "ENDIF", "DRY:", *lin("XP2"), *ptp("XP1"),
        "H50(GRP_APO,1,2,GCONT)", "P00 (#EXT_PGNO,#PGNO_ACKN,DMY[],0 )", *HOME,
    )  # fmt: skip
    assert left(found) == [] and codes(found) == {Code.ROUTINE_ASSUMED_MOTIONLESS}


def test_arc_welding_with_old_and_modern_forms():
    found = job(*INI, *HOME, *ptp("XP1"), *lin("XP2")[:-1], *ARC,
                f"SLIN XP1{NEW}", "ArcMainNG(#ArcOnBeforeSplSingle, WDAT1, WP1)",
                f"SLIN XP2{NEW}", *HOME)  # fmt: skip
    assert left(found) == [] and codes(found) == {Code.ROUTINE_ASSUMED_MOTIONLESS}


def test_a_load_that_changes_with_the_part():
    found = job(*INI, *ptp("XP1"), "$LOAD=LOAD_DATA[1]", "LIN XP2",
                "$LOAD={M 55,CM {X 0,Y 0,Z 9,A 0,B 0,C 0}}", "LIN XP1")  # fmt: skip
    assert left(found) == []
    assert found.visits.motion.loads[found.visits.motion.load][:, 0].tolist() == [
        40.0,
        40.0,
        55.0,
    ]
