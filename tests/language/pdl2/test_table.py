"""What can change a move: every row of the table, and every word of the language."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from postproc.language.language import Start
from postproc.language.pdl2.language import Pdl2
from postproc.language.text.grammars import grammar
from postproc.language.text.source import Source
from postproc.language.visits import ELSEWHERE, ZoneRule
from tests.language.pdl2.test_external_routines import (
    FIRST,
    followed,
    handler,
    reasons,
    routine,
)
from tests.language.pdl2.test_opaque_calls import program

PAGE = Path(__file__).parents[3] / "docs" / "pdl2.md"
AHEAD = "MOVE LINEAR TO POS(110, 400, 150, 0, 175, 0, '') ADVANCE"
LAST = "MOVE LINEAR TO POS(300, 300, 200, 0, 175, 0, '')"
RAISED, SAVED = "$UFRAME := POS(0, 0, n, 0, 0, 0, '')", ["VAR n : INTEGER (10)"]
VARS = ["VAR n : INTEGER", "VAR p : POSITION EXPORTED FROM other"]


def anywhere(*body, **more):
    """Return True if the last move may begin anywhere."""
    visits = followed(*body, **more).visits
    return ELSEWHERE in visits.graph.predecessors(len(visits) - 1)


def left(*body, **more):
    """Return True if the last move is left."""
    return bool(reasons(followed(*body, **more))[-1])


def mass(*body):
    visits = followed(*body).visits
    return visits.motion.loads[visits.motion.load[-1]][0]


CHECKS = {
    "`MOVE .. TIL`, `MOVEFLY .. TIL`": lambda: all(
        anywhere(FIRST, f"{line} TIL $DIN[1]+", LAST)
        for line in (LAST, LAST.replace("MOVE", "MOVEFLY"))),
    "`WAIT`, `DELAY`, `PAUSE`, `READ` behind a fly point": lambda: all(
        ZoneRule.UNKNOWN in
        followed(FIRST, LAST.replace("MOVE", "MOVEFLY"), line, FIRST).visits.zone.rule
        for line in ("WAIT FOR $DIN[1]", "DELAY 10", "PAUSE", "READ (n)")),
    "what may move the arm (a routine in no file, a statement that is not understood) "
    "behind a fly point": lambda: all(
        ZoneRule.UNKNOWN in
        followed(FIRST, LAST.replace("MOVE", "MOVEFLY"), line, FIRST).visits.zone.rule
        for line in ("dock", "CALL other", "FROBNICATE it WITH 3")),
    "a value that the program changes": lambda: (
        left(RAISED, "n := n + 1", LAST, head=SAVED)
        and not left(RAISED, "n := 10", LAST, head=SAVED)),
    "`CANCEL CURRENT`, `CANCEL ALL`": lambda: all(
        anywhere(FIRST, AHEAD, f"CANCEL {word}", LAST) for word in ("CURRENT", "ALL")),
    "`CANCEL .. FOR ARM[n]`": lambda: (
        anywhere(FIRST, AHEAD, "CANCEL ALL FOR ARM[1]", LAST)
        and not anywhere(FIRST, AHEAD, "CANCEL ALL FOR ARM[2]", LAST)),
    "`EXIT CYCLE`": lambda: ELSEWHERE in followed(
        "CYCLE", FIRST, AHEAD, "IF $DIN[1] THEN", "EXIT CYCLE", "ENDIF",
        LAST).visits.graph.predecessors(0),
    "`CANCEL`, `EXIT CYCLE` in a condition handler": lambda: (
        anywhere(*handler("CANCEL ALL"), FIRST, LAST)
        and anywhere(*handler("EXIT CYCLE"), "CYCLE", FIRST, LAST)),
    "a condition handler that moves": lambda: left(
        *handler("MOVE JOINT TO {1, 2, 3, 4, 5, 6}"), FIRST, LAST),
    "a condition handler that assigns": lambda: left(
        *handler("$TOOL := POS(1, 0, 0, 0, 0, 0, '')"), FIRST),
    "`ARM[n]`, `SYNCMOVE`": lambda: "other-arm" in {
        one.code
        for one in followed(FIRST, LAST.replace("MOVE", "MOVE ARM[2]")).diagnostics},
    "a routine in no file, `CALL`": lambda: (
        left("dock", LAST) and left("CALL other", LAST)
        and not left("dock", LAST, motionless=("dock",))),
    "a statement that is not understood": lambda: left("FROBNICATE it WITH 3", LAST),
    "`SENSOR_TRK`, `$SENSOR_ENBL`, `$CONV_ENBL`": lambda: all(
        left(line, LAST) for line in
        ("SENSOR_TRK(TRUE)", "$SENSOR_ENBL := TRUE", "$CONV_ENBL := TRUE")),
    "`$CAL_SYS`": lambda: left("$CAL_SYS[1] := 3", LAST),
    "`$TOOL_MASS`": lambda: (
        mass("$TOOL_MASS := 41", LAST) == 41.0
        and left("READ (n)", "$TOOL_MASS := n", LAST, head=["VAR n : INTEGER"])),
    "`$WEAVE_NUM`, `$WEAVE_TYPE`": lambda: (
        followed("$WEAVE_NUM := 1", LAST).visits.motion.weaves[0]
        and not left("$WEAVE_NUM := 1", LAST)),
    "`$TOOL_RMT`": lambda: (
        followed("$TOOL_RMT := TRUE", LAST).visits.frame.tool_remote[0]),
    "`READ`, `DECODE`": lambda: left("READ (n)", "MOVE LINEAR TO POS(n, 2, 3, 0, 180, "
                                     "0, '')", head=["VAR n : INTEGER"]),
    "exported variables": lambda: left("MOVE LINEAR TO p", head=VARS),
    "`CALL` of the program by another": lambda: all(called_by_another()),
}  # fmt: skip
# Words of statements that can do nothing of the table, and words inside of statements.
HARMLESS = """
    IF SELECT FOR WHILE REPEAT GOTO WAIT SIGNAL DELAY PAUSE HOLD LOCK UNLOCK RESUME
    ATTACH DETACH ACTIVATE DEACTIVATE PULSE BYPASS CYCLE ENABLE DISABLE PURGE OPEN CLOSE
    WRITE ENCODE RETURN
""".split()
INNER = """
    THEN ELSE ENDIF OF CASE ENDSELECT STEP DO ENDFOR ENDWHILE UNTIL WHEN CONDITION
    ENDCONDITION IN BY TO VIA AWAY NEAR ABOUT ALONG RELATIVE ADVANCE WITH SYNCMOVEFLY
    ENDMOVE FILE ENDOPEN SEGMENT
""".split()


def called_by_another():
    """Return why moves stay of a program that another one calls."""
    texts = {"job.pdl": program("job", [], [LAST]),
             "PROGRAMS/o.pdl": program("o", [], ["CALL job"])}  # fmt: skip
    sources = [Source(name, text.encode()) for name, text in texts.items()]
    v = Pdl2().read(sources, Start()).visits
    return [v.reasons[k].text for k in v.reason.tolist()]


def rows():
    text = PAGE.read_text(encoding="utf-8").partition("## What can change a move")[2]
    lines = [line for line in text.splitlines() if line.startswith("| ")][1:]
    return [line.strip("|").split(" | ")[0].strip() for line in lines]


def test_every_row_has_its_check():
    assert rows() == list(CHECKS)


@pytest.mark.parametrize("row", CHECKS)
def test_a_row_of_the_table_holds(row):
    assert CHECKS[row]()


def test_every_word_of_a_statement_is_in_the_table_or_can_do_nothing():
    begin, end = "// ---- control flow", "// ---- expressions"
    part = grammar("pdl2").partition(begin)[2].partition(end)[0]
    words = {*re.findall(r'"([A-Z]+)"i', part), "MOVE", "MOVEFLY", "READ", "DECODE"}
    table = {*re.findall(r"[A-Z_]+", " ".join(rows()))}
    assert len(words) > 60 and not words - table - {*HARMLESS, *INNER}
    assert not {*HARMLESS} & {*INNER}


HEAD = routine("f", "DELAY 1")


@pytest.mark.parametrize("line", [
    "WAIT FOR $DIN[1]", "SIGNAL sem", "DELAY 10", "PAUSE", "HOLD", "LOCK", "UNLOCK",
    "RESUME ARM[1]", "ATTACH ARM[1]", "DETACH", "ACTIVATE a", "DEACTIVATE a", "f",
    "PULSE $DOUT[1] FOR 200", "BYPASS ALL", "DISABLE CONDITION[1]", "CANCEL sem",
])  # fmt: skip
def test_what_can_do_nothing_leaves_nothing(line):
    body = (FIRST, AHEAD, line, LAST)
    assert not anywhere(*body, head=HEAD) and not left(*body, head=HEAD)
