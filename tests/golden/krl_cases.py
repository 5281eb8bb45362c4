"""Jobs in KRL of some lines: conditions, calls, lists, inline forms, refusals."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from tests.golden.case import Case

KUKA = {"cell.toml": "kuka/cell.toml", "model.json": "kuka/model.json"}
SETUP = "--cell cell.toml --model model.json"
COMPENSATE = f"compensate job.src {SETUP} -o out/job.src --report report.json"

LONG = 1000  # rounds of the large program
_POINTS = {
    "XPA": "X -111.6676,Y -764.1819,Z -59.9192,A 141.9888,B 53.8917,C -175.7776",
    "XPB": "X -188.5834,Y -1000.1209,Z -79.7095,A 158.4874,B 47.5205,C -158.8517",
    "XPC": "X -321.8462,Y -1210.5404,Z -131.9490,A 167.9530,B 35.7839,C -149.5460",
    "XPD": "X -144.2834,Y -528.8014,Z -58.2744,A 132.6875,B 50.3386,C 174.3255",
    "XPE": "X -130.0000,Y -820.0000,Z -40.0000,A 145.0000,B 52.0000,C -172.0000",
}
_REST = "S 2,T 34,E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0"
_DATA = [
    *(f"DECL E6POS {name}={{{place},{_REST}}}" for name, place in _POINTS.items()),
    "DECL E6POS XS[2]",
    *(f"XS[{k}]={{{_POINTS[name]},{_REST}}}" for k, name in ((1, "XPC"), (2, "XPE"))),
    "DECL FDAT FP1={TOOL_NO 3,BASE_NO 2,IPO_FRAME #BASE}",
    "DECL FDAT FTCP={TOOL_NO 3,BASE_NO 2,IPO_FRAME #TCP}",
    "DECL LDAT LCPDAT1={VEL 2.0,ACC 50.0,APO_DIST 5.0,APO_FAC 50.0,ORI_TYP #VAR}",
    "DECL PDAT PPDAT1={VEL 100.0,ACC 50.0,APO_DIST 20.0,APO_MODE #CDIS}",
]
_HOME = "A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 45.0,A6 0.0"
_CONFIG = [
    "DEFDAT $CONFIG",
    "DECL FRAME TOOL_DATA[16]",
    "TOOL_DATA[3]={X 152.300,Y 0.800,Z 411.700,A 0.0000,B -20.0000,C 0.0000}",
    "DECL FRAME BASE_DATA[32]",
    "BASE_DATA[2]={X 1762.400,Y 348.300,Z 810.500,A 12.5000,B 0.3500,C -0.2000}",
    "DECL LOAD LOAD_DATA[16]",
    "LOAD_DATA[3]={M 46.0,CM {X 62.0,Y 0.5,Z 214.0,A 0.0,B 0.0,C 0.0}}",
    "LOAD_DATA[4]={M 90.0,CM {X 62.0,Y 0.5,Z 214.0,A 0.0,B 0.0,C 0.0}}",
    f"DECL E6AXIS XHOME={{{_HOME}}}",
    "ENDDAT",
]
_SET = ["$TOOL=TOOL_DATA[3]", "$BASE=BASE_DATA[2]", "$VEL.CP=0.2", "$APO.CDIS=5"]
_START = [*_SET, "PTP XHOME"]
_OLD = ["LDAT_ACT=LCPDAT1", "FDAT_ACT=FP1", "BAS(#CP_PARAMS,0.2)"]
_FRAMES = (
    "$TOOL=STOOL2(FP1), $BASE=SBASE(FP1.BASE_NO), "
    "$IPO_MODE=SIPO_MODE(FP1.IPO_FRAME), $LOAD=SLOAD(FP1.TOOL_NO)"
)
_LINE = (
    f"WITH $VEL=SVEL_CP(0.2, , LCPDAT1), {_FRAMES}, $ACC=SACC_CP(LCPDAT1), "
    "$ORI_TYPE=SORI_TYP(LCPDAT1), $APO=SAPO(LCPDAT1), $JERK=SJERK(LCPDAT1)"
)
_JOINT = f"WITH $VEL_AXIS[1]=SVEL_JOINT(60), {_FRAMES}, $APO=SAPO_PTP(PPDAT1)"
_WELD = ["DEF weld( )", "LIN XPC", "LIN XPD", "END"]
_STOP = ["DEF stop_it( )", "$OUT[2]=TRUE", "END"]
_THROUGH = "{AUX_PT {ORI #INTERPOLATE},TARGET_PT {ORI #INTERPOLATE}}"

# Statements behind the move home; a list of lists: the routine, then others.
_PLAIN: Mapping[str, list[str]] = {
    "calls": ["PTP XPA", "weld( )", "LIN XPB", "weld( )", "END", *_WELD[:-1]],
    "calls-unknown": ["PTP XPA", "grip_it( )", "LIN XPB", "LIN XPC"],
    "calls-itself": ["PTP XPA", "again( )", "END", "DEF again( )", "LIN XPB",
                     "again( )"],
    "calls-parameter": ["PTP XPA", "go(XPB)", "LIN XPC", "END", "DEF go(P:IN)",
                        "E6POS P", "LIN P"],
    "functions": ["PTP XPA", "IF ready(1) THEN", "LIN XPB", "ENDIF", "LIN XPC", "END",
                  "DEFFCT BOOL ready(n:IN)", "INT n", "RETURN $IN[n]", "ENDFCT",
                  "DEF rest( )"],
    "if": ["PTP XPA", "IF $IN[1] THEN", "LIN XPB", "ELSE", "LIN XPC", "ENDIF",
           "LIN XPD", "LIN XPE"],
    "switch": ["PTP XPA", "SWITCH N", "CASE 1,2", "LIN XPB", "CASE 3", "LIN XPC",
               "DEFAULT", "LIN XPD", "ENDSWITCH", "LIN XPE"],
    "loops": ["PTP XPA", "WHILE $IN[1]", "LIN XPB", "LIN XPC", "ENDWHILE", "REPEAT",
              "LIN XPD", "UNTIL $IN[2]", "LIN XPE"],
    "endless": ["PTP XPA", "LOOP", "LIN XPB", "IF $IN[3] THEN", "EXIT", "ENDIF",
                "LIN XPC", "ENDLOOP", "LIN XPD"],
    "for": ["PTP XPA", "FOR I=1 TO 2", "LIN XS[I]", "LIN XPB", "ENDFOR", "LIN XPD"],
    "goto": ["PTP XPA", "again:", "LIN XPB", "IF $IN[1] THEN", "GOTO again", "ENDIF",
             "LIN XPC"],
    "halt": ["PTP XPA", "LIN XPB C_DIS", "WAIT SEC 0.5", "LIN XPC C_DIS", "HALT",
             "LIN XPD C_DIS", "$OUT[1]=TRUE", "LIN XPE"],
    "return": ["PTP XPA", "IF $IN[1] THEN", "RETURN", "ENDIF", "LIN XPB", "RETURN",
               "LIN XPC"],
    "interrupt-still": ["INTERRUPT DECL 5 WHEN $IN[1]==TRUE DO stop_it( )",
                        "INTERRUPT ON 5", "PTP XPA", "LIN XPB", "END", *_STOP[:-1]],
    "interrupt-moves": ["INTERRUPT DECL 5 WHEN $IN[1]==TRUE DO weld( )",
                        "INTERRUPT ON 5", "PTP XPA", "LIN XPB", "END", *_WELD[:-1]],
    "interrupt-brake": ["INTERRUPT DECL 5 WHEN $IN[1]==TRUE DO stop_it( )",
                        "PTP XPA", "LIN XPB", "END", "DEF stop_it( )", "BRAKE",
                        "RESUME"],
    "trigger": ["PTP XPA", "TRIGGER WHEN DISTANCE=0 DELAY=20 DO $OUT[1]=TRUE",
                "LIN XPB", "TRIGGER WHEN PATH=-20 DELAY=0 DO stop_it( ) PRIO=-1",
                "LIN XPC", "END", *_STOP[:-1]],
    "arcs": ["PTP XPA", "LIN XPB", "CIRC XPC,XPD", f"$CIRC_MODE={_THROUGH}",
             "SCIRC XPC,XPB"],
    "arc-angle": ["PTP XPA", "LIN XPB", "CIRC XPC,XPD,CA 60", "LIN XPE"],
    "arc-unknown": ["PTP XPA", "LIN XPB", "CIRC XPC,XPD,CA W", "LIN XPE"],
    "spline": ["SPTP XPA", "SPLINE WITH $VEL.CP=0.1", "SPL XPB", "SPL XPC", "SLIN XPD",
               "ENDSPLINE", "SLIN XPE"],
    "relative": ["PTP XPA", "LIN XPB", "LIN_REL {X 5,Z -1}", "LIN XPC",
                 "LIN_REL {Z 20} #TOOL", "PTP_REL {A1 2}", "PTP XPA"],
    "partial": ["PTP XPA", "LIN XPB", "LIN {Z -60}", "LIN {X -170,Y -990}", "LIN XPC"],
    "products": ["PTP XPA", "LIN XPB", "LIN {X 0,Y 0,Z 30,A 0,B 0,C 0}:XPB",
                 "LIN XPC", "LIN XPC:{X 0,Y 0,Z 5,A 9,B 0,C 0}"],
    "aggregates": [f"PTP {{{_POINTS['XPA']},S 2,T 34}}", f"LIN {{{_POINTS['XPB']}}}",
                   "PTP {A1 0.0,A2 -80.0,A3 95.0,A4 -10.0,A5 50.0,A6 -10.0}",
                   "PTP {A1 5}", "PTP $AXIS_ACT"],
    "blends": ["$APO.CPTP=40", "PTP XPA C_PTP", "PTP XPE C_PTP C_DIS", "LIN XPB C_DIS",
               "LIN XPC C_DIS", "SLIN XPD C_SPL", "SLIN XPE"],
    "frames": ["PTP XPA", "$BASE=$BASE:{X 0,Y 0,Z 7,A 0,B 0,C 0}", "LIN XPB",
               "$BASE=BASE_DATA[2]", "LIN XPC", "BAS(#TOOL,3)", "BAS(#BASE,2)",
               "LIN XPD", "$BASE.X=5", "LIN XPE"],
    "external-base": ["PTP XPA", "$BASE=EK(MACHINE_DEF[2].ROOT,A,B)", "LIN XPB"],
    "remote-tool": ["FDAT_ACT=FTCP", "BAS(#FRAMES)", "PTP XPA", "LIN XPB"],
    "load": ["PTP XPA", "$LOAD=LOAD_DATA[3]", "LIN XPB", "$LOAD=LOAD_DATA[4]",
             "LIN XPC", "$LOAD=LOAD_DATA[3]", "LIN XPD"],
    "written-point": ["PTP XPA", "XPB.Z=20", "LIN XPB", "XPC=XPD", "LIN XPC",
                      "N=XPD.X", "LIN XPD"],
    "orientation": ["PTP XPA", "$ORI_TYPE=#CONSTANT", "LIN XPB", "$ORI_TYPE=#JOINT",
                    "LIN XPC", "$ORI_TYPE=#VAR", "LIN XPD"],
    "unknown-statement": ["PTP XPA", "?? what", "LIN XPB", "ASYPTP XPC", "LIN XPD",
                          "$NOBODY=1", "LIN XPE"],
    "never-reached": ["PTP XPA", "LIN XPB", "END", *_WELD[:-1]],
}  # fmt: skip
_INLINE: Mapping[str, list[str]] = {
    "old": ["BAS(#INITMOV,0)", "PDAT_ACT=PPDAT1", "FDAT_ACT=FP1",
            "BAS(#PTP_PARAMS,60)", "PTP XPA", *_OLD, "LIN XPB C_DIS", *_OLD,
            "LIN XPC C_DIS", *_OLD, "LIN XPD"],
    "modern": ["BAS(#INITMOV,0)", f"SPTP XPA {_JOINT}", f"SLIN XPB {_LINE} C_SPL",
               f"SLIN XPC {_LINE} C_SPL", f"SLIN XPD {_LINE}"],
    "initial": ["BAS(#INITMOV,0)", "PTP XPA", "LIN XPB"],
}  # fmt: skip


def _text(lines: list[str]) -> bytes:
    head = ["&ACCESS RVP", "&REL 4"]
    return "\r\n".join([*head, *lines, ""]).encode()


def job(lines: list[str], **more: bytes) -> dict[str, bytes]:
    """Return the files of a job: its source, its data list, and $config.dat."""
    return {
        "job.src": _text(["DEF job( )", *lines, "END"]),
        "job.dat": _text(["DEFDAT job", *_DATA, "ENDDAT"]),
        "$config.dat": _text(_CONFIG),
        **more,
    }


def krl() -> Iterator[Case]:
    """Jobs that are compensated, and jobs that are refused."""
    for group, start in ((_PLAIN, _START), (_INLINE, ["PTP XHOME"])):
        for name, lines in group.items():
            files = job([*start, *lines])
            yield Case(f"krl/{name}", (COMPENSATE,), KUKA, files, quick=True)
    after = (f"explain job.src {SETUP}", "diff job.src out/job.src")
    back = "restore out/job.src -o back/job.src"
    files = job([*_START, *_PLAIN["calls"]])
    yield Case("krl/commands", (COMPENSATE, *after, back), KUKA, files, quick=True)
    inline = [f"LIN {{{place}}}" for place in _POINTS.values()][:4]
    yield Case(
        "krl/large", (COMPENSATE,), KUKA, job([*_START, "PTP XPA", *inline * LONG])
    )
    yield from _refused()


def _refused() -> Iterator[Case]:
    """Bad input: the message, and exit code 2."""
    some = ["PTP XPA", "LIN XPB"]
    alone = f"compensate job.dat {SETUP} -o out/job.dat"
    bad = {
        "accuracy": job([*_START, "$ABS_ACCUR=TRUE", *some]),
        "block": job([*_START, "IF $IN[1] THEN", *some]),
        "string": job([*_START, 'N="abc', *some]),
    }
    for name, files in bad.items():
        yield Case(f"krl/refused-{name}", (COMPENSATE,), KUKA, files, quick=True)
    yield Case("krl/refused-list", (alone,), KUKA, job([*_START, *some]), quick=True)
    again = f"compensate out/job.src {SETUP} -o back/job.src"
    files = job([*_START, *some])
    yield Case("krl/refused-again", (COMPENSATE, again), KUKA, files, quick=True)
