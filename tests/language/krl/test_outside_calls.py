"""Programs that others call begin with frames and from places that are not known."""

from __future__ import annotations

import pytest

from postproc.files import FolderListing
from postproc.language.krl.language import Krl
from postproc.language.krl.other_programs import find_other_programs
from postproc.language.language import Start
from postproc.language.text.source import Source
from tests.language.krl.test_visits import CONFIG, DATA, reasons

HOME = "PTP {A1 0,A2 -90,A3 90,A4 0,A5 10,A6 0}"
PLAIN = "\n".join(
    line for line in DATA.splitlines() if "#TCP" not in line and "#JOINT" not in line
)
FRAMES = ["$TOOL=TOOL_DATA[1]", "$BASE=BASE_DATA[2]"]


def read(lines, other, more=""):
    texts = {
        "m.src": "DEF m( )\n{}\nEND\n{}".format("\n".join(lines), more),
        "m.dat": f"DEFDAT m PUBLIC\n{PLAIN}\nENDDAT\n",
        "$config.dat": CONFIG,
        "PROGRAMS/o.src": f"DEF o( )\n{other}\nEND\n",
    }
    sources = [Source(name, text.encode()) for name, text in texts.items()]
    return Krl().read(sources, Start())


CALLS = [
    "m( )",
    "IF $IN[1] THEN\nm( )\nENDIF",
    "INTERRUPT DECL 5 WHEN $IN[1] DO m( )",
    "TRIGGER WHEN DISTANCE=0 DELAY=0 DO m( ) PRIO=-1",
]


@pytest.mark.parametrize("call", CALLS)
def test_frames_of_who_calls_are_not_known(call):
    found = read(["LIN XP1"], call)
    assert any("M is called by o.src (line 2)" in d.message or
               "M is called by o.src (line 3)" in d.message
               for d in found.diagnostics)  # fmt: skip
    assert all(reasons(found))


def test_what_it_sets_itself_is_known():
    frames = ["BAS(#INITMOV,0)", "BAS(#TOOL,1)", "BAS(#BASE,2)"]
    assert reasons(read([*frames, HOME, "LIN XP1"], "m( )")) == ["", ""]


LOAD = "$LOAD={M 5,CM {X 0,Y 0,Z 0,A 0,B 0,C 0},J {X 0,Y 0,Z 0}}"


@pytest.mark.parametrize(
    ("other", "known"),
    [
        ("m( )", True),
        ("$ORI_TYPE=#VAR\n$IPO_MODE=#BASE\nm( )", True),
        ("SLIN XP1 WITH $IPO_MODE=SIPO_MODE(FP1.IPO_FRAME)\nm( )", True),
        ("$ORI_TYPE=#CONSTANT\nm( )", False),
        ("$IPO_MODE = #TCP\nm( )", False),
        ("$ORI_TYPE=how\nm( )", False),
        ("LDAT_ACT={VEL 2.0,ACC 100.0,ORI_TYP #JOINT}\nm( )", False),
    ],
)
def test_modes_are_known_that_no_program_sets(other, known):
    found = reasons(read([*FRAMES, LOAD, HOME, "LIN XP1"], other))
    assert (found == ["", ""]) == known


def test_modes_that_it_leaves_itself_are_those_of_its_next_call():
    lines = [*FRAMES, LOAD, HOME, "LIN XP1", "$ORI_TYPE=#JOINT"]
    assert reasons(read(lines, "m( )"))[1]


@pytest.mark.parametrize("other", ["LIN XP1", "x( )", "m2( )"])
def test_a_program_that_nothing_calls_begins_as_the_cell_says(other):
    found = read([HOME, "LIN XP1"], other)
    assert reasons(found) == ["", ""]


def test_a_global_routine_is_called_from_elsewhere_too():
    own = "GLOBAL DEF weld( )\nLIN XP1\nEND\n"
    lines = [*FRAMES, HOME, "weld( )"]
    assert reasons(read(lines, "m2( )", own)) == ["", ""]
    assert any(reasons(read(lines, "weld( )", own)))
    own = own.removeprefix("GLOBAL ")
    assert reasons(read(lines, "weld( )", own)) == ["", ""]


def test_pages_that_another_folder_calls_begin_anywhere_too(tmp_path):
    texts = {
        "System/$config.dat": CONFIG,
        "Program/m.src": "DEF m( )\npart( )\nEND\n",
        "Program/part.src": "DEF part( )\nLIN XP1\nEND\n",
        "Program/sub/o.src": "DEF o( )\npart( )\nEND\n",
    }
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    found = find_other_programs(tmp_path / "Program/m.src", FolderListing())
    assert [path.name for path in found] == ["o.src"]


@pytest.mark.parametrize("folder", ["Program", "Program/weld"])
@pytest.mark.parametrize(
    ("call", "expected"), [("m( )", ["o.src"]), ("weld( )", ["o.src"]), ("x( )", [])]
)
def test_programs_that_call_are_read(tmp_path, folder, call, expected):
    texts = {
        "System/$config.dat": CONFIG,
        "Program/m.src": "DEF m( )\nLIN XP1\nEND\nGLOBAL DEF weld( )\nLIN XP1\nEND\n",
        f"{folder}/o.src": f"DEF o( )\n{call}\nEND\n",
    }
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    found = find_other_programs(tmp_path / "Program/m.src", FolderListing())
    assert [path.name for path in found] == expected
