"""Points that are set component by component or in loops: followed, not corrected.

The same numbers, written in the moves, tell where the arm goes, and what is written for
the moves beside them.
"""

from __future__ import annotations

import re

import numpy as np
import pytest

from postproc.compensation.outcome import Status
from postproc.language.visits import Meaning
from tests.compensation.shift_jobs import Shop, flags, inline, krl, rapid, six
from tests.compensation.test_assigned_points import EXACT_MM, go, numbers, spelt

NUMBER = re.compile(r"-?\d+\.?\d*(?:E[+-]?\d+)?")
NAMES = ("p1", "p2", "p3")
FURTHER = 12.5  # [mm] a place that is written beside that of P1


@pytest.fixture(scope="module")
def shop(job_cell, job_model):
    return Shop.of(job_cell, job_model)


def moved(text, **by):
    """Add to x, y or z of a place that is written out [mm]."""
    for name, value in by.items():
        found = re.search(rf"\b{name.upper()} (-?[\d.]+)", text)
        at = (
            found.span(1)
            if found
            else [*NUMBER.finditer(text)]["xyz".index(name)].span()
        )
        new = f"{float(text[slice(*at)]) + value:.6f}"
        text = text[: at[0]] + new + text[at[1] :]
    return text


def compare(done, twin, count):
    """Compare jobs that end with moves whose numbers stand in them, and the others."""
    v, w = done.visits, twin.visits
    assert len(v) == len(w)
    assert (v.target.meaning == w.target.meaning).all()
    assert np.nanmax(np.abs(v.target.values - w.target.values)[:, :6]) < 2e-6
    sides = (one.decisions.side[-count:] for one in (done, twin))
    assert np.array_equal(*sides)
    assert (done.decisions.status[-count:] == Status.CORRECTED).all()


# RAPID.

DATA = """VAR robtarget q;
VAR robtarget r;
VAR robtarget s{3};
VAR robtarget t2{2,2};
VAR num h;
VAR num n;
VAR signaldi di1;
VAR intnum i1;
PERS robtarget ks{2}:=[P2,P2];
CONST num c:=25;
CONST num heights{3}:=[10,20,30];"""
MORE = """FUNC robtarget above(num a)
RETURN Offs(p1,0,0,a+40);
ENDFUNC
FUNC robtarget raised(robtarget a,num b)
VAR robtarget o;
o:=a;
o.trans.z:=o.trans.z+b+60;
RETURN o;
ENDFUNC
PROC lifts()
q.trans.z:=q.trans.z+40;
ENDPROC"""
UP = {"z": 40.0}
CERTAIN = {
    "a component": (["q:=P1;", "q.trans.z:=q.trans.z+40;", go("q")], [UP]),
    "a number": (["q:=P1;", "q.trans.x:=X;", go("q")], [{"x": FURTHER}]),
    "of another point": (
        ["q:=P1;", "q.trans.z:=p1.trans.z-c;", go("q")], [{"z": -25.0}]),
    "of a copy": (["q:=P1;", "r:=q;", "r.trans.z:=r.trans.z+40;", go("r")], [UP]),
    "copied": (["q:=P1;", "q.trans.z:=q.trans.z+40;", "r:=q;", go("r")], [UP]),
    "twice": (
        ["q:=p1;", "q.trans.z:=q.trans.z+40;", go("q"), "q.trans.z:=q.trans.z-60;",
         go("q")], [UP, {"z": -20.0}]),
    "in a called routine": (["q:=P1;", "lifts;", go("q")], [UP]),
    "on both ways before them": (
        ["q:=P1;", "q.trans.z:=q.trans.z+40;", "IF di1=1 THEN", "h:=3;", "ENDIF",
         go("q")], [UP]),
    "place and rotation": (
        ["q:=P2;", "q.trans:=p1.trans;", "q.rot:=p1.rot;", "q.robconf:=p1.robconf;",
         go("q")], [{}]),
    "all of it": (
        ["q.trans:=p1.trans;", "q.rot:=p1.rot;", "q.robconf:=p1.robconf;",
         "q.extax:=p1.extax;", go("q")], [{}]),
    "shifted from itself": (["q:=P1;", "q:=Offs(q,0,0,40);", go("q")], [UP]),
    "an array in a loop": (
        ["FOR i FROM 1 TO 3 DO", "s{i}:=Offs(p1,0,0,i*20);", "ENDFOR",
         "FOR i FROM 1 TO 3 DO", go("s{i}"), "ENDFOR"],
        [{"z": 20.0}, UP, {"z": 60.0}]),
    "components of elements": (
        ["FOR i FROM 1 TO 3 DO", "s{i}:=p1;", "s{i}.trans.z:=s{i}.trans.z+i*20;",
         "ENDFOR", go("s{3}"), go("s{1}")], [{"z": 60.0}, {"z": 20.0}]),
    "of two dimensions": (
        ["FOR i FROM 1 TO 2 DO", "FOR j FROM 1 TO 2 DO",
         "t2{i,j}:=Offs(p1,0,0,10*i+j);", "ENDFOR", "ENDFOR", go("t2{2,1}")],
        [{"z": 21.0}]),
    "summed up in a loop": (
        ["q:=p1;", "FOR i FROM 1 TO 2 DO", "q.trans.z:=q.trans.z+20;", go("q"),
         "ENDFOR"], [{"z": 20.0}, UP]),
    "behind a loop that may be left": (
        ["FOR i FROM 1 TO 3 DO", "q:=Offs(p1,0,0,i*20);", "IF di1=1 GOTO out;",
         "ENDFOR", "out:", "q:=p1;", "q.trans.z:=q.trans.z+40;", go("q")], [UP]),
    "numbers that are set": (
        ["h:=20;", "h:=h+Abs(-20);", "q:=p1;", "q.trans.z:=q.trans.z+h;", go("q")],
        [UP]),
    "numbers of an array": (
        ["q:=p1;", "q.trans.z:=q.trans.z+heights{2};", go("q")], [{"z": 20.0}]),
    "what a function returns": ([go("above(5)")], [{"z": 45.0}]),
    "what a function sets": ([go("raised(p1,5)")], [{"z": 65.0}]),
    "what outlives the run": (
        ["ks{1}:=P1;", "ks{1}.trans.z:=ks{1}.trans.z+40;", go("ks{1}")], [UP]),
}  # fmt: skip


def rapid_done(shop, lines, more=""):
    points = {n.upper(): inline(shop.point(n), shop.job, n) for n in NAMES}
    further = numbers(points["P1"])[0] + FURTHER
    lines = [line.replace("X;", f"{further:.6f};") for line in spelt(lines, points)]
    source = rapid(shop, lines, more, "\n".join(spelt(DATA.split("\n"), points)))
    return lines, shop.compensate({"m.mod": source})


@pytest.mark.parametrize("kind", CERTAIN)
def test_a_certain_place_is_followed_and_its_numbers_stay(shop, kind):
    lines, places = CERTAIN[kind]
    behind = [go("P3"), go("P2")]
    own = inline(shop.point("p1"), shop.job, "p1")
    spelt_out = [go(moved(own, **by)) for by in places]
    written, done = rapid_done(shop, [*lines, *behind], MORE)
    _, twin = rapid_done(shop, [*spelt_out, *behind])
    compare(done, twin, 2)
    now, wanted = (one.outputs["m.mod"].decode().splitlines() for one in (done, twin))
    assert set(written[:-2]) <= set(now)
    d = done.decisions
    assert (d.status[2:-2] != Status.CORRECTED).all()
    codes = {d.reasons[k].code for k in d.why[2:-2].tolist()}
    assert codes <= {"computed-target", "numbers-not-own"}
    pair = [
        [numbers(line) for line in text if line.startswith("MoveL [[")][-2:]
        for text in (now, wanted)
    ]
    assert np.abs(np.subtract(*pair)).max() < EXACT_MM


SET = "q.trans.z:=900.0;"
UNCERTAIN = {
    "in one branch": ["q:=P1;", "IF di1=1 THEN", SET, "ENDIF", go("q")],
    "in a short if": ["q:=P1;", f"IF di1=1 {SET}", go("q")],
    "otherwise in another branch": [
        "q:=P1;", "IF di1=1 THEN", SET, "ELSE", "q.trans.z:=800.0;", "ENDIF", go("q")],
    "by a trap": ["CONNECT i1 WITH often;", "q:=P1;", "q.trans.x:=X;", go("q")],
    "from what a trap sets": [
        "CONNECT i1 WITH others;", "r:=P2;", "q:=P1;", "q.trans.z:=r.trans.z;",
        go("q")],
    "by a number that a trap sets": [
        "CONNECT i1 WITH counts;", "h:=5;", "q:=P1;", "q.trans.z:=q.trans.z+h;",
        go("q")],
    "by a handler": ["q:=P1;", "q.trans.x:=X;", "risky;", go("q")],
    "by a function": ["q:=P1;", "q.trans.x:=X;", "n:=change();", go("q")],
    "on the way": [
        "q:=P1;", "q.trans.x:=X;", 'MoveLSync p2,v200,z10,t\\WObj:=w,"alter";',
        go("q")],
    "by a parameter": ["q:=P1;", "turn q;", go("q")],
    "an element by a parameter": ["s{1}:=P1;", "turn s{1};", go("s{1}")],
    "in a loop that may go on": [
        "q:=P1;", "WHILE di1=1 DO", "q.trans.z:=q.trans.z+10;", "ENDWHILE", go("q")],
    "in a loop to any number": [
        "q:=P1;", "FOR i FROM 1 TO n DO", "q.trans.z:=q.trans.z+10;", "ENDFOR",
        go("q")],
    "a loop that may be left": [
        "FOR i FROM 1 TO 3 DO", "q:=P1;", "q.trans.z:=900+i;", "IF di1=1 GOTO out;",
        "ENDFOR", "out:", go("q")],
    "at any index": ["s{1}:=P1;", "s{n}:=P2;", go("s{1}")],
    "a component at any index": ["s{1}:=P1;", "s{n}.trans.z:=900.0;", go("s{1}")],
    "an element of any index": ["s{1}:=P1;", "s{2}:=P2;", go("s{n}")],
    "beyond the array": ["s{1}:=P1;", "s{4}:=P2;", go("s{1}")],
    "all of an array": ["s{1}:=P1;", "s:=[P2,P2,P2];", go("s{1}")],
    "a value of the run": ["q:=P1;", "q.trans.z:=GInput(di1);", go("q")],
    "a number of the run": [
        "h:=GInput(di1);", "q:=P1;", "q.trans.z:=h;", go("q")],
    "before all is set": ["q.trans:=p1.trans;", go("q"), go("P1")],
    "an unknown routine": ["q:=P1;", "q.trans.x:=X;", "mystery;", go("q")],
    "a search": [
        "q:=P1;", "q.trans.x:=X;", "SearchL di1,q,p2,v200,t\\WObj:=w;", go("q")],
    "a name in a string": [
        "q:=P1;", "q.trans.x:=X;", 'SetDataVal "q",p2;', go("q")],
    "no rotation": ["q:=P1;", "q.rot:=[0,0,0,0];", go("q")],
    "a function that reads an input": ["q:=P1;", go("q"), go("senses(q)")],
    "a shift by what only the run tells": [
        "h:=20;", "WHILE di1=1 DO", go("Offs(p1,0,0,h)"), "h:=h+1;", "ENDWHILE",
        go("P1"), go("Offs(p1,0,0,h)")],
}  # fmt: skip
BESIDE = """TRAP often
q.trans.z:=900;
ENDTRAP
TRAP others
r.trans.z:=900;
ENDTRAP
TRAP counts
h:=h+1;
ENDTRAP
PROC risky()
WaitDI di1,1\\MaxTime:=1;
ERROR
q.trans.z:=900;
TRYNEXT;
ENDPROC
FUNC num change()
q.trans.z:=900;
RETURN 1;
ENDFUNC
FUNC robtarget senses(robtarget a)
IF di1=1 RETURN p2;
RETURN a;
ENDFUNC
PROC alter()
q.trans.z:=900;
ENDPROC
PROC turn(INOUT robtarget a)
a.trans.z:=900;
ENDPROC"""


@pytest.mark.parametrize("kind", UNCERTAIN)
def test_what_is_not_certain_is_not_followed(shop, kind):
    lines, done = rapid_done(shop, UNCERTAIN[kind], BESIDE)
    v, d = done.visits, done.decisions
    last = -2 if kind == "before all is set" else -1
    assert v.target.meaning[last] == Meaning.UNKNOWN
    assert np.isnan(v.target.values[last]).all()
    assert d.status[last] != Status.CORRECTED
    if kind == "before all is set":
        return
    own = inline(shop.point("p1"), shop.job, "p1")
    now = done.outputs["m.mod"].decode().splitlines()
    held = [line for line in lines if own in line]
    assert held and set(held) - {go(own)} <= set(now)
    const = [one for one in now if one.startswith("CONST robtarget p1:=")]
    assert own in const[0]


def test_a_shift_in_a_move_is_corrected_where_its_point_was_shifted_before(shop):
    lines = ["q:=P1;", "q.trans.z:=q.trans.z+40;", go("Offs(q,0,0,-15)"), go("P3")]
    written, done = rapid_done(shop, lines, MORE)
    own = inline(shop.point("p1"), shop.job, "p1")
    _, twin = rapid_done(shop, [go(moved(own, z=25.0)), go("P3")])
    compare(done, twin, 2)
    now = done.outputs["m.mod"].decode().splitlines()
    assert {*written[:2]} <= {*now} and written[2] not in now
    assert done.decisions.status[-2] == Status.CORRECTED


def test_a_reason_names_the_component_and_its_line(shop):
    lines = ["q:=P1;", "q.trans.z:=700;", go("q")]
    _, done = rapid_done(shop, lines)
    d = done.decisions
    text = done.outputs["m.mod"].decode().splitlines()
    line = 1 + next(k for k, one in enumerate(text) if one.startswith("q.trans.z"))
    assert f"q: trans.z set in line {line - 1} of m.mod" in d.reasons[d.why[-1]].text


def test_a_value_is_corrected_where_its_moves_go_to_it_whole(shop):
    """Another value of the same point, which a component is set in, stays."""
    lines = ["q:=P1;", go("q"), "q:=P2;", "q.trans.x:=X;", go("q")]
    written, done = rapid_done(shop, lines)
    now = done.outputs["m.mod"].decode().splitlines()
    assert written[0] not in now and written[2] in now
    before, last = done.decisions.status[-2:].tolist()
    assert before == Status.CORRECTED and last != Status.CORRECTED


# KRL.

KRL_DATA = """DECL E6POS XQ
DECL E6POS XS[3]
DECL REAL PITCH=20.0
DECL INT N"""
KRL_MORE = """DEFFCT E6POS above(a:IN)
DECL REAL a
DECL E6POS o
o=Xp1
o.Z=o.Z+a+40
RETURN (o)
ENDFCT
DEF lifts()
XQ.Z=XQ.Z+40
END
DEF raises(a:OUT)
DECL E6POS a
a.Z=a.Z+40
END"""
LIFT = "XQ.Z=XQ.Z+40"
KRL_CERTAIN = {
    "a component": (["XQ=P1", LIFT, "LIN XQ"], [UP]),
    "a number": (["XQ=P1", "XQ.X=V", "LIN XQ"], [{"x": FURTHER}]),
    "a joint move": (["XQ=P1", LIFT, "PTP XQ"], [UP]),
    "of another point": (["XQ=P1", "XQ.Z=Xp1.Z-PITCH", "LIN XQ"], [{"z": -20.0}]),
    "copied": (["XQ=P1", LIFT, "q=XQ", "LIN q"], [UP]),
    "in a called routine": (["XQ=P1", "lifts()", "LIN XQ"], [UP]),
    "by a parameter": (["q=P1", "raises(q)", "LIN q"], [UP]),
    "linked with a frame": (
        ["q={X 0,Y 0,Z 40,A 0,B 0,C 0}:Xp1", "q.A=q.A", "LIN q"], [UP]),
    "a frame that is set": (
        ["SH={X 0,Y 0,Z 0,A 0,B 0,C 0}", "SH.Z=2*PITCH", "LIN SH:Xp1"], [UP]),
    "all of it": (
        [*(f"q.{n}=Xp1.{n}" for n in "XYZABC"), "q.E1=0", "LIN q"], [{}]),
    "an array in a loop": (
        ["FOR I=1 TO 3", "XS[I]=Xp1", "XS[I].Z=XS[I].Z+I*PITCH", "ENDFOR",
         "FOR I=3 TO 1 STEP -1", "LIN XS[I]", "ENDFOR"],
        [{"z": 60.0}, UP, {"z": 20.0}]),
    "behind a loop that is left": (
        ["LOOP", "IF $IN[1] THEN", "EXIT", "ENDIF", "q.Z=3", "ENDLOOP", "q=P1",
         "q.Z=q.Z+40", "LIN q"], [UP]),
    "on a circle": (
        ["R=80.0", "q=P1", "q.Z=q.Z+R*COS(60)", "LIN q"], [UP]),
    "what a function sets": (["LIN above(5)"], [{"z": 45.0}]),
}  # fmt: skip


def krl_done(shop, lines, more=""):
    points = {n.upper(): f"{{{six(shop.point(n))},{flags(shop, n)}}}" for n in NAMES}
    further = numbers(points["P1"])[0] + FURTHER
    lines = [re.sub("V$", f"{further:.6f}", line) for line in spelt(lines, points)]
    head = ["DEF own()", "DECL E6POS q", "DECL FRAME SH", "DECL INT I", "DECL REAL R"]
    text = "\n".join([*head, *lines, "END", *spelt(more.split("\n"), points)])
    files = krl(shop, ["own()"], text, KRL_DATA)
    done = shop.compensate(files)
    now = {name: done.outputs.get(name, old).decode() for name, old in files.items()}
    return lines, now["job.src"].splitlines(), done


@pytest.mark.parametrize("kind", KRL_CERTAIN)
def test_krl_follows_a_certain_place_and_keeps_its_numbers(shop, kind):
    lines, places = KRL_CERTAIN[kind]
    word = "PTP" if kind == "a joint move" else "LIN"
    behind = ["LIN P3", "LIN P2"]
    own = f"{{{six(shop.point('p1'))},{flags(shop, 'p1')}}}"
    spelt_out = [f"{word} {moved(own, **by)}" for by in places]
    written, now, done = krl_done(shop, [*lines, *behind], KRL_MORE)
    _, wanted, twin = krl_done(shop, [*spelt_out, *behind])
    compare(done, twin, 2)
    assert set(written[:-2]) <= set(now)
    d = done.decisions
    assert (d.status[2:-2] != Status.CORRECTED).all()
    codes = {d.reasons[k].code for k in d.why[2:-2].tolist()}
    assert codes <= {"computed-target", "numbers-not-own"}
    pair = [
        [numbers(line) for line in text if line.startswith("LIN {X")][-2:]
        for text in (now, wanted)
    ]
    assert np.abs(np.subtract(*pair)).max() < EXACT_MM


KRL_UNCERTAIN = {
    "in one branch": ["q=P1", "IF $IN[1] THEN", "q.Z=900.0", "ENDIF", "LIN q"],
    "in a switch": [
        "q=P1", "SWITCH N", "CASE 1", "q.Z=900.0", "DEFAULT", "q.Z=800.0",
        "ENDSWITCH", "LIN q"],
    "by an interrupt": [
        "INTERRUPT DECL 3 WHEN $IN[1] DO alter()", "INTERRUPT ON 3", "XQ=P1",
        "XQ.X=V", "LIN XQ"],
    "by a trigger": [
        "XQ=P1", "XQ.X=V", "TRIGGER WHEN DISTANCE=0 DELAY=0 DO alter() PRIO=-1",
        "LIN XQ"],
    "from what an interrupt sets": [
        "INTERRUPT DECL 3 WHEN $IN[1] DO alter()", "INTERRUPT ON 3", "XQ=P2", "q=P1",
        "q.Z=XQ.Z", "LIN q"],
    "by a number that an interrupt sets": [
        "INTERRUPT DECL 3 WHEN $IN[1] DO counts()", "INTERRUPT ON 3", "PITCH=5",
        "q=P1", "q.Z=q.Z+PITCH", "LIN q"],
    "by a function": ["XQ=P1", "XQ.X=V", "R=change()", "LIN XQ"],
    "an element by a parameter": ["XS[1]=P1", "turn(XS[1])", "LIN XS[1]"],
    "in a loop that may go on": [
        "q=P1", "WHILE $IN[1]", "q.Z=q.Z+10", "ENDWHILE", "LIN q"],
    "in a loop to any number": [
        "q=P1", "FOR I=1 TO N", "q.Z=q.Z+10", "ENDFOR", "LIN q"],
    "a loop that may be left": [
        "FOR I=1 TO 3", "q=P1", "q.Z=900+I", "IF $IN[1] THEN", "GOTO OUT_", "ENDIF",
        "ENDFOR", "OUT_:", "LIN q"],
    "its variable is set": [
        "FOR I=1 TO 3", "XS[I]=P1", "I=I+1", "ENDFOR", "LIN XS[2]"],
    "at any index": ["XS[1]=P1", "XS[N]=P2", "LIN XS[1]"],
    "a component at any index": ["XS[1]=P1", "XS[N].Z=900.0", "LIN XS[1]"],
    "an element of any index": ["XS[1]=P1", "XS[2]=P2", "LIN XS[N]"],
    "beyond the array": ["XS[1]=P1", "XS[4]=P2", "LIN XS[1]"],
    "a value of the run": ["q=P1", "q.Z=$POS_ACT.Z", "LIN q"],
    "divided": ["q=P1", "q.Z=q.Z/2", "LIN q"],
    "before all is set": ["q.X=900.0", "LIN q", "LIN P1"],
    "without an external axis": [
        *(f"q.{n}=Xp1.{n}" for n in "XYZABC"), "LIN q", "LIN P1"],
    "an unknown routine": ["XQ=P1", "XQ.X=V", "mystery()", "LIN XQ"],
    "a joint move without a status": [
        *(f"q.{n}=Xp1.{n}" for n in "XYZABC"), "PTP q", "LIN P1"],
    "no such component": ["q=P1", "q.E9=3", "LIN q"],
}  # fmt: skip
KRL_BESIDE = """DEF alter()
XQ.Z=900
END
DEF counts()
PITCH=PITCH+1
END
DEFFCT REAL change()
XQ.Z=900
RETURN 1.0
ENDFCT
DEF turn(a:OUT)
DECL E6POS a
a.Z=900
END
DEF sets()
N=$IN_GROUP
END"""


@pytest.mark.parametrize("kind", KRL_UNCERTAIN)
def test_krl_does_not_follow_what_is_not_certain(shop, kind):
    lines, now, done = krl_done(shop, KRL_UNCERTAIN[kind], KRL_BESIDE)
    v, d = done.visits, done.decisions
    last = -2 if lines[-1].startswith("LIN {") else -1
    assert v.target.meaning[last] == Meaning.UNKNOWN
    assert np.isnan(v.target.values[last]).all()
    assert d.status[last] != Status.CORRECTED
    own = f"{{{six(shop.point('p1'))},{flags(shop, 'p1')}}}"
    held = {line for line in lines if own in line and not line.startswith("LIN")}
    assert held <= set(now)
