"""Programs that run beside the one that moves the arm, and the controller's own."""

from __future__ import annotations

import pytest

from postproc.exceptions import ProgramError
from postproc.files import find_shared, is_system_source
from postproc.language.interface import Start
from postproc.language.krl.language import Krl
from postproc.language.source import Source
from tests.language.krl.test_visits import CONFIG, DATA, codes, reasons

INIT = ["BAS(#INITMOV,0)", "BAS(#TOOL,1)", "BAS(#BASE,2)", "$IPO_MODE=#BASE"]


def job(*lines, submit, more=""):
    text = "DEF m ( )\n" + "\n".join(lines) + f"\nEND\n{more}"
    sources = [
        Source("m.src", text.encode()),
        Source("m.dat", f"DEFDAT m\n{DATA}\nENDDAT\n".encode()),
        Source("$config.dat", CONFIG.encode()),
        Source("sps.sub", f"DEF sps( )\nBOOL own\n{submit}\nEND\n".encode()),
    ]
    return Krl().read(sources, Start())


@pytest.mark.parametrize(
    "submit",
    ["$OUT[1]=TRUE", "own=TRUE", "unknown_call( )", "LOOP\nWAIT SEC 1\nENDLOOP",
     "INTERRUPT DECL 91 WHEN $PRO_STATE1==#P_FREE DO RESET_OUT ()\nINTERRUPT ON 91",
     "$OV_PRO=10", "BASE_DATA[7]={X 1,Y 2,Z 3,A 0,B 0,C 0}", "?? what"],
)  # fmt: skip
def test_what_runs_beside_does_no_harm(submit):
    found = job(*INIT, "LIN XP1", submit=submit)
    assert reasons(found) == [""] and "motion-unknown" not in codes(found)


@pytest.mark.parametrize(
    ("submit", "why"),
    [
        ("BASE_CORR_ON=TRUE", "BASE_CORR_ON"),
        ("IF $IN[1] THEN\nTOOL_CORR_ON=TRUE\nENDIF", "TOOL_CORR_ON"),
        ("BASE_DATA[2].X=5", "BASE_DATA[2]"),
        ("BASE_DATA[own]=$NULLFRAME", "BASE_DATA[2]"),
        ("camera(TOOL_DATA[1])", "TOOL_DATA[1]"),
        ("LOAD_DATA[1].M=5", "$LOAD"),
        ("XP1.Z=5", "may be changed"),
    ],
)
def test_what_it_may_change_is_not_known_at_any_time(submit, why):
    found = job(*INIT, "LIN XP1", submit=submit)
    assert why in reasons(found)[0]


def test_what_the_program_sets_may_be_changed_at_once():
    lines = ["BASE_DATA[2]={X 1,Y 2,Z 3,A 0,B 0,C 0}", "LOAD_DATA[1]={M 5}", *INIT]
    assert (
        "BASE_DATA[2]" in reasons(job(*lines, "LIN XP1", submit="BASE_DATA[2].X=5"))[0]
    )
    found = job(*lines, "LIN XP1", submit="LOAD_DATA[1].M=7")
    assert "$LOAD" in reasons(found)[0]


def test_a_point_that_a_submit_program_reads_keeps_its_numbers():
    pins = job("LIN XP1", submit="N2=XP1.Z").visits.literals.pins
    assert [*pins] == ["xp1 is used otherwise than as a destination too"]


def test_a_submit_program_may_change_the_variable_of_a_loop():
    found = job("FOR I=1 TO 2", "LIN XS[I]", "ENDFOR", submit="I=2")
    assert all(reasons(found))


def test_a_submit_program_may_change_settings_before_bas_takes_them():
    lines = ["FDAT_ACT=FP1", "BAS(#FRAMES)", "LIN XP1"]
    assert reasons(job(*lines, submit="FDAT_ACT.BASE_NO=3"))[0]


def test_a_submit_program_alone_is_refused():
    with pytest.raises(ProgramError, match=r"sps\.sub: is a submit program"):
        Krl().read([Source("sps.sub", b"DEF sps( )\nEND\n")], Start())


def test_routines_of_submit_programs_are_not_called():
    found = job(*INIT, "sps( )", "LIN XP1", submit="$OUT[1]=TRUE")
    assert "motion-unknown" in codes(found)


BAS = b"&ACCESS R\r\nDEF  BAS (COMMAND :IN,REAL_PAR :IN )\r\nEND\r\n"
BAS += b"DEF  INITMOV ( )\r\nEND\r\nDEF  FRAMES ( )\r\nEND\r\n"


def test_sources_of_the_controller_are_told_by_name_and_content():
    assert is_system_source("R1/System/bas.src", BAS)
    assert not is_system_source("mybas.src", BAS)
    assert not is_system_source("bas.src", BAS.replace(b"INITMOV", b"OTHER"))
    assert not is_system_source("bas.dat", BAS)


def test_shared_files_of_an_archive_are_found(tmp_path):
    program = tmp_path / "R1" / "Program" / "weld" / "job.src"
    system = tmp_path / "R1" / "System"
    for folder in (program.parent, system):
        folder.mkdir(parents=True)
    for path in (program, program.with_name("own.sub"), system / "$config.dat",
                 system / "SPS.SUB", system / "bas.src"):  # fmt: skip
        path.write_bytes(b"")
    names = [path.name for path in find_shared(program)]
    assert names == ["$config.dat", "SPS.SUB", "own.sub"]
    assert find_shared(tmp_path / "R1" / "a.pdl") == ()
