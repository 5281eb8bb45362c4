"""What a program does, beyond the chapters of the corpus."""

import numpy as np
import pytest

from postproc.language.language import JobReading, Start
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.interpreter import resolve
from postproc.language.pdl2.machine import Machine
from postproc.language.pdl2.program import Program, parse
from postproc.language.text.source import source_from_bytes
from postproc.language.visits import (
    ELSEWHERE,
    START,
    Blend,
    OrientationLaw,
    Switch,
    ZoneRule,
)
from postproc.robot.pose import pose_from_record, record_from_pose


def program(text: str, name: str = "job") -> Program:
    return parse(source_from_bytes(f"{name}.pdl", text.encode("latin-1")))


def body(text: str, start: Start | None = None, declared: str = "") -> JobReading:
    return resolve(program(f"PROGRAM a\n{declared}\nBEGIN\n{text}\nEND a"), start)


def reasons(found: JobReading) -> list[str]:
    return [found.visits.reasons[i].text for i in found.visits.reason]


def test_pages_of_one_job_are_one_flow() -> None:
    main = program(
        "PROGRAM job\nIMPORT 'page1'\nIMPORT 'Page2.pdl'\n"
        "ROUTINE r2 EXPORTED FROM page2\nBEGIN\n"
        "MOVE JOINT TO {1,0,0,0,0,0}\nr1\nr2\nCALL page3\nEND job"
    )
    page = "PROGRAM {0}\n{1}\nBEGIN\nEND {0}"
    routine = "ROUTINE {0}\nBEGIN\nMOVE JOINT TO {{{1},0,0,0,0,0}}\nEND {0}"
    others = {
        "page1": program(page.format("page1", routine.format("r1", 2)), "page1"),
        "page2": program(page.format("page2", routine.format("r2", 3)), "page2"),
        "page3": program(
            "PROGRAM page3\nBEGIN\nMOVE JOINT TO {4,0,0,0,0,0}\nEND page3", "page3"
        ),
    }
    found = resolve(main, others=others)
    visits = found.visits
    assert visits.target.values[:, 0].tolist() == [1, 2, 3, 4]
    assert visits.graph.pred.tolist() == [START, 0, 1, 2]
    assert [visits.files[i] for i in visits.place.file] == [
        "job.pdl",
        "page1.pdl",
        "page2.pdl",
        "page3.pdl",
    ]
    assert visits.literals.file.tolist() == visits.place.file.tolist()
    assert found.diagnostics == ()
    assert main.imports == ("page1", "Page2.pdl")


def test_a_shared_frame_of_another_program_reaches_its_routines() -> None:
    main = program(
        "PROGRAM job\nVAR f : POSITION\nROUTINE r EXPORTED FROM lib\nBEGIN\n"
        "f := POS(1,2,3,0,0,0,'')\nr\nEND job"
    )
    lib = program(
        "PROGRAM lib\nVAR f : POSITION EXPORTED FROM job\nROUTINE r\nBEGIN\n"
        "$TOOL := f\nMOVE LINEAR TO POS(9,2,3,4,5,6,'')\nEND r\nBEGIN\nEND lib",
        "lib",
    )
    visits = resolve(main, others={"lib": lib}).visits
    wanted = pose_from_record(np.array([1.0, 2.0, 3.0, 0.0, 0.0, 0.0]))
    assert (visits.frame.poses[visits.frame.tool[0]] == wanted).all()


def test_frames_that_the_cell_does_not_know() -> None:
    found = body(
        "MOVE LINEAR TO POS(1,2,3,4,5,6,'')\nMOVE JOINT TO {1,2,3,4,5,6}",
        Start(uframe=None),
    )
    assert "$UFRAME" in reasons(found)[0]
    assert found.visits.target.literal.tolist() == [0, 1]
    assert reasons(found)[1] == ""
    assert found.visits.frame.uframe.tolist() == [-1, -1]


def test_settings_become_columns() -> None:
    found = body(
        "$LIN_SPD := 0.25\n$ROT_SPD := 1\n$ARM_SPD_OVR := 50\n$PROG_SPD_OVR := 50\n"
        "$FLY_TYPE := FLY_CART\n$FLY_DIST := 5\n$FLY_PER := 80\n$JNT_MTURN := FALSE\n"
        "$FLY_TRAJ := FLY_TOL\n"
        "$ORNT_TYPE := WRIST_JNT\n$TOOL_RMT := TRUE\n"
        "MOVEFLY LINEAR TO POS(1,2,3,4,5,6,'W') ADVANCE\n"
        "$FLY_DIST := -1\n$TOOL_RMT := OFF\n"
        "MOVE LINEAR TO POS(1,2,3,4,5,6) WITH $LIN_SPD = 0.1\n"
        "MOVE LINEAR TO POS(1,2,3,4,5,6)"
    )
    v = found.visits
    assert v.speed.linear.tolist() == [0.25, 0.1, 0.25]
    assert v.speed.override.tolist() == [0.25] * 3
    assert v.motion.fly.tolist() == [True, False, False]
    assert v.zone.size_mm.tolist() == [5, -1, -1]
    assert v.zone.overlap_percent.tolist() == [80] * 3
    assert (v.zone.blend == Blend.ZONE).all()
    assert (v.zone.rule == ZoneRule.WITHIN).all()
    assert v.motion.nearest_turn.all() and v.motion.wrist_joint.all()
    assert v.frame.tool_remote.tolist() == [True, False, False]
    assert v.target.config_given.tolist() == [True, False, False]
    assert [v.target.configs[i] for i in v.target.config] == ["W", "", ""]


def test_switches_and_orientation_types_are_told_from_what_is_not_known() -> None:
    move = "MOVE LINEAR TO POS(1,2,3,4,5,6,'W')\n"
    found = body(
        f"{move}$CNFG_CARE := TRUE\n$TURN_CARE := OFF\n$JNT_MTURN := $DIN[1]\n"
        f"$ORNT_TYPE := EUL_WORLD\n{move}"
        "MOVE LINEAR TO POS(1,2,3,4,5,6,'W') WITH $CNFG_CARE = FALSE\n"
        f"IF $DIN[2] THEN\n$TURN_CARE := TRUE\n$ORNT_TYPE := RS_WORLD\nENDIF\n{move}"
    )
    off, on, unset, unknown = Switch.OFF, Switch.ON, Switch.UNSET, Switch.UNKNOWN
    assert found.visits.motion.care.tolist() == [
        [unset] * 3, [on, off, unknown], [off, off, unknown], [on, unknown, unknown],
    ]  # fmt: skip
    euler, either = OrientationLaw.EULER_ANGLES, OrientationLaw.UNKNOWN
    assert found.visits.motion.orientation_law.tolist() == [
        OrientationLaw.UNSET,
        euler,
        euler,
        either,
    ]


def test_a_variable_used_twice_is_one_literal() -> None:
    found = body(
        "p := POS(1,2,3,4,5,6,'')\nMOVE LINEAR TO p\nMOVE JOINT TO {1,2,3,4,5,6}\n"
        "MOVE LINEAR TO p"
    )
    assert found.visits.target.literal.tolist() == [0, 1, 0]
    assert found.visits.literals.name == ("p", "")


def test_exported_and_taught_points_are_marked() -> None:
    declared = "VAR Px : POSITION EXPORTED FROM a\n  t : POSITION -- TAUGHT"
    found = body(
        "px := POS(1,2,3,4,5,6,'')\nt := POS(2,2,3,4,5,6,'')\n"
        "q := POS(3,2,3,4,5,6,'')\n"
        "MOVE LINEAR TO px\nMOVE LINEAR TO t\nMOVE LINEAR TO q",
        Start(taught=["Q"]),
        declared,
    )
    literals = found.visits.literals
    assert literals.name == ("Px", "t", "q")
    assert literals.shared.tolist() == [True, False, False]
    assert literals.taught.tolist() == [False, True, True]


def test_a_taught_frame_is_marked() -> None:
    found = body(
        "$UFRAME := POS(1,2,3,4,5,6,'') -- TAUGHT\nMOVE LINEAR TO POS(1,2,3,4,5,6,'')"
    )
    v = found.visits
    assert v.frame.taught[v.frame.uframe[0]]
    assert not v.frame.taught[v.frame.tool[0]]


@pytest.mark.parametrize(
    ("said", "origin"), [("motionless", 0), ("moves", -2), ("sets-frames", 0)]
)
def test_what_the_cell_says_of_outside_routines(said: str, origin: int) -> None:
    text = "MOVE LINEAR TO POS(1,2,3,4,5,6,'')\next\nMOVE LINEAR TO POS(2,2,3,4,5,6,'')"
    found = body(text, Start(routines={"Ext": said}))
    assert found.visits.graph.predecessors(1).tolist() == [origin]
    assert ("[frames.routines.ext]" in reasons(found)[1]) == (said == "sets-frames")
    assert found.diagnostics == ()


def test_each_routine_that_is_not_at_hand_is_listed_once() -> None:
    found = body("ext(1)\next(2)\nx := ext(3)\nother\nspot(1)\nspot(2)")
    lines = [(d.line, d.code) for d in found.diagnostics]
    assert lines == [
        (4, "unknown-routine"),
        (7, "unknown-routine"),
        (8, "routine-assumed-motionless"),
    ]


def test_a_loop_too_long_to_unroll_is_reported() -> None:
    found = body("FOR i := 1 TO 1000000 DO\nMOVE LINEAR TO POS(1,2,3,4,5,6,'')\nENDFOR")
    assert len(found.visits) == 1
    assert sorted(found.visits.graph.predecessors(0).tolist()) == [START, 0]
    assert "loop-not-unrolled" in {d.code for d in found.diagnostics}


@pytest.mark.parametrize(
    ("routine", "rounds"),
    [("ROUTINE r\nVAR i : INTEGER\nBEGIN\ni := 7\nEND r", 3),  # one of its own
     ("ROUTINE r\nBEGIN\ni := 7\nEND r", 1),
     ("ROUTINE r(n : INTEGER)\nBEGIN\nn := 7\nEND r", 1)],  # by reference
)  # fmt: skip
def test_a_loop_is_unrolled_unless_a_called_routine_changes_its_variable(
    routine: str, rounds: int
) -> None:
    call = "r(i)" if "(" in routine else "r"
    move = "MOVE LINEAR TO POS(1,2,3,4,5,6,'')"
    text = f"FOR i := 1 TO 3 DO\n{move}\n{call}\nENDFOR"
    found = body(text, declared=f"VAR i : INTEGER\n{routine}")
    assert len(found.visits) == rounds


@pytest.mark.parametrize(
    ("own", "shared", "rounds"),
    [("VAR i : INTEGER\n", "", 3),  # the other file changes its own
     ("VAR i : INTEGER EXPORTED FROM page\n", " EXPORTED FROM page", 1)],
)  # fmt: skip
def test_a_routine_of_another_file_may_change_the_variable_of_a_loop(
    own: str, shared: str, rounds: int
) -> None:
    main = program(
        f"PROGRAM a\n{own}ROUTINE r EXPORTED FROM page\nBEGIN\n"
        "FOR i := 1 TO 3 DO\nMOVE LINEAR TO POS(1,2,3,4,5,6,'')\nr\nENDFOR\nEND a"
    )
    page = program(
        f"PROGRAM page\nVAR i : INTEGER{shared}\n"
        "ROUTINE r\nBEGIN\ni := 7\nEND r\nBEGIN\nEND page", "page"
    )  # fmt: skip
    assert len(resolve(main, others={"page": page}).visits) == rounds


def test_a_loop_counts_its_own_variable_whatever_that_of_the_program_is() -> None:
    routines = (
        "VAR i : INTEGER\nROUTINE r\nBEGIN\ni := 7\nEND r\n"
        "ROUTINE s\nVAR i : INTEGER\nBEGIN\n"
        "FOR i := 1 TO 3 DO\nMOVE LINEAR TO POS(1,2,3,4,5,6,'')\nr\nENDFOR\nEND s"
    )
    assert len(body("s", declared=routines).visits) == 3


def test_a_move_in_a_call_inside_of_an_expression_is_reported() -> None:
    text = (
        "PROGRAM a\nROUTINE f : INTEGER\nBEGIN\nMOVE JOINT TO {1,2,3,4,5,6}\n"
        "RETURN (1)\nEND f\nBEGIN\nn := f()\nMOVE JOINT TO {1,2,3,4,5,6}\nEND a"
    )
    found = resolve(program(text))
    assert found.visits.graph.predecessors(0).tolist() == [-2]
    assert {d.code for d in found.diagnostics} == {"call-not-followed"}


def test_a_condition_handler_makes_what_it_changes_unknown() -> None:
    found = body(
        "p := POS(1,2,3,4,5,6,'')\nCONDITION[1] :\nWHEN $DIN[1] DO\n"
        "p := POS(2,2,3,4,5,6,'')\nENDCONDITION\nMOVE LINEAR TO p"
    )
    assert "handler" in reasons(found)[0]


def test_an_empty_program_has_no_visits() -> None:
    found = body("-- nothing")
    assert len(found.visits) == len(found.visits.literals) == 0
    assert found.visits.frame.poses.shape == (0, 4, 4)


def test_long_lines_and_many_variables() -> None:
    names = [f"point_{i:04d}" for i in range(3000)]
    declared = "VAR " + ", ".join(names[:30]) + " : POSITION"
    text = [f"{n} := POS({i}, 2, 3, 4, 5, 6, '')" for i, n in enumerate(names)]
    text += [f"MOVE LINEAR TO {n}{' ' * 430}-- note" for n in names]
    found = body("\n".join(text), declared=declared)
    assert len(found.visits.literals) == 3000
    assert found.visits.target.values[:, 0].tolist() == list(range(3000))


@pytest.mark.parametrize(
    "bounds", ["1 TO 1e400", "-1e400 TO 1", "1 TO 9 STEP 1e-320", "1 TO 9 STEP 0"]
)
def test_loops_without_a_number_of_rounds_are_followed_over_and_over(
    bounds: str,
) -> None:
    found = body(f"FOR i := {bounds} DO\nMOVE JOINT TO {{1,2,3,4,5,6}}\nENDFOR")
    assert found.visits.graph.predecessors(0).tolist() == [START, 0]


PLAIN = Start()


def frames_after(*lines: str, start: Start = PLAIN) -> list[list[float]]:
    """Return the user frame of every move, [] where it is not known."""
    text = "\n".join(["PROGRAM a", "VAR p : POSITION", "BEGIN", *lines, "END a", ""])
    source = source_from_bytes("a.pdl", text.encode())
    visits = resolve(parse(source), start).visits
    table = [*np.round(record_from_pose(visits.frame.poses), 9).tolist(), []]
    return [table[k] for k in visits.frame.uframe.tolist()]


MOVE = "MOVE LINEAR TO POS(1, 2, 3, 4, 5, 6, '')"
WHOLE = "$UFRAME := POS(1, 2, 3, 0, 90, 0, '')"


@pytest.mark.parametrize(
    ("line", "frame"),
    [
        ("$UFRAME.Z := 5", [1, 2, 5, 0, 90, 0]),
        ("$UFRAME.X += 10", [11, 2, 3, 0, 90, 0]),
        ("$UFRAME.A := $UFRAME.E - 10", [1, 2, 3, 80, 90, 0]),
        ("$ARM_DATA[1].UFRAME.Y := -4", [1, -4, 3, 0, 90, 0]),
        ("$ARM_DATA[2].UFRAME.Y := -4", [1, 2, 3, 0, 90, 0]),
        ("$ARM_DATA[n].UFRAME.Y := -4", []),
        ("$UFRAME.Z := $AIN[1]", []),
        ("READ lun ($UFRAME.Z)", []),
    ],
)
def test_a_part_of_a_frame_is_assigned(line: str, frame: list[float]) -> None:
    assert frames_after(WHOLE, MOVE, line, MOVE) == [[1, 2, 3, 0, 90, 0], frame]


CELL = (1.0, 2.0, 3.0, 0.0, 90.0, 0.0)
CHANGES = {
    "a part": ("$UFRAME.Z := 5", [1, 2, 5, 0, 90, 0]),
    "composed": ("$UFRAME := $UFRAME : POS(0, 0, 2, 0, 0, 0, '')", [3, 2, 3, 0, 90, 0]),
    "inverted": ("$UFRAME := POS_INV(POS_INV($UFRAME))", list(CELL)),
}


@pytest.mark.parametrize(("line", "frame"), CHANGES.values(), ids=CHANGES)
@pytest.mark.parametrize("taught", [True, False])
@pytest.mark.parametrize("before", [[], [WHOLE]], ids=["start", "written again"])
def test_what_comes_of_a_taught_frame_of_the_cell_was_taught(
    line: str, frame: list[float], taught: bool, before: list[str]
) -> None:
    cell = Start(uframe=CELL, taught_records=[CELL] if taught else [(0.0,) * 6])
    text = "\n".join(["PROGRAM a", "BEGIN", *before, line, MOVE, "END a", ""])
    frames = resolve(
        parse(source_from_bytes("a.pdl", text.encode())), cell
    ).visits.frame
    found = record_from_pose(frames.poses[frames.uframe])
    np.testing.assert_allclose(found, [frame], atol=1e-9)
    assert frames.taught[frames.uframe].tolist() == [taught]


def test_a_handler_may_assign_a_part_of_a_frame_at_any_time() -> None:
    handler = ["CONDITION[1] :", "WHEN $DIN[1]+ DO $UFRAME.Z := 5", "ENDCONDITION"]
    assert frames_after(*handler, WHOLE, "ENABLE CONDITION[1]", MOVE) == [[]]
    handler[1] = handler[1].replace("$UFRAME", "$ARM_DATA[1].UFRAME")
    assert frames_after(*handler, WHOLE, "ENABLE CONDITION[1]", MOVE) == [[]]


def test_a_handler_calls_a_routine_where_there_is_no_main_body() -> None:
    library = program(
        "PROGRAM a\nROUTINE go\nBEGIN\nMOVE JOINT TO {1,2,3,4,5,6}\nEND go\n"
        "ROUTINE arm\nBEGIN\nCONDITION[1] :\nWHEN $DIN[1]+ DO\ngo\nENDCONDITION\n"
        "ENABLE CONDITION[1]\nEND arm\n"
    )
    found = resolve(library)
    assert found.visits.place.line.tolist() == [4]
    assert {d.code for d in found.diagnostics} == {"handler-moves"}


def test_a_handler_that_moves_may_lead_the_arm_off_an_arc() -> None:
    arc = "MOVE CIRCULAR TO POS(3,2,3,4,5,6,'') VIA POS(2,3,3,4,5,6,'')\n"
    handler = (
        "CONDITION[1] :\nWHEN $DIN[1]+ DO\nMOVE JOINT TO {1,2,3,4,5,6}\nENDCONDITION\n"
        "ENABLE CONDITION[1]\n"
    )
    for text, elsewhere in ((arc, False), (handler + arc, True)):
        found = body("MOVE LINEAR TO POS(1,2,3,4,5,6,'')\n" + text)
        (via,) = np.flatnonzero(found.visits.motion.via)
        graph = found.visits.graph
        before = graph.pred[graph.pred_start[via + 1] : graph.pred_start[via + 2]]
        assert (ELSEWHERE in before.tolist()) == elsewhere


def test_calls_are_looked_for_in_statements_of_the_program_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They are remembered by the statement: one that is made on the way would be lost,
    and another one found in its place."""
    asked: list[object] = []
    find = Machine.find_calls

    def note(self, place, statement):
        asked.append(statement)
        own = place.program.lines.said
        lines = [own[k] for k in range(len(own))]
        parts = [getattr(one, "then", None) for one in lines]
        assert any(statement is one for one in (*lines, *parts))
        return find(self, place, statement)

    monkeypatch.setattr(Machine, "find_calls", note)
    found = resolve(program(
        "PROGRAM a\nROUTINE f : INTEGER\nBEGIN\nMOVE JOINT TO {1,2,3,4,5,6}\n"
        "RETURN (1)\nEND f\nBEGIN\nMOVE LINEAR TO POS(1,2,3,4,5,6,'')\n"
        "SELECT k OF\nCASE (1): n := 1\nCASE (f(2)): n := f(3)\nELSE: n := 4\n"
        "ENDSELECT\nMOVE LINEAR TO POS(2,2,3,4,5,6,'')\nEND a"
    ))  # fmt: skip
    moves = [one.trajectory for one in asked if isinstance(one, ast.Move)]
    assert set(moves) == {"JOINT"}  # that of f: no other one calls anything
    assert sorted(found.visits.graph.predecessors(2).tolist()) == [ELSEWHERE, 1]


def test_numbers_that_points_share_are_no_literal_of_any() -> None:
    """Two targets take X from one assignment, and the rest from two points."""
    found = body(
        "set\nsub(p1)\nsub(p2)\nMOVE LINEAR TO p2",
        declared="VAR p1, p2 : POSITION\n"
        "ROUTINE sub(v : POSITION)\nVAR w : POSITION\nBEGIN\n"
        "w := v\nw.X := 7\nMOVE LINEAR TO w\nEND sub\n"
        "ROUTINE set\nBEGIN\np1 := POS(1, 2, 3, 4, 5, 6, '')\n"
        "p2 := POS(2, 2, 3, 4, 5, 6, '')\nEND set",
    )
    assert found.visits.target.values[:, 0].tolist() == [7.0, 7.0, 2.0]
    assert found.visits.target.literal.tolist() == [-1, -1, -1]


PLACE = "POS(1, 2, 3, 0, 180, 0, '')"
MADE_FROM = {
    "it": "$UFRAME := fr",
    "a copy": "g := fr\n$UFRAME := g",
    "a shift": "$UFRAME := POS_SHIFT(fr, VEC(0, 0, 5))",
    "behind another": "$UFRAME := g : fr",
    "in front of another": "$UFRAME := fr : g",
    "its inverse": "$UFRAME := POS_INV(fr)",
    "its numbers": "$UFRAME := POS(fr.X, fr.Y + 1, 3, fr.A, fr.E, fr.R, '')",
    "a number": "g.X := fr.X\n$UFRAME := g",
    "a number, set": "$UFRAME := g\n$UFRAME.X := fr.X",
}
MARKS = {
    "by the cell": ("", {"fr"}),
    "by a comment": (" -- TAUGHT", set[str]()),
    "not": ("", {"other"}),
}


@pytest.mark.parametrize("lines", MADE_FROM.values(), ids=MADE_FROM)
@pytest.mark.parametrize("mark", MARKS)
def test_a_frame_that_is_made_from_a_taught_one_was_taught(
    lines: str, mark: str
) -> None:
    comment, listed = MARKS[mark]
    start = Start((0,) * 6, (0,) * 6, (0,) * 6, taught=frozenset(listed))
    text = f"fr := {PLACE}{comment}\ng := {PLACE}\n{lines}\nMOVE LINEAR TO {PLACE}"
    found = body(text, start, "VAR fr, g : POSITION")
    frames = found.visits.frame
    assert reasons(found) == [""]
    assert frames.taught[frames.uframe[0]] == (mark != "not")


@pytest.mark.parametrize("name", ["fr", "tab"])
def test_a_declared_frame_that_the_cell_lists_was_taught(name: str) -> None:
    start = Start((0,) * 6, (0,) * 6, (0,) * 6, taught=frozenset({name}))
    text = f"$UFRAME := fr\nMOVE LINEAR TO {PLACE}"
    found = body(text, start, f"VAR fr : POSITION ({PLACE})")
    frames = found.visits.frame
    assert frames.taught[frames.uframe[0]] == (name == "fr")
