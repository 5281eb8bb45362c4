"""System modules keep every number, wherever they stand."""

from __future__ import annotations

import pytest

from postproc.language.language import Start
from postproc.language.rapid.language import Rapid
from postproc.language.text.source import Source
from tests.golden.case import HERE
from tests.golden.rapid_cases import DATA, go, module
from tests.written import cli

GIVEN = ("cell.toml", "model.json")
NAMES = ("user.sys", "BASE.SYS", "shared.sysx", "Shared.mod")
POINT = next(line for line in DATA if "robtarget p1:" in line)
WRITTEN = POINT.partition(":=")[2].strip().rstrip(";")
WHY = "it stands in a system module"


def parts(name, *own, body="", declared=POINT):
    """Return a job, and a module beside it that declares the first point."""
    job = module(go("p2"), *own, go("p3")).decode().replace(POINT + "\n", "")
    head = "MODULE Shared" + ("(NOSTEPIN, SysModule)" if ".mod" in name else "")
    lines = [head, declared, "PROC there()", body, "ENDPROC", "ENDMODULE", ""]
    return {"job.mod": job, name: "\n".join(lines)}


@pytest.fixture
def folder(tmp_path):
    """A folder with a cell and a model."""
    for name in GIVEN:
        (tmp_path / name).write_bytes((HERE / "rapid" / name).read_bytes())
    return tmp_path


def compensated(folder, files, *more):
    for name, text in files.items():
        (folder / name).write_text(text)
    (folder / "out").mkdir()
    given = ("--cell", folder / "cell.toml", "--model", folder / "model.json")
    out = folder / "out" / "job.mod"
    return cli("compensate", folder / "job.mod", *given, "-o", out, *more)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    ("own", "body"),
    [
        ([go("p1")], ""),
        ([go("Offs(p1,0,0,10)"), go("p1")], ""),
        (["there;"], go(WRITTEN)),
        (["there;"], go("p1")),
    ],
)
def test_no_number_of_a_system_module_is_rewritten(folder, name, own, body):
    files = parts(name, *own, body=body)
    found = compensated(folder, files)
    assert found.exit_code == 1 and WHY in found.stderr
    out = folder / "out" / name
    assert not out.exists() or out.read_text() == files[name]
    assert (folder / "out" / "job.mod").read_text() != files["job.mod"]
    said = f"{name} is a part of this program"
    assert said not in found.stderr
    assert (folder / name).read_text() == files[name]


def test_a_module_beside_the_program_is_rewritten(folder):
    files = parts("Shared.mod", go("p1"))
    files["Shared.mod"] = files["Shared.mod"].replace("(NOSTEPIN, SysModule)", "")
    found = compensated(folder, files)
    assert found.exit_code == 0 and "is a part of this program" in found.stderr
    assert (folder / "out" / "Shared.mod").read_text() != files["Shared.mod"]


def test_a_point_of_a_system_module_is_cloned_beside_its_moves(folder):
    files = parts("user.sys", go("p1"))
    assert compensated(folder, files, "--shared-points", "clone").exit_code == 0
    assert "p1__2" in (folder / "out" / "job.mod").read_text()
    assert not (folder / "out" / "user.sys").exists()


def test_joint_targets_of_system_modules_are_pinned():
    declared = "  CONST jointtarget away:=[[1,2,3,4,5,6],[9E9,9E9,9E9,9E9,9E9,9E9]];"
    files = parts("user.sys", r"MoveAbsJ away,v500,fine,t;", declared=declared)
    files["job.mod"] = files["job.mod"].replace("PROC main", POINT + "\nPROC main")
    texts = [Source(name, text.encode()) for name, text in files.items()]
    assert [*Rapid().read(texts, Start()).visits.literals.pins] == [
        "it stands in a system module, which is read and not rewritten"
    ]


def test_a_batch_copies_system_modules(folder):
    files = parts("user.sys", go("p1"))
    (folder / "in").mkdir()
    for name, text in files.items():
        (folder / "in" / name).write_text(text)
    given = ("--cell", folder / "cell.toml", "--model", folder / "model.json")
    cli("batch", folder / "in", folder / "out", *given, "-j", "1")
    assert (folder / "out" / "user.sys").read_text() == files["user.sys"]
    assert (folder / "out" / "job.mod").read_text() != files["job.mod"]


@pytest.mark.parametrize("name", NAMES)
def test_a_system_module_is_told_by_what_it_says_not_by_its_points(folder, name):
    tool = next(line for line in DATA if "tooldata t:" in line)
    files = parts(name, declared=tool, body=go("nowhere") + "\nodd 1;")
    files["job.mod"] = module(go("p2")).decode().replace(tool + "\n", "")
    found = compensated(folder, files)
    assert found.exit_code == 0, found.stderr
    assert f"{name} is read, but not written" in found.stderr
    assert f"{name}:" not in found.stderr
