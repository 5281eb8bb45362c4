"""Sources of packages that people write in: they count for what they do."""

from __future__ import annotations

import pytest

from postproc.files import FolderListing
from postproc.language.krl.user_sources import acting_sources
from tests.language.krl.test_visits import job, names, reasons

FRAMES = ["BAS(#TOOL,1)", "BAS(#BASE,2)", "PTP XP1"]
HEAD = "DEF  USERSPOT(CMD :IN )\nINT CMD\n"
QUIET = f"{HEAD}$OUT[3]=TRUE ; LIN XP1\nSWITCH CMD\nCASE 1\nPULSE($OUT[4],TRUE,0.1)\n"
QUIET += "ENDSWITCH\nEND\n"
ACTING = {
    "move": "LIN {X 1,Y 2,Z 9,A 0,B 0,C 180,S 2,T 35}",
    "step": "  lin_rel {z 5}",
    "base": "$BASE=BASE_DATA[3]",
    "load": "$LOAD.M=9",
    "frames": "BAS (#BASE,3)",
    "call": "dress( )",
    "interrupt": "BRAKE",
}


def acting(program):
    return acting_sources(program, FolderListing())


def written(line):
    return f"{HEAD}{line}\nEND\n"


PLACES = ["P/USERSPOT.SRC", "P/userspot.src", "System/Userspot.src"]


@pytest.mark.parametrize("place", PLACES)
def test_what_moves_or_sets_is_read(tmp_path, place):
    for name in ("P", "System"):
        (tmp_path / name).mkdir()
    (tmp_path / "System/$config.dat").write_text("DEFDAT $CONFIG\nENDDAT\n")
    program, own = tmp_path / "P/job.src", tmp_path / place
    for line in ACTING.values():
        own.write_text(written(line))
        assert [p.name for p in acting(program)] == [own.name], line
    own.write_text(QUIET)
    assert acting(program) == ()
    own.write_text("DEF other( )\nLIN XP1\nEND\n")
    assert acting(program) == () == acting(own)


COLUMNS = {"base": "uframe", "frames": "uframe", "load": "load"}


@pytest.mark.parametrize("kind", COLUMNS)
def test_what_it_sets_holds_behind_it(kind):
    sources = [("userspot", written(ACTING[kind]))]
    found = job(*FRAMES, "USERSPOT(1)", "LIN XP2", others=sources)
    first, last = found.visits.columns[COLUMNS[kind]].tolist()
    assert reasons(found) == ["", ""] and first != last


def test_its_numbers_stay():
    moves = written(ACTING["move"])
    found = job(*FRAMES, "USERSPOT(1)", "LIN XP2", others=[("userspot", moves)])
    pins = [why for why in found.visits.literals.pins if why]
    assert len(names(found)) == 3 and len(pins) == 1 and "system file" in pins[0]
    unused = job(*FRAMES, "LIN XP2", others=[("userspot", moves)])
    assert "never-reached" not in {d.code for d in unused.diagnostics}
