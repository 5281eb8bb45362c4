"""What a RAPID task does: visits, where they come from, and what is left."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.compensation.program import read_program
from postproc.exceptions import ProgramError
from postproc.language.analysis.task_machine import follow
from postproc.language.language import Start
from postproc.language.rapid.interpreter import RapidMachine
from postproc.language.rapid.language import Rapid
from postproc.language.rapid.pose_encoding import (
    RAPID_DIALECT,
    quaternion_from_rotation,
    rotation_from_quaternion,
)
from postproc.language.text.source import Source
from postproc.language.visits import (
    ELSEWHERE,
    START,
    Meaning,
    OrientationLaw,
    ZoneRule,
)

END = "[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
DATA = f"""
  TASK PERS tooldata t:=[TRUE,[[10,20,300],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  TASK PERS wobjdata w:=[FALSE,TRUE,"",[[1000,0,500],[1,0,0,0]],[[0,100,0],[0,0,0,1]]];
  CONST robtarget p1:=[[1,2,3],[1,0,0,0],{END};
  CONST robtarget p2:=[[4,5,6],[0,1,0,0],{END};
  VAR robtarget list{{3}}:=[[[1,0,0],[1,0,0,0],{END},[[2,0,0],[1,0,0,0],{END},
    [[3,0,0],[1,0,0,0],{END}];
  CONST jointtarget j:=[[1,2,3,4,5,6],[9E9,9E9,9E9,9E9,9E9,9E9]];
"""
L = "MoveL {},v200,fine,t\\WObj:=w;"


def task(*lines, more="", data=DATA, start=None, others=()):
    text = f"MODULE m\n{data}\n{more}\nPROC main()\n" + "\n".join(lines)
    sources = [Source("m.mod", (text + "\nENDPROC\nENDMODULE\n").encode())]
    sources += [Source(f"o{k}.mod", o.encode()) for k, o in enumerate(others)]
    return Rapid().read(sources, start or Start())


def once(*lines, **given):
    """Read a job that ends, and does not begin again."""
    return task(*lines, "EXIT;", **given)


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


def test_frames_zone_and_speed_of_a_move():
    found = once(
        "MoveJ p1,v200,z10,t\\WObj:=w;", L.format("p2"), "MoveAbsJ j,v5,fine,t;"
    )
    v = found.visits
    assert reasons(found) == [""] * 3 and names(found) == ["p1", "p2", "j"]
    assert v.target.meaning.tolist() == [Meaning.POSE, Meaning.POSE, Meaning.JOINTS]
    tool, uframe = v.frame.poses[v.frame.tool[0]], v.frame.poses[v.frame.uframe[0]]
    np.testing.assert_allclose(tool[:3, :3], np.eye(3))
    np.testing.assert_allclose(tool[:3, 3], [0.01, 0.02, 0.3])
    np.testing.assert_allclose(uframe[:3, 3], [1, 0.1, 0.5])
    assert v.motion.fly.tolist() == [True, False, False] and v.zone.size_mm[0] == 10.0
    np.testing.assert_allclose(v.speed.linear, [0.2, 0.2, 0.005])
    assert origins(found) == [[START], [0], [1]]


@pytest.mark.parametrize(
    ("lines", "why"),
    [
        (["SoftAct 1,20;", L.format("p1")], "soft"),
        (["CorrCon id1;", L.format("p1")], "sensor"),
        (["SyncMoveOn a,b;", L.format("p1")], "another arm"),
        (["GripLoad part;", L.format("p1")], "GripLoad"),
        (["PDispOn p2,t;", L.format("p1")], "displacement"),
        (["EOffsSet e;", L.format("p1")], "external axes"),
        (["SoftAct 1,20;", "StorePath;", "PDispOff;", L.format("p1")], "soft"),
        (["other;", L.format("p1")], "displacement"),
        (["MoveL p1,v200,fine,unknown\\WObj:=w;"], "tool"),
        (["MoveL p1,v200,fine,t\\WObj:=nowhere;"], "nowhere"),
        (["MoveL p1\\ID:=10,v200,fine,t\\WObj:=w;"], "another arm"),
        (["SearchL di1,p2,p1,v20,t\\WObj:=w;"], "search"),
        (["MoveExtJ j,v5,fine;"], "external axes"),
        (["MoveL p1,v200,fine,t\\WObj:=w\\Corr;"], "sensor"),
        (["MoveL p1,v200,fine,t\\WObj:=w\\TLoad:=part;"], "TLoad"),
        (["ArcL p1,v200,sm,wd,fine,t\\WObj:=w\\Track:=tr;"], "sensor"),
        ([L.format("nobody")], "nobody"),
        (["p3.trans.x:=5;", L.format("p3")], "trans.x set in line"),
        ([L.format("list{n}")], "run"),
        (["MoveL Offs(p1,n,0,0),v200,fine,t\\WObj:=w;"], "run"),
        (["MoveL CRobT(),v200,fine,t\\WObj:=w;"], "run"),
        (["MoveL p1,v200,fine,t\\WObj:=moved;"], "mechanical unit"),
        (["MoveL Offs(p1,0,0,4+5),v200,fine,t\\WObj:=w;"], "no move goes to"),
    ],
)
def test_what_is_not_known_is_left(lines, why):
    more = f"""VAR num n;
      VAR robtarget p3:=[[1,2,3],[1,0,0,0],{END};
      PERS wobjdata moved:=[FALSE,FALSE,"STN1",[[0,0,0],[1,0,0,0]],
        [[0,0,0],[1,0,0,0]]];"""
    found = task(*lines, "n:=n+1;", more=more)
    assert why in reasons(found)[-1]


@pytest.mark.parametrize("name", ["p1", "P1", "t", "w"])
def test_data_that_are_declared_twice_are_not_known(name):
    of_type = {"t": "PERS tooldata", "w": "PERS wobjdata"}.get(name, "CONST robtarget")
    line = next(x for x in DATA.split("\n") if f"{of_type} {name.lower()}:=" in x)
    again = line.replace(f" {name.lower()}:=", f" {name}:=")
    assert reasons(once(L.format("p1")))[0] == ""
    assert reasons(once(L.format("p1"), more=again))[0]
    own = [again.replace("TASK PERS", "VAR").replace("CONST", "VAR")]
    assert reasons(once(*own, L.format("p1")))[0] == ""
    assert reasons(once(*own, *own, L.format("p1")))[0]


@pytest.mark.parametrize("zone", ["odd", "fine\\Z:=5", "z10\\Z:=n"])
def test_a_zone_that_is_not_known(zone):
    found = once(f"MoveL p1,v200,{zone},t\\WObj:=w;", L.format("p2"))
    assert reasons(found) == ["", ""] and found.visits.motion.fly.tolist() == [
        True,
        False,
    ]
    assert found.visits.zone.rule[0] == ZoneRule.UNKNOWN


@pytest.mark.parametrize("name", ["z10", "tool0"])
def test_a_parameter_hides_what_the_controller_knows(name):
    type_ = "zonedata" if name == "z10" else "PERS tooldata"
    zone, tool = (name, "t") if name == "z10" else ("fine", name)
    more = f"PROC go({type_} {name}) MoveL p1,v200,{zone},{tool}; ENDPROC"
    found = task("go fine;", more=more)
    if name == "z10":
        assert found.visits.zone.size_mm.tolist() != [10.0]
    else:
        assert reasons(found) != [""]


@pytest.mark.parametrize(
    ("call", "changes"),
    [
        ("n:=ReadNum(dev);", False),
        ("n:=VectMagn(v);", False),
        ("s:=ByteToStr(n\\Hex);", False),
        ("IF SocketGetStatus(c)=SOCKET_CONNECTED n:=1;", False),
        ('n:=UINumEntry(\\Header:="x");', False),
        ("n:=UINumEntry(\\InitValue:=p.trans.x);", True),
        ("ok:=TestAndSet(ok);", False),
        ("n:=nobody(1);", None),
    ],
)
def test_what_functions_of_the_controller_do(call, changes):
    """They do not move; None: that is no function of the controller."""
    point = f"VAR robtarget p:=[[1,2,3],[1,0,0,0],{END};"
    more = f"VAR num n; VAR bool ok; VAR string s; VAR pos v; {point}"
    first, second = reasons(task(call, L.format("p"), L.format("p1"), more=more))
    assert bool(first) == (changes is not False)
    assert bool(second) == (changes is None)


@pytest.mark.parametrize(
    ("lines", "more"),
    [
        (['ok:=StrToVal("x",p);', L.format("p")], ""),
        (['SetDataVal "p",p1;', L.format("p")], ""),
        (["IF n=1 SetAllDataVal \"robtarget\",p1;", L.format("p")], ""),
        (["FOR k FROM 1 TO n DO", L.format("list{k}"), "ENDFOR"], "CONST num k:=2;"),
        ([L.format("s.x")], "RECORD st robtarget y; robtarget x; ENDRECORD "
         f"PERS st s:=[[[1,2,3],[1,0,0,0],{END},[[4,5,6],[1,0,0,0],{END}];"),
    ],
)  # fmt: skip
def test_what_may_be_changed_unseen_is_left(lines, more):
    point = f"VAR robtarget p:=[[1,2,3],[1,0,0,0],{END};"
    found = task(*lines, "n:=n+1;", more=f"VAR num n; VAR bool ok; {more}{point}")
    assert "run" in reasons(found)[0]


def test_a_raised_error_goes_on_behind_the_call():
    more = """VAR num n; PERS pose d:=[[0,0,9],[1,0,0,0]];
      PROC sub() IF n>1 THEN PDispSet d; RAISE 5; ENDIF ENDPROC"""
    found = task("sub;", L.format("p1"), "PDispOff;", "ERROR", "TRYNEXT;", more=more)
    assert "displacement" in reasons(found)[0]


def test_nobody_knows_where_a_cleared_path_ends():
    found = task(L.format("p1"), "ClearPath;", "PDispOff;", L.format("p2"))
    assert origins(found)[1] == [ELSEWHERE]


def test_own_routines_hide_those_of_the_controller():
    body = L.format("p1")
    given = "SpotL p2;", "n:=max(1,2);", L.format("p2"), "n:=list{f(1)}.trans.x;"
    more = f"""VAR num n;
      PROC SpotL(robtarget p) {body} ENDPROC
      FUNC num max(num a,num b) {body} RETURN 1; ENDFUNC
      FUNC num f(num a) {body} RETURN 1; ENDFUNC"""
    found = task(*given, more=more)
    assert names(found) == ["p1", "p2"] and origins(found)[1] == [ELSEWHERE]
    said = [d.message for d in found.diagnostics if d.code == "motion-unknown"]
    assert len(said) == 2


def test_stop_point_data_stop():
    assert not task("MoveL p1,v200,z10\\Inpos:=inpos50,t;").visits.motion.fly[0]


@pytest.mark.parametrize(
    "lines",
    [
        ["SoftAct 1,20;", "SoftDeact;"],
        ["PDispOn p2,t;", "PDispOff;"],
        ["EOffsOn p2;", "EOffsOff;"],
        ["GripLoad part;", "GripLoad load0;"],
        ["ConfL\\Off;", "VelSet 50,1000;", "Set do1;", "WaitTime 1;", 'TPWrite "x";'],
    ],
)
def test_what_is_known_again_is_not(lines):
    assert reasons(task(*lines, L.format("p1"))) == [""]


def test_a_known_displacement_is_part_of_the_frame():
    found = task("PDispSet [[0,0,7],[1,0,0,0]];", L.format("p1"))
    assert reasons(found) == [""]
    assert found.visits.frame.poses[
        found.visits.frame.uframe[0], 2, 3
    ] == pytest.approx(0.507)


def test_lines_at_singularities_and_arcs():
    arc = f"MoveC p2,[[9,9,9],[1,0,0,0],{END},v200,fine,t\\WObj:=w;"
    found = once(
        L.format("p1"), arc, "CirPathMode\\CirPointOri;", arc, "SingArea\\Wrist;",
        L.format("p1"), "SingArea\\LockAxis4;", L.format("p1"),
    )  # fmt: skip
    law = OrientationLaw
    assert found.visits.motion.orientation_law.tolist() == [
        law.ONE_AXIS, law.ALONG_PATH, law.ALONG_PATH, law.ONE_AXIS, law.ONE_AXIS,
        law.WRIST_JOINTS, law.UNKNOWN,
    ]  # fmt: skip
    assert found.visits.motion.via.tolist() == [
        False,
        True,
        False,
        True,
        False,
        False,
        False,
    ]


def test_branches_meet():
    found = once(
        L.format("p1"), "IF a THEN", L.format("p2"), "ELSEIF b THEN", L.format("p1"),
        "ENDIF", L.format("p2"),
    )  # fmt: skip
    assert origins(found) == [[START], [0], [0], [0, 1, 2]]
    found = once(
        L.format("p1"), "TEST n", "CASE 1:", L.format("p2"), "DEFAULT:", L.format("p1"),
        "ENDTEST", L.format("p2"),
    )  # fmt: skip
    assert origins(found) == [[START], [0], [0], [1, 2]]


def test_loops_and_jumps():
    found = once(
        "WHILE a DO", L.format("p1"), L.format("p2"), "ENDWHILE", L.format("p1")
    )
    assert origins(found) == [[START, 1], [0], [START, 1]]
    found = once("again:", L.format("p1"), "IF a GOTO again;", L.format("p2"))
    assert origins(found) == [[START, 0], [0]]


def test_rounds_of_a_loop_are_told_apart():
    found = once("FOR i FROM 3 TO 1 STEP -1 DO", L.format("list{i}"), "ENDFOR")
    assert names(found) == ["list{3}", "list{2}", "list{1}"]
    assert found.visits.target.values[:, 0].tolist() == [3.0, 2.0, 1.0]
    assert origins(found) == [[START], [0], [1]]
    assert len(np.unique(found.visits.target.literal)) == 3


def test_an_element_is_known_where_others_are_not():
    more = f"CONST robtarget mixed{{2}}:=[[[9,0,0],[1,0,0,0],{END},elsewhere];"
    found = once(L.format("mixed{1}"), L.format("mixed{2}"), more=more)
    assert (found.visits.target.literal >= 0).tolist() == [True, False]
    assert found.visits.target.values[0, 0] == 9.0


def test_calls_are_followed_across_modules():
    other = f"MODULE o\nPROC weld()\n{L.format('p2')}\nENDPROC\nENDMODULE\n"
    found = once("weld;", L.format("p1"), "weld;", others=[other])
    assert names(found) == ["p2", "p1", "p2"] and origins(found) == [[START], [0], [1]]
    assert reasons(found) == [""] * 3
    assert found.visits.target.literal.tolist() == [1, 0, 1]


def test_a_routine_of_another_module_does_not_see_local_data():
    other = f"MODULE o\nPROC weld()\n{L.format('p2')}\nENDPROC\nENDMODULE\n"
    data = DATA.replace("CONST robtarget p2", "LOCAL CONST robtarget p2")
    assert "p2" in reasons(task("weld;", data=data, others=[other]))[0]


def test_what_may_move_forgets_where_the_arm_is():
    found = once(L.format("p1"), "grip;", "PDispOff;", L.format("p2"))
    assert origins(found)[1] == [ELSEWHERE] and "motion-unknown" in codes(found)
    still = Start(routines={"Grip": "motionless"})
    found = once(L.format("p1"), "grip;", L.format("p2"), start=still)
    assert origins(found) == [[START], [0]] and codes(found) == set()
    moves = Start(routines={"grip": "moves"}, motionless=("g*",))  # the name counts
    found = once(L.format("p1"), "grip;", L.format("p2"), start=moves)
    assert origins(found)[1] == [ELSEWHERE] and reasons(found) == ["", ""]


@pytest.mark.parametrize("line", ['%"weld"%;', "EGMMoveL p1;", "n:=ours();", "?? x;"])
def test_statements_that_may_move_are_listed(line):
    found = task(L.format("p1"), line, L.format("p2"))
    assert "motion-unknown" in codes(found) and reasons(found)[1]


def test_shifted_points_follow_theirs():
    found = task(
        L.format("p1"), "MoveL Offs(p1,0,0,50),v200,fine,t\\WObj:=w;",
        L.format("p2"), "MoveL RelTool(p2,0,0,50),v200,fine,t\\WObj:=w;",
    )  # fmt: skip
    v = found.visits
    literal, follows = v.target.literal.tolist(), v.target.follows.tolist()
    assert sorted(literal) == [0, 1, 2, 3]
    assert follows == [-1, literal[0], -1, literal[2]]
    assert v.target.values[1, :3].round(9).tolist() == [1, 2, 53]
    np.testing.assert_allclose(v.target.values[3, :3], [4, 5, -44])  # p2 looks down
    assert set(v.literals.pinned) == {""}


@pytest.mark.parametrize(
    ("lines", "more", "why"),
    [
        (["MoveL RelTool(p1,0,0,5\\Rz:=4+5),v200,fine,t\\WObj:=w;"], "", "turns it"),
        (["far:=Distance(p1.trans,p2.trans);"], "VAR num far;", "otherwise"),
        (['GetDataVal "p1",q;'], f"VAR robtarget q:=[[1,2,3],[1,0,0,0],{END};", "Get"),
        ([], f"CONST robtarget o_p1:=[[1,2,3],[1,0,0,0],{END};", "original"),
    ],
)
def test_points_that_must_keep_their_numbers(lines, more, why):
    found = task(L.format("p1"), *lines, more=more)
    assert why in found.visits.literals.pinned[0]


@pytest.mark.parametrize(
    ("goal", "more"),
    [
        (f"[[x,2,3],[1,0,0,0],{END}", "CONST num x:=1;"),
        (f"[p1.trans,p1.rot,{END}", ""),
        ("q", "CONST robtarget q:=p1;"),
        ("q", f"CONST pos a:=[1,2,3]; CONST robtarget q:=[a,[1,0,0,0],{END};"),
    ],
)
def test_points_built_from_other_data_keep_their_numbers(goal, more):
    found = task(L.format(goal), more=more)
    assert "other data" in reasons(found)[0] or "run" in reasons(found)[0]
    assert found.visits.target.literal.tolist() == [-1]


def test_external_axes_are_told():
    p = "[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,12.5,9E9,9E9,9E9,9E9]]"
    aux = task(L.format(p)).visits.target.aux
    assert np.isnan(aux[0, 0]) and aux[0, 1] == 12.5 and aux.shape == (1, 2)


def test_a_trap_that_moves_leaves_everything():
    trap = f"TRAP stop\n{L.format('p2')}\nENDTRAP"
    found = task(L.format("p1"), more=trap)
    assert "TRAP" in reasons(found)[0]
    (told,) = (d.message for d in found.diagnostics if d.code == "never-reached")
    assert "an interrupt" in told and "remove" not in told


def test_an_error_handler_that_moves_leaves_its_routine():
    found = task(L.format("p1"), "ERROR", L.format("p2"), "RETRY;")
    assert "error handler" in reasons(found)[0] and "never-reached" in codes(found)
    assert reasons(task(L.format("p1"), "ERROR", "RETRY;")) == [""]


def test_without_main_nothing_is_sure():
    text = f"MODULE m\n{DATA}\nPROC weld()\n{L.format('p1')}\nENDPROC\nENDMODULE\n"
    found = Rapid().read([Source("m.mod", text.encode())], Start())
    assert "no-main" in codes(found) and reasons(found)[0]


def test_a_block_without_end_is_refused():
    with pytest.raises(ProgramError, match=r"m\.mod:\d+: .*ENDIF"):
        task("IF a THEN", L.format("p1"))


def test_routines_that_call_themselves_are_not_followed():
    again = f"PROC again()\n{L.format('p1')}\nagain;\nENDPROC"
    assert "motion-unknown" in codes(task("again;", more=again))


# Numbers.


def test_quaternions_are_normalised_and_keep_their_sign():
    rng = np.random.default_rng(0)
    written = rng.normal(size=(200, 4))
    values = np.zeros((200, 11))
    values[:, 3:7] = written
    turned = RAPID_DIALECT.rotate(values, np.tile(np.eye(3), (200, 1, 1)))[:, 3:7]
    unit = written / np.linalg.norm(written, axis=1, keepdims=True)
    np.testing.assert_allclose(turned, unit, atol=1e-12)
    R = rotation_from_quaternion(written)
    np.testing.assert_allclose(
        R @ np.swapaxes(R, 1, 2), np.eye(3)[None] + 0 * R, atol=1e-12
    )
    again = rotation_from_quaternion(quaternion_from_rotation(R))
    np.testing.assert_allclose(again, R, atol=1e-12)


def test_quarter_turns_are_written_anew_where_they_are_left():
    values = np.zeros((4, 11))
    q = np.zeros((4, 6))
    q[:, 0] = np.deg2rad([89.0, 90.01, 90.5, -0.5])
    inside = np.full((4, 6), np.deg2rad(45.0))
    assert RAPID_DIALECT.rewrite_flags(values, q, inside)[:, 7].tolist() == [
        0,
        1,
        1,
        -1,
    ]
    assert RAPID_DIALECT.rewrite_flags(values, q, q)[:, 7].tolist() == [0, 0, 1, -1]
    assert RAPID_DIALECT.misses(values, q).tolist() == [False, False, True, True]


@pytest.mark.parametrize(
    ("cf", "slot", "turns"),
    [
        ([0, 0, 0, 0], 0, [0, 0]),
        ([0, 2, -3, 1], 4, [1, -1]),
        ([0, 1, -2, 6], 3, [0, 0]),
    ],
)
def test_confdata_as_slot_and_turns(cf, slot, turns):
    values = np.zeros((1, 11))
    values[0, 7:] = cf
    found = RAPID_DIALECT.flags(np.zeros(1, dtype=int), ("",), values)
    assert found[0].tolist() == [slot] and found[1][0, :2].tolist() == turns


def test_a_point_in_a_record_is_left_and_listed(bench_cell):
    point = "[[-605,876,1590],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
    text = f"""MODULE m
RECORD station
robtarget p;
num n;
ENDRECORD
CONST station s:=[{point},3];
PROC main()
MoveL s.p,v100,fine,tool0;
ENDPROC
ENDMODULE
"""
    visits = read_program({"m.mod": text.encode()}, bench_cell).visits
    assert visits.place.line.tolist() == [8] and visits.target.literal.tolist() == [-1]
    assert "known only when the program runs" in visits.reasons[visits.reason[0]].text


def taught(found):
    v = found.visits
    return [bool(v.literals.taught[k]) for k in v.target.literal.tolist()]


LINES = L.format("p1"), L.format("p2"), L.format("list{2}")


def test_what_was_taught_is_known_by_the_cell_or_a_comment():
    assert taught(task(*LINES)) == [False] * 3
    listed = Start(taught=("P2", "List"))
    assert taught(task(*LINES, start=listed)) == [False, True, True]
    marked = DATA.replace(f"[0,1,0,0],{END};", f"[0,1,0,0],{END};  ! TAUGHT in spring")
    assert taught(task(*LINES, data=marked)) == [False, True, False]
    inline = L.format(f"[[1,2,3],[1,0,0,0],{END}")
    assert taught(task(inline, inline + " ! taught", L.format("p1"))) == [0, 1, 0]


@pytest.mark.parametrize("given", ["q:=p1;", "q:=Offs(p1,0,0,5);", "r:=p1;q:=r;"])
@pytest.mark.parametrize("name", ["p1", "p2", "pos"])
def test_a_point_that_the_cell_lists_is_taught_by_any_name(given, name):
    data = DATA + "\nLOCAL VAR robtarget q; LOCAL VAR robtarget r;"
    listed = Start(taught=(name,))
    assert taught(task(given, L.format("q"), data=data, start=listed)) == [name == "p1"]
    copy = "q:=[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];r:=q;"
    listed = Start(taught=("q" if name == "p1" else name,))
    assert taught(task(copy, L.format("r"), data=data, start=listed)) == [name == "p1"]


def test_frames_that_were_taught():
    def frames(found):
        v = found.visits
        own = (v.frame.tool[0], v.frame.uframe[0])
        return tuple(bool(v.frame.taught[k]) for k in own)

    assert frames(task(L.format("p1"))) == (False, False)
    named = Start(taught=frozenset({"w"}))
    assert frames(task(L.format("p1"), start=named)) == (False, True)
    lines = DATA.splitlines()
    lines[1] += " ! TAUGHT"
    assert frames(task(L.format("p1"), data="\n".join(lines))) == (True, False)


SET_W2 = 'w2:=[FALSE,TRUE,"",[[0,0,5],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];'
COPIES = {
    "whole": "w2:=w;",
    "then changed": "w2:=w; w2.uframe.trans.x:=0;",
    "in part": 'w2:=[FALSE,TRUE,"",w.uframe,[[0,0,0],[1,0,0,0]]];',
    "a component": f"{SET_W2} w2.uframe:=w.uframe;",
}


@pytest.mark.parametrize("copy", COPIES.values(), ids=COPIES)
@pytest.mark.parametrize("by_cell", [True, False])
def test_a_frame_that_is_made_from_a_taught_one_was_taught(copy, by_cell):
    lines = DATA.splitlines()
    lines[2] += "" if by_cell else " ! TAUGHT"
    data = "\n".join([*lines, "LOCAL VAR wobjdata w2;"])
    start = Start(taught=frozenset({"w"} if by_cell else ()))
    go = L.format("p1").replace(":=w;", ":=w2;")
    found = task(copy, go, data=data, start=start)
    v = found.visits
    assert reasons(found) == [""] and v.frame.taught[v.frame.uframe[0]]
    own = task(SET_W2, go, data=data, start=start).visits
    assert not own.frame.taught[own.frame.uframe[0]]


@pytest.mark.parametrize("given", ["w.oframe", "d"])
@pytest.mark.parametrize("name", ["w", "d", "t"])
def test_a_displacement_that_was_taught_is_not_known(given, name):
    data = DATA + "\nCONST pose d:=[[0,0,7],[1,0,0,0]];"
    lines = f"PDispSet {given};", L.format("p1")
    found = task(*lines, data=data, start=Start(taught=frozenset({name})))
    assert bool(reasons(found)[0]) == (name == given[0])


def test_measured_moves_carry_their_ids():
    arc = f"MoveC p2,[[7,8,9],[1,0,0,0],{END},v200,fine,t\\WObj:=w;"
    found = task(
        "! MEASURE h1", L.format("p1"), L.format("p2"),
        L.format("p1") + " ! MEASURE h2", "! MEASURE h3", "x:=1;", arc, "! MEASURE h4",
    )  # fmt: skip
    assert found.visits.place.measure_id == ("h1", "", "h2", "", "h3")


SET = "PDispSet [[0,0,7],[1,0,0,0]];"


@pytest.mark.parametrize(
    ("last", "left"),
    [
        ([SET], True),
        ([SET, "PDispOff;"], False),
        (["PDispOn p2,t;"], True),
        (["SoftAct 1,20;"], True),
        (["SoftAct 1,20;", "SoftDeact;"], False),
        (["NotKnown;"], False),
    ],
)
def test_what_holds_at_the_end_of_main_may_hold_when_it_begins_again(last, left):
    found = task(L.format("p1"), L.format("p2"), *last)
    assert (reasons(found)[0] != "") is left
    behind = ELSEWHERE if last == ["NotKnown;"] else 1
    assert origins(found) == [sorted([START, behind]), [0]]


def test_a_move_of_external_axes_says_where_they_go():
    unused = "9E9,9E9,9E9,9E9,9E9"
    more = f"CONST jointtarget far:=[[9E9,{unused}],[500,{unused}]];\n"
    found = once("MoveExtJ far,vrot10,fine;", L.format("p1"), more=more)
    assert found.visits.target.aux[:, 0].tolist()[0] == 500.0


WOBJ = 'VAR wobjdata wv:=[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];'
SET = 'wv:=[FALSE,TRUE,"",[[100,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];'


def in_wobj(name):
    return L.format(name).replace(":=w;", ":=wv;")


def heights(found):
    v = found.visits
    return [v.frame.poses[k][2, 3] if k >= 0 else None for k in v.frame.uframe]


@pytest.mark.parametrize("kind", ["CONST", "PERS", "VAR"])
def test_data_that_are_given_those_of_the_controller(kind):
    own = (("zonedata z", "z20"), ("speeddata v", "v50"), ("tooldata flange", "tool0"))
    more = "\n".join(f"{kind} {name}:={value};" for name, value in own)
    found = once("MoveL p1,v,z,flange;", L.format("p2"), more=more)
    v = found.visits
    assert reasons(found) == ["", ""]
    assert (v.zone.size_mm[0], v.speed.linear[0]) == (20.0, 0.05)
    np.testing.assert_array_equal(v.frame.poses[v.frame.tool[0]], np.eye(4))


def test_data_of_the_program_hide_those_of_the_controller():
    own = "CONST zonedata z20:=[FALSE,7,15,15,1.5,15,1.5];"
    v = once("MoveL p1,v50,z20,t;", L.format("p2"), more=own).visits
    assert v.zone.size_mm.tolist()[0] == 7.0


def test_work_objects_and_tools_that_the_program_assigns_are_known():
    up = "wv.oframe.trans.z:=5;"
    found = task(SET, in_wobj("p1"), up, in_wobj("p2"), more=WOBJ)
    assert reasons(found) == ["", ""] and heights(found) == [0.0, 0.005]
    found = task(SET, "FOR i FROM 1 TO 2 DO", in_wobj("p1"), up, "ENDFOR", more=WOBJ)
    assert reasons(found) == ["", ""] and heights(found) == [0.0, 0.005]
    tool = "VAR tooldata tv:=[TRUE,[[0,0,0],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];"
    move = L.format("p1").replace(",t\\", ",tv\\")
    found = task("tv:=t;", "tv.tframe.trans.z:=77;", move, more=tool)
    assert reasons(found) == [""]
    assert found.visits.frame.poses[found.visits.frame.tool[0]][2, 3] == pytest.approx(
        0.077
    )


@pytest.mark.parametrize(
    "lines",
    [
        ["IF di1=1 THEN", "wv.oframe.trans.z:=5;", "ENDIF", "{}"],
        ["WHILE di1=1 DO", "{}", "wv.oframe.trans.z:=5;", "ENDWHILE"],
        ["wv.oframe.trans.z:=ReadNum(d);", "{}"],
        ["wv.oframe:=DefFrame(p1,p2,p3);", "{}"],
        ["IF di1=1 THEN", "change wv;", "ENDIF", "{}"],
        ["unknown_one;", "{}"],
    ],
)
def test_work_objects_that_only_the_run_tells_are_not(lines):
    """What is set on one way, read from outside, computed, or changed by a routine."""
    body = [line.format(in_wobj("p1")) for line in lines]
    change = "PROC change(INOUT wobjdata o)\no.oframe.trans.z:=9;\nENDPROC\n"
    found = task(
        SET, *body, in_wobj("p2"), more=WOBJ, others=[f"MODULE o\n{change}ENDMODULE\n"]
    )
    assert all(reasons(found))


def test_a_frame_that_differs_in_later_rounds_is_not_that_of_the_first():
    """Nothing of the move may keep what the first round has shown of it."""
    tool = "VAR tooldata tv;"
    move = L.format("p1").replace(",t\\", ",tv\\")
    other = "tv:=[TRUE,[[0,0,9],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];"
    found = task("tv:=t;", "WHILE di1=1 DO", move, other, "ENDWHILE", more=tool)
    assert found.visits.frame.tool.tolist() == [-1]
    assert "may be changed by the program" in reasons(found)[0]


def test_a_task_that_is_followed_again_reads_its_tools_anew():
    text = f"MODULE m\n{DATA}\nPROC main()\n{L.format('p1')}\nENDPROC\nENDMODULE\n"
    found = Rapid().parse([Source("m.mod", text.encode())], Start())
    first = follow(RapidMachine, found)
    for known in (found.frames, found.conditions):
        assert known
        known.update(dict.fromkeys(known, None))
    assert follow(RapidMachine, found).visits[0].tool == first.visits[0].tool


@pytest.mark.parametrize("k", ["k", "k1"])
def test_a_constant_that_a_loop_hides_tells_no_element(k):
    loop = (f"FOR {k} FROM 1 TO n DO", L.format(f"list{{{k}}}"), "ENDFOR")
    found = once(*loop, more=f"VAR num n;\nCONST num {k}:=1;")
    assert names(found) == ["list"] and all(reasons(found))
