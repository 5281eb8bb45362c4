"""Other modules of a folder that change what all modules of a task share."""

from __future__ import annotations

import pytest

from postproc.files import FolderListing
from postproc.language.language import Start
from postproc.language.rapid.language import Rapid
from postproc.language.rapid.other_modules import find_other_modules
from postproc.language.text.source import Source
from postproc.language.text.stamp import stamp_line
from tests.golden.rapid_cases import DATA, go, module
from tests.language.rapid.test_system_modules import compensated, folder  # noqa: F401

POINT = next(line for line in DATA if "robtarget p1:" in line)
TOOL = next(line for line in DATA if "tooldata t:" in line)
WOBJ = next(line for line in DATA if "wobjdata w:" in line)
FRAME = "[[9,0,0],[1,0,0,0]]"


def shared(line):
    return line.replace("CONST", "PERS").replace("TASK ", "")


def other(body, declared=""):
    return f"MODULE o\n{declared}\nPROC before()\n{body}\nENDPROC\nENDMODULE\n"


def reasons(lines, body, declared="", replace=shared, **said):
    own = module(*lines).decode()
    for line in (POINT, TOOL, WOBJ):
        own = own.replace(line, replace(line))
    sources = [Source("job.mod", own.encode())]
    sources.append(Source("MODULES/o.mod", other(body, declared).encode()))
    v = Rapid().read(sources, Start(**said)).visits
    return [v.reasons[k].text for k in v.reason.tolist()][1:]  # without home


CHANGES = [
    f"w.uframe:={FRAME};",
    f"WHILE TRUE DO w.oframe:={FRAME}; ENDWHILE",
    f"IF di1=1 w.oframe:={FRAME};",
    "t.tframe.trans.z:=t.tframe.trans.z+1;",
    "t:=measured();",
    "calibrate t;",
    "p1:=CRobT();",
    "p1.trans.z:=5;",
    "SetDataVal name,o;",
    "?? w x",
]


@pytest.mark.parametrize("change", CHANGES)
def test_what_another_module_changes_is_not_known(change):
    (why,) = reasons([go("p1")], change)
    assert "may be changed by o.mod (line 4)" in why


@pytest.mark.parametrize(
    ("change", "declared", "replace"),
    [
        ("MoveL p1,v5,fine,t;", "", shared),
        ("z:=w.uframe.trans.z;", "", shared),
        (f"w.uframe:={FRAME};", shared(WOBJ), shared),
        (f"w.uframe:={FRAME};", "", lambda line: f"LOCAL {shared(line)}"),
    ],
)
def test_what_is_not_shared_does_no_harm(change, declared, replace):
    assert reasons([go("p1")], change, declared, replace) == [""]


def test_names_of_another_routine_are_not_those_of_all():
    body = f"w.uframe:={FRAME};\nENDPROC\nPROC more()\nVAR wobjdata w;"
    (why,) = reasons([go("p1")], body)
    assert "o.mod" in why


def test_what_the_cell_calls_constant_is_known():
    assert reasons([go("p1")], f"w.uframe:={FRAME};", constant=("w",)) == [""]


def test_what_a_program_sets_by_itself_is_known():
    whole = WOBJ.partition(":=")[2].strip()
    assert reasons([f"w:={whole}", go("p1")], f"w.uframe:={FRAME};") == [""]


@pytest.mark.parametrize(
    ("body", "declared", "shared"),
    [
        ("MoveL p1,v5,fine,t;", "", True),
        ("w2.uframe:=DefFrame(p1,p2,p3);", "", True),
        ("MoveL p1,v5,fine,t;", shared(POINT), False),
        ("MoveL p2,v5,fine,t;", "", False),
        ('TPWrite "p1"; ! p1', "", False),
    ],
)
def test_points_that_another_module_names_are_shared(body, declared, shared):
    sources = [Source("job.mod", module(go("p1"), go("Offs(p1,0,0,9)")))]
    sources.append(Source("MODULES/o.mod", other(body, declared).encode()))
    literals = Rapid().read(sources, Start()).visits.literals
    assert literals.shared.any() == shared


def test_points_of_a_module_alone_are_its_own():
    sources = [Source("job.mod", module(go("p1")).replace(b"CONST", b"LOCAL CONST"))]
    sources.append(Source("MODULES/o.mod", other("MoveL p1,v5,fine,t;").encode()))
    assert not Rapid().read(sources, Start()).visits.literals.shared.any()


OTHERS = {
    "frame": (f"w.uframe:={FRAME};", "", True),
    "by text": ("SetDataVal name,w;", "", True),
    "read": ("MoveL p1,v5,fine,t\\WObj:=w;", "", True),
    "comment": ("! w of b.mod", "", False),
    "its own": (f"w.uframe:={FRAME};", shared(WOBJ), False),
    "none": ("x:=1;", "VAR num x;", False),
    "no module": ("ENDIF", "", False),
}


@pytest.mark.parametrize(("body", "declared", "expected"), OTHERS.values(), ids=OTHERS)
def test_modules_that_are_read(tmp_path, body, declared, expected):
    own = module(go("p1")).decode().replace(WOBJ, shared(WOBJ))
    (tmp_path / "job.mod").write_text(own)
    (tmp_path / "o.mod").write_text(other(body, declared))
    found = find_other_modules(tmp_path / "job.mod", FolderListing())
    assert [path.name for path in found] == ["o.mod"] * expected


def test_a_compensated_module_beside_counts(folder):  # noqa: F811
    text = other(f"w.uframe:={FRAME};")
    stamp = stamp_line("0", "m", Source("o.mod", text.encode()), "!").decode()
    own = module(go("p1")).decode().replace(WOBJ, shared(WOBJ))
    found = compensated(folder, {"job.mod": own, "o.mod": stamp + text})
    assert found.exit_code == 1 and "w may be changed by o.mod" in found.stderr
