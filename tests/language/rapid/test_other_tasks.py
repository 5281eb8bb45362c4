"""Tasks that run beside a program: what they may change is not known in it."""

from __future__ import annotations

import pytest

from postproc.compensation.program_files import ProgramFiles
from postproc.files import FolderListing
from postproc.language.language import Start
from postproc.language.rapid.backup import modules_beside
from postproc.language.rapid.language import Rapid
from postproc.language.text.source import Source
from tests.golden.rapid_cases import DATA, go, module, proc

BESIDE = "TASKS/TASK2/PROGMOD/plc.mod"
POINT = next(line for line in DATA if "robtarget p1:" in line)
TOOL = next(line for line in DATA if "tooldata t:" in line)
WOBJ = next(line for line in DATA if "wobjdata w:" in line)
MORE = "\n".join(
    ["PERS num n:=2;", "PERS pose d:=[[0,0,5],[1,0,0,0]];", "PERS bool b:=TRUE;",
     "PERS loaddata l:=[5,[0,0,100],[1,0,0,0],0,0,0];", "VAR num v:=2;",
     "TASK PERS num own:=2;", "LOCAL PERS num here:=2;"]
)  # fmt: skip


def pers(line):
    return line.replace("CONST", "PERS").replace("TASK ", "")


def job(*lines, other="", declared="", body="", names=(BESIDE,)):
    own = module(*lines, declared=f"{MORE}\n{declared}").decode()
    for line in (POINT, TOOL, WOBJ):
        own = own.replace(line, pers(line))
    sources = [Source("job.mod", own.encode())]
    text = f"MODULE plc\n{other}\nPROC main()\n{body}\nENDPROC\nENDMODULE\n"
    sources += [Source(name, text.encode()) for name in names]
    return Rapid().read(sources, Start())


def reasons(found):
    v = found.visits
    return [v.reasons[k].text for k in v.reason.tolist()][1:]  # without home


def pins(found):
    return [pin for pin in found.visits.literals.pins if pin]


def test_another_task_without_common_data_changes_nothing():
    found = job(go("p1"), body="MoveL Offs(nobody,0,0,1),v5,fine,tool0;\nSet do1;")
    assert reasons(found) == [""] and pins(found) == []
    assert found.visits.files == ("job.mod", BESIDE)
    assert found.missed == {} and found.diagnostics == ()


ELSEWHERE = "another task"


@pytest.mark.parametrize(
    ("other", "body"),
    [
        (TOOL, "t.tframe.trans.z:=9;"),
        (WOBJ, "w.oframe.trans.x:=w.oframe.trans.x+1;"),
        (WOBJ, "IF di1=1 w.oframe:=find();"),
        (WOBJ, "camera w;"),
        (WOBJ, "n:=seen(w);"),
        (WOBJ, 'SetDataVal "w",o;'),
        (WOBJ, "?? w x"),
        (WOBJ, "GetDataVal name,w;"),
        (WOBJ, "ReadVarArr dev,w;"),
        (WOBJ.replace("[1,0,0,0]", "[0,1,0,0]"), ""),
        ("PERS wobjdata w;", ""),
        (POINT, "p1.trans.z:=p1.trans.z+1;"),
        (POINT.replace("[[", "[[1"), ""),
        ("", "w:=wobj0;"),
    ],
)
def test_what_another_task_may_change_is_never_known(other, body):
    (reason,) = reasons(job(go("p1"), other=pers(other), body=body))
    assert ELSEWHERE in reason


@pytest.mark.parametrize(
    ("lines", "body"),
    [
        ([r"MoveL Offs(p2,0,0,n),v200,fine,t\WObj:=w;"], "n:=3;"),
        (["PDispSet d;", go("p2"), "EXIT;"], "d.trans.z:=7;"),
        (["GripLoad l;", go("p2"), "GripLoad load0;"], "l.mass:=9;"),
        ([r"MoveL p2,v200,fine,t\WObj:=w\TLoad:=l;"], "l:=load0;"),
        (["FOR i FROM 1 TO n DO", r"MoveL Offs(p2,0,0,i),v200,fine,t\WObj:=w;",
          "ENDFOR"], "Incr n;"),
        (["reach p2;"], "n:=1;"),
    ],
)  # fmt: skip
def test_all_that_a_move_takes_may_change(lines, body):
    own = "PROC reach(robtarget p)\n" + go("Offs(p,0,0,n)") + "\nENDPROC"
    text = module(go("p2"), *lines, declared=MORE, more=own)

    def read(*more):
        return Rapid().read([Source("job.mod", text), *more], Start())

    assert reasons(read()) == [""] * len(reasons(read()))
    other = f"MODULE plc\n{MORE}\n{proc('main', body)}\nENDMODULE\n"
    found = reasons(read(Source(BESIDE, other.encode())))
    assert all(found[1:]) and len(found) > 1


@pytest.mark.parametrize(
    ("other", "body"),
    [
        ("VAR num n:=1;", "n:=2;"),
        ("TASK PERS num n:=1;", "n:=2;"),
        ("LOCAL PERS num n:=1;", "n:=2;"),
        ("PERS num n:=2;", "v:=n;"),
        ("VAR num own:=1;\nVAR num here:=1;", "own:=5;\nhere:=5;"),
        ("PERS num own:=1;\nPERS num here:=1;\nPERS num v:=1;",
         "own:=5;\nhere:=5;\nv:=5;"),
    ],
)  # fmt: skip
def test_data_of_one_task_alone_are_known(other, body):
    shift = r"MoveL Offs(p2,n,own+here,v),v200,fine,t\WObj:=w;"
    assert reasons(job(go("p2"), shift, other=other, body=body)) == ["", ""]


@pytest.mark.parametrize("body", ["", "v:=p1.trans.x;", go("p1")])
def test_a_point_of_two_tasks_keeps_its_numbers(body):
    found = job(go("p1"), other=pers(POINT), body=body)
    assert reasons(found) == [""]
    assert pins(found) == [
        "p1 is data of another task too, which has its numbers as well"
    ]


def test_any_of_several_tasks_counts():
    names = ("TASKS/TASK2/SYSMOD/a.sys", "TASKS/T3/PROGMOD/a.mod")
    assert ELSEWHERE in reasons(job(go("p1"), body="w:=wobj0;", names=names))[0]


def test_a_task_whose_blocks_do_not_close_refuses_nothing():
    found = job(go("p1"), other=pers(WOBJ), body="IF di1=1 THEN\nw:=wobj0;")
    assert ELSEWHERE in reasons(found)[0]


@pytest.fixture
def backup(tmp_path):
    """Write a backup of two tasks, each with a module of the same name."""
    texts = {
        "TASK1/PROGMOD/Job.mod": module(go("p1")).decode(),
        "TASK2/PROGMOD/Job.mod": "MODULE Job\nPERS num n:=1;\nPROC main()\nn:=2;\n"
        "ENDPROC\nENDMODULE\n",
        "TASK2/SYSMOD/user.sys": "MODULE user(SYSMODULE)\nENDMODULE\n",
        "TASK2/SYSMOD/coded.sys": "\0\1",
    }
    for name, text in texts.items():
        path = tmp_path / "RAPID" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path / "RAPID"


def test_a_backup_shows_the_other_tasks(backup, monkeypatch):
    program = backup / "TASK1" / "PROGMOD" / "Job.mod"
    names = ["TASKS/TASK2/PROGMOD/Job.mod", "TASKS/TASK2/SYSMOD/user.sys"]
    assert [*ProgramFiles.open(program).by_name] == ["Job.mod", *names]
    monkeypatch.chdir(program.parent)
    assert [*ProgramFiles.open("Job.mod").by_name] == ["Job.mod", *names]
    assert modules_beside(backup / "Job.mod", FolderListing()) == ()
