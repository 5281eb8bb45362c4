"""Programs that run beside the one that moves the arm, and the controller's own."""

from __future__ import annotations

from pathlib import Path

import pytest

from postproc.exceptions import ProgramError
from postproc.files import FolderListing
from postproc.language.krl.files import KrlFileName
from postproc.language.krl.language import Krl
from postproc.language.language import Start
from postproc.language.text.source import Source
from postproc.language.visits import ZoneRule
from tests.language.krl.test_visits import CONFIG, DATA, codes, reasons

INIT = ["BAS(#INITMOV,0)", "BAS(#TOOL,1)", "BAS(#BASE,2)", "$IPO_MODE=#BASE"]


def job(*lines, submit, more="", start=None):
    text = "DEF m ( )\n" + "\n".join(lines) + f"\nEND\n{more}"
    sources = [
        Source("m.src", text.encode()),
        Source("m.dat", f"DEFDAT m\n{DATA}\nENDDAT\n".encode()),
        Source("$config.dat", CONFIG.encode()),
        Source("sps.sub", f"DEF sps( )\nBOOL own\n{submit}\nEND\n".encode()),
    ]
    return Krl().read(sources, start or Start())


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


KNOWN = ["$TOOL=TOOL_DATA[1]", "$BASE=BASE_DATA[2]", "$LOAD=LOAD_DATA[1]", *INIT[3:]]


@pytest.mark.parametrize(
    ("submit", "why"),
    [
        ("$TOOL=TOOL_DATA[3]", "$TOOL"),
        ("$TOOL.Z=$TOOL.Z+1", "$TOOL"),
        ("IF $IN[7] THEN\n$BASE={X 1,Y 2,Z 3,A 0,B 0,C 0}\nENDIF", "$BASE"),
        ("$LOAD.M=50", "$LOAD"),
        ("$SOFT_PLCL[3]=TRUE", "$SOFT_PLCL"),
        ("$SOFTN=1", "$SOFTN"),
        ("$IPO_MODE=#TCP", "$IPO_MODE"),
        ("$ORI_TYPE=#CONSTANT", "$ORI_TYPE"),
        ("$ROBROOT={X 1,Y 2,Z 3,A 0,B 0,C 0}", "$ROBROOT"),
        ("$TECH.MODE=#CYCLE", "$TECH"),
        ("$LOAD_A3.M=5", "$LOAD_A3"),
        ("$NOBODY=1", "$NOBODY"),
        ("camera($BASE)", "$BASE"),
        ("INTERRUPT DECL 91 WHEN $IN[1] DO $TOOL=$NULLFRAME", "$TOOL"),
        ("BAS(#TOOL,2)", "$TOOL"),
        ("RSI_ON(#ABSOLUTE)", "a sensor"),
        ("own=TOUCHSENSE(1)", "a sensor"),
        ("$BASE={X 1,Y 2,Z 3,A 0,B 0,C 0} ?? what", "$BASE"),
        ("MACHINE_FRAME_DAT[2].MACH_DEF_INDEX=2", "MACHINE_FRAME_DAT[2]"),
        ("part( )", "$BASE"),
        ("own=asked( )", "$TOOL"),
    ],
)
def test_what_moves_depend_on_may_change_at_any_time(submit, why):
    more = "GLOBAL DEF part( )\n$BASE=BASE_DATA[3]\nEND\n"
    more += "GLOBAL DEFFCT INT asked( )\nhelps( )\nRETURN 1\nENDFCT\n"
    more += "DEF helps( )\n$TOOL=TOOL_DATA[3]\nEND\n"
    lines = [*KNOWN[:1], "BAS(#BASE,2)", *KNOWN[2:], "LIN XP1"]
    assert reasons(job(*lines, submit="own=TRUE", more=more)) == [""]
    assert why in reasons(job(*lines, submit=submit, more=more))[0]


@pytest.mark.parametrize("submit", ["$EX_AX_IGNORE=1", "ASYPTP {E1 5}", "ASYSTOP"])
def test_what_runs_beside_may_leave_the_track_elsewhere(submit):
    on_track = Start(aux={1: "track"})
    found = reasons(job(*KNOWN, "LIN XP1", submit=submit, start=on_track))[0]
    assert "the track need not" in found or "may move external axes" in found
    assert reasons(job(*KNOWN, "LIN XP1", submit=submit)) == [""]


def test_how_points_are_passed_may_change_beside_the_program():
    lines = [*KNOWN, "$APO.CDIS=5", "LIN XP1 C_DIS", "LIN XP2"]
    rules = [
        job(*lines, submit=submit).visits.zone.rule[0]
        for submit in ("own=TRUE", "$APO.CDIS=50", "$ADVANCE=0")
    ]
    assert rules == [ZoneRule.FROM, ZoneRule.UNKNOWN, ZoneRule.UNKNOWN]


def test_own_data_of_a_called_routine_is_not_that_of_the_program():
    more = "GLOBAL DEF part( )\nINT I\nI=2\nEND\n"
    lines = ["FOR I=1 TO 2", "LIN XS[I]", "ENDFOR"]
    assert reasons(job(*KNOWN, *lines, submit="part( )", more=more)) == ["", ""]


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


def find_shared(program, root=None):
    return KrlFileName(str(program)).find_shared(FolderListing(root))


BAS = b"&ACCESS R\r\nDEF  BAS (COMMAND :IN,REAL_PAR :IN )\r\nEND\r\n"
BAS += b"DEF  INITMOV ( )\r\nEND\r\nDEF  FRAMES ( )\r\nEND\r\n"


def test_sources_of_the_controller_are_told_by_name_and_content():
    assert KrlFileName("R1/System/bas.src").is_system_source(BAS)
    assert not KrlFileName("mybas.src").is_system_source(BAS)
    other = BAS.replace(b"INITMOV", b"OTHER")
    assert not KrlFileName("bas.src").is_system_source(other)
    assert not KrlFileName("bas.dat").is_system_source(BAS)


def test_shared_files_of_an_archive_are_found(tmp_path):
    program = tmp_path / "R1" / "Program" / "weld" / "job.src"
    system = tmp_path / "R1" / "System"
    for folder in (program.parent, system):
        folder.mkdir(parents=True)
    for path in (program, program.with_name("own.sub"), system / "$config.dat",
                 system / "SPS.SUB", system / "bas.src",
                 tmp_path / "R1" / "Program" / "plc.sub"):  # fmt: skip
        path.write_bytes(b"")
    names = [path.name for path in find_shared(program)]
    assert names[0] == "$config.dat"
    assert sorted(names[1:]) == ["SPS.SUB", "own.sub", "plc.sub"]
    assert find_shared(tmp_path / "R1" / "a.pdl") == ()


def test_an_archive_is_walked_once_for_all_its_programs(tmp_path, monkeypatch):
    system = tmp_path / "R1" / "System"
    programs = [tmp_path / "R1" / "Program" / f"d{k}" / f"p{k}.src" for k in range(5)]
    for path in (*programs, system / "$config.dat", system / "sps.sub",
                 programs[0].with_name("own.SUB"), programs[1].with_name("$CONFIG.DAT"),
                 tmp_path / "R1" / "Program" / "plc.sub"):  # fmt: skip
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"")
    alone = [find_shared(path, tmp_path) for path in programs]
    assert len({*alone}) == 2 and {len(found) for found in alone} == {1, 4}
    walked = []
    for name in ("rglob", "iterdir"):
        once = getattr(Path, name)
        monkeypatch.setattr(Path, name, lambda self, *given, own=once: (
            walked.append((own, self)) or own(self, *given)))  # fmt: skip
    listing = FolderListing(tmp_path)
    files = [KrlFileName(str(path)) for path in programs]
    assert [file.find_shared(listing) for file in files] == alone
    assert len(walked) == len({*walked})


def test_a_program_is_found_in_its_archive_from_its_own_folder(tmp_path, monkeypatch):
    program = tmp_path / "R1" / "Program" / "job.src"
    for path in (program, tmp_path / "R1" / "System" / "$config.dat"):
        path.parent.mkdir(parents=True)
        path.write_bytes(b"")
    monkeypatch.chdir(program.parent)
    assert find_shared("job.src") == find_shared(program) != ()
