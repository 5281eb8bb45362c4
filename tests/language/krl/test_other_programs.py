"""Other programs that change what all programs of a controller share."""

from __future__ import annotations

import pytest

from postproc.compensation.program_files import find_pages
from postproc.files import FolderListing
from postproc.language.krl.language import Krl
from postproc.language.krl.other_programs import find_other_programs
from postproc.language.language import Start
from postproc.language.text.source import Source
from tests.language.krl.test_visits import CONFIG, DATA, reasons

FRAMES = ["$TOOL=TOOL_DATA[1]", "$BASE=BASE_DATA[2]", "LIN XP1"]
SET = ["BASE_DATA[2]={X 9,Y 0,Z 0,A 0,B 0,C 0}"]
SHARED = DATA.replace("DECL E6POS XP1", "DECL GLOBAL E6POS XP1")


def read(lines, other, values="", data=DATA, constant=()):
    files = {
        "m.src": "DEF m( )\n{}\nEND\n".format("\n".join(lines)),
        "m.dat": f"DEFDAT m PUBLIC\n{data}\nENDDAT\n",
        "$config.dat": CONFIG,
        "PROGRAMS/o.src": f"DEF o( )\n{other}\nEND\n",
        "PROGRAMS/o.dat": f"DEFDAT o\n{values}\nENDDAT\n",
    }
    sources = [Source(name, text.encode()) for name, text in files.items()]
    return Krl().read(sources, Start(constant=constant))


@pytest.mark.parametrize(
    ("change", "data"),
    [
        ("BASE_DATA[2]={X 1,Y 2,Z 3,A 0,B 0,C 10}", DATA),
        ("IF $IN[1] THEN\nBASE_DATA[2].Z=5\nENDIF", DATA),
        ("BASE_DATA[i]=$NULLFRAME", DATA),
        ("calibrate(BASE_DATA[2])", DATA),
        ("TRIGGER WHEN DISTANCE=0 DELAY=0 DO BASE_DATA[2].X=1", DATA),
        ("XP1.Z=$POS_ACT.Z", SHARED),
    ],
)
def test_what_another_program_changes_is_not_known(change, data):
    (why,) = reasons(read(FRAMES, change, data=data))
    assert "may be changed by o.src (line" in why


@pytest.mark.parametrize(
    ("change", "values", "data"),
    [
        ("BASE_DATA[3]=$NULLFRAME", "", DATA),
        ("$BASE=BASE_DATA[2]\nPTP XHOME", "", DATA),
        ("XP1.Z=5", "", DATA),
        ("XP1.Z=5", "DECL E6POS XP1={X 1}", SHARED),
    ],
)
def test_what_is_not_shared_does_no_harm(change, values, data):
    assert reasons(read(FRAMES, change, values, data)) == [""]


@pytest.mark.parametrize(
    ("constant", "known"),
    [("base_data[2]", True), ("base_data", True), ("base_*", True),
     ("base_data[1]", False), ("tool_data", False)],
)  # fmt: skip
def test_what_the_cell_calls_constant_is_known(constant, known):
    (why,) = reasons(read(FRAMES, "BASE_DATA[2].X=5", constant=(constant,)))
    assert (why == "") == known


def test_an_index_that_is_not_known_may_be_any():
    found = read(FRAMES, "BASE_DATA[i].X=5", constant=("base_data[2]",))
    assert reasons(found) != [""]


def test_the_change_of_the_element_is_named():
    other = "BASE_DATA[4].X=1\nBASE_DATA[2].X=1"
    (why,) = reasons(read(FRAMES, other))
    assert "o.src (line 3)" in why


def test_what_a_program_sets_by_itself_is_known():
    assert reasons(read(SET + FRAMES, "BASE_DATA[2].X=5")) == [""]


@pytest.mark.parametrize("change", ["XQ.Z=5", "LIN XQ"])
def test_imported_points_are_shared(change):
    found = read(FRAMES, change, "IMPORT E6POS XQ IS /R1/m..XP1")
    (why,) = reasons(found)
    assert ("may be changed by o.src (line 2)" in why) == ("=" in change)
    assert found.visits.literals.shared.all()
    assert not read(FRAMES, change).visits.literals.shared.any()


@pytest.mark.parametrize("imported", [1, 2, 4])
def test_one_of_a_block_of_points_is_imported(imported):
    point = "DECL E6POS XP{0}={{X {0},Y 0,Z 0,A 0,B 0,C 0,S 2,T 35}}"
    data = "\n".join(point.format(k) for k in range(1, 9))
    lines = [*FRAMES[:2], *(f"LIN XP{k}" for k in range(1, 9))]
    source = f"IMPORT E6POS XQ IS /R1/m..XP{imported}"
    found = read(lines, "LIN XQ", source, data).visits
    shared = found.literals.shared[found.target.literal].tolist()
    assert shared == [k == imported for k in range(1, 9)]


OTHERS = {
    "frame": ({"o.src": "BASE_DATA[2].X=5"}, ["o.src"]),
    "frame of bas": ({"o.src": "BASE_CORR_ON=TRUE"}, ["o.src"]),
    "own list": ({"o.src": "XP1.X=5", "o.dat": "DECL E6POS XP1={X 1}"}, []),
    "no list": ({"o.src": "XP1.X=5"}, ["o.src"]),
    "its list": ({"o.src": "BASE_DATA[2].X=5", "o.dat": ""}, ["o.src", "o.dat"]),
    "read": ({"o.src": "$BASE=BASE_DATA[2]\nFDAT_ACT=FP1\nLIN XP1"}, []),
    "import": ({"o.src": "PTP XQ", "o.dat": "IMPORT E6POS XQ IS /R1/m..XP1"},
               ["o.src", "o.dat"]),
}  # fmt: skip


@pytest.mark.parametrize(("files", "expected"), OTHERS.values(), ids=OTHERS)
@pytest.mark.parametrize("folder", ["Program", "Program/weld"])
def test_programs_that_are_read(tmp_path, files, expected, folder):
    texts = {
        "System/$config.dat": CONFIG,
        "Program/m.src": "DEF m( )\nLIN XP1\nEND\n",
        "Program/m.dat": f"DEFDAT m PUBLIC\n{SHARED}\nENDDAT\n",
    }
    for name, text in files.items():
        kind = "DEF" if name.endswith(".src") else "DEFDAT"
        texts[f"{folder}/{name}"] = f"{kind} o( )\n{text}\nEND{kind[3:]}\n"
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    found = find_other_programs(tmp_path / "Program/m.src", FolderListing())
    assert [path.name for path in found] == expected


def test_a_program_that_is_called_is_a_page(tmp_path):
    (tmp_path / "m.src").write_text("DEF m( )\nset( )\nLIN XP1\nEND\n")
    (tmp_path / "set.src").write_text("DEF set( )\nBASE_DATA[1].X=5\nEND\n")
    pages = find_pages(tmp_path / "m.src")
    assert [path.name for path in pages.paths] == ["set.src"] and not pages.reads
