"""Points that assignments change: followed where they are certain, else left."""

from __future__ import annotations

import re

import numpy as np
import pytest

from postproc.compensation.options import Options
from tests.compensation.shift_jobs import (
    Shop,
    flags,
    inline,
    krl,
    rapid,
    six,
)
from tests.compensation.test_rapid_shifts import END

EXACT_MM = 2.5e-3
TARGET = re.compile(r"\[\[[^\[\]]*\],\[[^\[\]]*\],\[[^\[\]]*\],\[[^\[\]]*\]\]")
AGGREGATE = re.compile(r"\{X [^{}]*\}")


@pytest.fixture(scope="module")
def shop(job_cell, job_model):
    return Shop.of(job_cell, job_model)


@pytest.fixture(scope="module")
def rapid_points(shop):
    """Numbers of p1, p2, p3 as they are written in a move."""
    return {n.upper(): inline(shop.point(n), shop.job, n) for n in ("p1", "p2", "p3")}


@pytest.fixture(scope="module")
def krl_points(shop):
    return {
        n.upper(): f"{{{six(shop.point(n))},{flags(shop, n)}}}"
        for n in ("p1", "p2", "p3")
    }


def spelt(lines, points):
    """Write P1, P2 and P3 in capitals as numbers."""
    text = "\n".join(lines)
    return re.sub(r"\bP[123]\b", lambda m: points[m[0]], text).split("\n")


def numbers(text):
    return np.array([float(x) for x in re.findall(r"-?\d+\.\d+", text)][:3])


def compensated(shop, lines, points, more="", data=""):
    """Return the numbers of all targets of a RAPID job in the order of its text."""
    more, data = ("\n".join(spelt(t.split("\n"), points)) for t in (more, data))
    source = rapid(shop, spelt(lines, points), more, data)
    done = shop.compensate({"m.mod": source})
    text = done.outputs["m.mod"].decode()
    body, was = text[text.index("PROC main") :], source.decode()
    before = TARGET.findall(was[was.index("PROC main") :])
    after = TARGET.findall(body)
    assert len(before) == len(after)
    return [numbers(t) for t in before], [numbers(t) for t in after], done


def go(name):
    return f"MoveL {name}{END}"


CERTAIN = {
    "one value": (["q:=P1;", go("q")], [go("P1")]),
    "two values": (
        ["q:=P1;", go("q"), "q:=P2;", go("q"), go("q")],
        [go("P1"), go("P2"), go("P2")],
    ),
    "copied": (["q:=P1;", "r:=q;", go("r"), go("q")], [go("P1"), go("P1")]),
    "in a branch": (
        ["IF di1=1 THEN", "q:=P1;", go("q"), "ELSE", "q:=P2;", go("q"), "ENDIF"],
        ["IF di1=1 THEN", go("P1"), "ELSE", go("P2"), "ENDIF"],
    ),
    "behind branches that do not touch it": (
        ["q:=P1;", "IF di1=1 THEN", go("P2"), "ENDIF", go("q")],
        ["IF di1=1 THEN", go("P2"), "ENDIF", go("P1")],
    ),
    "in a routine of a module": (["q:=P1;", "at;"], [go("P1")]),
    "in a loop": (
        ["FOR i FROM 1 TO 2 DO", "q:=P1;", go("q"), "q:=P2;", go("q"), "ENDFOR"],
        ["FOR i FROM 1 TO 2 DO", go("P1"), go("P2"), "ENDFOR"],
    ),
}
DATA = "VAR robtarget q;\nVAR robtarget r;\nVAR signaldi di1;"
AT = f"PROC at()\n{go('q')}\nENDPROC"


@pytest.mark.parametrize("kind", CERTAIN)
def test_a_certain_value_is_corrected_where_it_is_written(shop, rapid_points, kind):
    lines, straight = CERTAIN[kind]
    more = AT if "at;" in lines else ""
    before, after, done = compensated(shop, lines, rapid_points, more, DATA)
    twin, wanted, _ = compensated(shop, straight, rapid_points, "", DATA)
    moved = {tuple(a): b for a, b in zip(twin, wanted, strict=True)}
    assert np.abs(np.subtract(after, before)).max() > 0.02, done.decisions.reasons
    for was, now in zip(before, after, strict=True):
        assert np.abs(now - moved[tuple(was)]).max() < EXACT_MM


UNCERTAIN = {
    "on one way only": ["IF di1=1 THEN", "q:=P1;", "ENDIF", go("q")],
    "two values": ["IF di1=1 THEN", "q:=P1;", "ELSE", "q:=P2;", "ENDIF", go("q")],
    "short if": ["q:=P1;", "IF di1=1 q:=P2;", go("q")],
    "a component": ["q:=P1;", "q.trans.x:=900.0;", go("q")],
    "a component is read": ["q:=P1;", "x:=q.trans.x;", go("q")],
    "before it is set": [go("q"), "q:=P1;", go("q")],
    "compared": ["q:=P1;", "IF q=p1 di1:=1;", go("q")],
    "given to a function": ["q:=P1;", "x:=Distance(q.trans,p1.trans);", go("q")],
    "given to a routine that changes it": ["q:=P1;", "turn q;", go("q")],
    "set by a function": ["q:=P1;", "x:=change();", go("q")],
    "set by a trap": ["CONNECT i1 WITH often;", "q:=P1;", go("q")],
    "set on the way": [
        "q:=P1;",
        'MoveLSync p2,v200,z10,t\\WObj:=w,"alter";',
        go("q"),
    ],
    "set by a handler": ["q:=P1;", "risky;", go("q")],
    "persistent": ["k:=P1;", go("k")],
    "searched for": ["q:=P1;", "SearchL di1,q,p2,v200,t\\WObj:=w;", go("q")],
    "a loop leaves it": ["q:=P1;", "WHILE di1=1 DO", go("q"), "q:=P2;", "ENDWHILE"],
    "by a name in a string": ['q:=P1;', 'SetDataVal "q",p2;', go("q")],
    "moved from itself": ["q:=P1;", "q:=Offs(q,0,0,50);", go("q")],
    "used by a routine with a parameter": ["q:=P1;", "there q;", go("q")],
    "a copy is read": ["q:=P1;", "r:=q;", "x:=r.trans.x;", go("q")],
    "a copy goes where it is not certain": [
        "r:=P2;",
        "q:=P1;",
        go("q"),
        "IF di1=1 THEN",
        "r:=q;",
        "ENDIF",
        go("r"),
    ],
    "its original is read": ["q:=P1;", "r:=q;", "x:=q.trans.x;", go("r")],
    "kept beyond the run": ["q:=P1;", "k:=q;", go("q")],
    "given to a routine that reads it": ["reads P1;"],
    "given to a routine that copies and reads it": ["copies P1;"],
    "copied into what a routine gives back": ["q:=P1;", "back r;", go("q"), go("r")],
}  # fmt: skip
MORE = f"""PROC turn(INOUT robtarget a)
a:=P2;
ENDPROC
FUNC num change()
q:=P2;
RETURN 1;
ENDFUNC
TRAP often
q:=P2;
ENDTRAP
PROC alter()
q:=P2;
ENDPROC
PROC risky()
WaitDI di1,1\\MaxTime:=1;
ERROR
q:=P2;
TRYNEXT;
ENDPROC
PROC reads(robtarget b)
x:=b.trans.x;
MoveL b{END}
ENDPROC
PROC copies(robtarget c)
r:=c;
x:=r.trans.x;
MoveL r{END}
ENDPROC
PROC back(INOUT robtarget d)
d:=q;
ENDPROC
PROC there(robtarget a)
MoveL a{END}
ENDPROC"""
PERSISTENT = "PERS robtarget k:=P2;\nVAR num x;\nVAR intnum i1;"


@pytest.mark.parametrize("kind", UNCERTAIN)
def test_an_uncertain_value_keeps_its_numbers(shop, rapid_points, kind):
    lines = UNCERTAIN[kind]
    more = DATA + "\n" + PERSISTENT
    before, after, _ = compensated(shop, lines, rapid_points, MORE, more)
    own = numbers(rapid_points["P1"])
    held = [k for k, was in enumerate(before) if np.array_equal(was, own)]
    assert held
    for k in held:
        assert np.array_equal(after[k], before[k])


def test_a_shifted_value_is_corrected_by_its_own_shift(shop, rapid_points):
    lines = ["q:=Offs(p1,10,-20,100);", go("q"), go("p1")]
    done = shop.compensate({"m.mod": rapid(shop, lines, "", DATA)})
    text = done.outputs["m.mod"].decode()
    twin = [go("Offs(p1,10,-20,100)"), go("Offs(p1,10,-20,100)"), go("p1")][1:]
    other = shop.compensate({"m.mod": rapid(shop, twin, "", DATA)})
    shift = re.search(r"Offs\(p1,(.*?)\)", text)[1]
    wanted = re.search(r"Offs\(p1,(.*?)\)", other.outputs["m.mod"].decode())[1]
    pairs = zip(shift.split(","), wanted.split(","), strict=True)
    assert shift != "10,-20,100"
    assert max(abs(float(a) - float(b)) for a, b in pairs) < EXACT_MM


def test_the_source_comes_back_and_reads_as_compensated(shop, rapid_points):
    source = rapid(shop, spelt(["q:=P1;", go("q")], rapid_points), "", DATA)
    done = shop.compensate({"m.mod": source})
    assert done.outputs["m.mod"] != source
    lines = source.decode().splitlines()
    line = next(k for k, one in enumerate(lines, 1) if one.startswith("q:="))
    assert line in done.visits.literals.line.tolist()


# The same in KRL.


def krl_compensated(shop, lines, points, more="", data=""):
    more = "\n".join(spelt(more.split("\n"), points))
    data = "\n".join(spelt(data.split("\n"), points))
    files = krl(shop, spelt(lines, points), more, data)
    done = shop.compensate(files)
    now = {n: done.outputs.get(n, t).decode() for n, t in files.items()}
    start = files["job.src"].decode().index("PTP")
    before = AGGREGATE.findall(files["job.src"].decode()[start:])
    after = AGGREGATE.findall(now["job.src"][now["job.src"].index("PTP") :])
    assert len(before) == len(after)
    return [numbers(t) for t in before], [numbers(t) for t in after], done


KRL_CERTAIN = {
    "one value": (["q=P1", "LIN q"], ["LIN P1"]),
    "two values": (["q=P1", "LIN q", "q=P2", "LIN q"], ["LIN P1", "LIN P2"]),
    "joint move": (["q=P1", "PTP q", "LIN q"], ["PTP P1", "LIN P1"]),
    "copied": (["q=P1", "r=q", "LIN r"], ["LIN P1"]),
    "in a branch": (
        ["IF $IN[1] THEN", "q=P1", "LIN q", "ELSE", "q=P2", "LIN q", "ENDIF"],
        ["IF $IN[1] THEN", "LIN P1", "ELSE", "LIN P2", "ENDIF"],
    ),
}


def in_routine(lines):
    """Put statements into a routine that declares the points."""
    return "DEF own()\nDECL E6POS q,r\nDECL REAL x\n" + "\n".join(lines) + "\nEND"


@pytest.mark.parametrize("kind", KRL_CERTAIN)
def test_krl_corrects_a_certain_value_where_it_is_written(shop, krl_points, kind):
    lines, straight = KRL_CERTAIN[kind]
    more = (in_routine(one) for one in (lines, straight))
    found = [krl_compensated(shop, ["own()"], krl_points, text) for text in more]
    (before, after, done), (twin, wanted, _) = found
    moved = {tuple(a): b for a, b in zip(twin, wanted, strict=True)}
    for was, now in zip(before, after, strict=True):
        assert np.abs(now - was).max() > 0.02, done.decisions.reasons
        assert np.abs(now - moved[tuple(was)]).max() < EXACT_MM


KRL_UNCERTAIN = {
    "on one way only": ["IF $IN[1] THEN", "q=P1", "ENDIF", "LIN q"],
    "a component": ["q=P1", "q.x=900.0", "LIN q"],
    "a component is read": ["q=P1", "x=q.x", "LIN q"],
    "given away": ["q=P1", "turn(q)", "LIN q"],
    "a copy is read": ["q=P1", "r=q", "x=r.x", "LIN q"],
    "kept beyond the run": ["q=P1", "Xk=q", "LIN q"],
    "its original is read": ["q=P1", "r=q", "x=q.x", "LIN r"],
    "a step by it": ["q=P1", "LIN q", "LIN_REL q"],
    "moved by a frame": ["q=P1", "LIN q:{X 0,Y 0,Z x,A 0,B 0,C 0}"],
    "without a status": ["q=P1", "q={X 900.0,Y 0.0,Z 900.0}", "PTP q"],
}


@pytest.mark.parametrize("kind", KRL_UNCERTAIN)
def test_krl_keeps_an_uncertain_value(shop, krl_points, kind):
    turn = "\nDEF turn(a:OUT)\nDECL E6POS a\na=P2\nEND"
    more = in_routine(KRL_UNCERTAIN[kind]) + turn
    data = "DECL E6POS Xk"
    before, after, _ = krl_compensated(shop, ["own()"], krl_points, more, data)
    own = numbers(krl_points["P1"])
    held = [k for k, was in enumerate(before) if np.array_equal(was, own)]
    assert held
    for k in held:
        assert np.array_equal(after[k], before[k])


BESIDE = {
    "an interrupt": ["INTERRUPT DECL 3 WHEN $IN[1] DO alter()", "INTERRUPT ON 3"],
    "a trigger": ["TRIGGER WHEN DISTANCE=0 DELAY=0 DO alter() PRIO=-1"],
    "a function": ["x=change()"],
}


@pytest.mark.parametrize("kind", BESIDE)
def test_krl_keeps_what_something_beside_it_changes(shop, krl_points, kind):
    more = "DEF alter()\nXq=P2\nEND\nDEFFCT REAL change()\nXq=P2\nRETURN 1.0\nENDFCT"
    data = "DECL E6POS Xq\nDECL REAL x"
    lines = ["Xq=P1", *BESIDE[kind], "LIN Xq"]
    before, after, _ = krl_compensated(shop, lines, krl_points, more, data)
    assert np.array_equal(before, after)


def test_krl_follows_a_value_of_a_data_list_and_does_not_correct_it(shop, krl_points):
    """It is kept in the list for whatever runs next."""
    data = "DECL E6POS Xq"
    before, after, done = krl_compensated(
        shop, ["Xq=P1", "LIN Xq", "LIN P2"], krl_points, "", data
    )
    assert np.array_equal(before[0], after[0])
    assert np.abs(before[1] - after[1]).max() > 0.02
    assert any("outlives" in why for why in done.visits.literals.pinned)


def test_reasons_name_lines_of_the_source_where_points_are_cloned(job_cell, job_model):
    lines = [go("p2"), go("p1"), go("p3"), go("p1"), "q:=p2;", "q.trans.x:=n;", go("q")]
    shop = Shop.of(job_cell, job_model, Options(shared_points="clone"))
    source = rapid(shop, lines, "", "VAR robtarget q;\nVAR num n;")
    done = shop.compensate({"m.mod": source})
    assert "cloned" in {found.code for found in done.diagnostics}
    line = 1 + source[: source.index(b"q.trans.x")].count(b"\n")
    texts = [done.visits.reasons[k].text for k in done.visits.reason.tolist()]
    assert f"set in line {line} of m.mod" in texts[-1]
