"""Records and paths of variable files: which of their values are read."""

import math

import numpy as np
import pytest

from postproc.language.language import JobReading, Start
from postproc.language.pdl2.clones import copy_entry
from postproc.language.pdl2.interpreter import resolve
from postproc.language.pdl2.pose_encoding import PDL2_DIALECT
from postproc.language.pdl2.program import parse
from postproc.language.pdl2.variable_file import VariableFile, read_variables
from postproc.language.text.number_edits import edits
from postproc.language.text.source import CloneError, apply, source_from_bytes

HEAD = """PROGRAM job
VAR pth, other : PATH OF nd
  r : rt
  rec : ARRAY[2] OF rt
  p, q : POSITION
  n : INTEGER
ROUTINE go(x : nd)
BEGIN
  MOVE LINEAR TO x
END go
BEGIN
"""
UNKNOWN = -1
CELL = Start(aux={1: "gun"}, routines={"outside": "motionless"})


def place(x: float) -> str:
    """Write the value of a position."""
    return f" X: {x:.2f}  Y: 2.00  Z: 3.00  A: 4.00  E: 5.00  R: 6.00\n CNFG: ''\n"


def path(*nodes: str, head: str = "pth PATH nd Priv") -> str:
    """Write a path whose nodes have one position each, at x = 1, 2, .."""
    parts = [
        f" {node}\n $MAIN_POS POS\n{place(k)}" for k, node in enumerate(nodes, start=1)
    ]
    return "".join([f"{head}\n", *parts])


def read(text: str) -> VariableFile:
    return read_variables(source_from_bytes("job.lsv", text.encode("latin-1")))


def followed(values: str, *lines: str) -> JobReading:
    text = HEAD + "\n".join([*lines, "END job"])
    program = parse(source_from_bytes("job.pdl", text.encode()))
    return resolve(program, CELL, read(values))


def known(found: JobReading) -> list[float | int]:
    """Return x of every target that may be edited, UNKNOWN for all others."""
    v = found.visits
    free = [k >= 0 and not v.literals.pinned[k] for k in v.target.literal.tolist()]
    x = v.target.values[:, 0].tolist()
    return [x[i] if free[i] and not v.reasons[v.reason[i]].text else UNKNOWN
            for i in range(len(v))]  # fmt: skip


def first_numbers(variables: VariableFile) -> dict[str, float | None]:
    entries = variables.entries
    return {name: entries.numbers_of(row)[0] for name, row in entries.row.items()}


@pytest.mark.parametrize(
    "nodes",
    [
        ("NODE[1]", "NODE[2]"),
        ("NODE[1]:", "NODE [2]:"),
        ("node[1]", "Node [2] :"),
        ("[1]", "[2]"),
        ("[1]:", " [ 2 ] :"),
    ],
)
def test_forms_of_a_node_line(nodes):
    read_ = first_numbers(read(path(*nodes)))
    assert read_ == {"pth.node[1].$main_pos": 1.0, "pth.node[2].$main_pos": 2.0}


def test_fields_are_no_variables_and_variables_no_fields():
    text = (
        "p POS Priv\n" + place(1) + path("NODE[1]") + " p POS\n" + place(8)
        + "rec AREC[2] rt Priv\n [1]:\n p POS\n" + place(9)
        + "r REC rt Priv\n p POS\n" + place(10) + " k INT\n 3\n"
        + "q POS Priv\n" + place(5) + "?!?\n" + place(6)
    )  # fmt: skip
    variables = read(text)
    assert first_numbers(variables) == {
        "p": 1.0, "pth.node[1].$main_pos": 1.0, "pth.node[1].p": 8.0,
        "rec[1].p": 9.0, "r.p": 10.0, "r.k": 3.0, "q": 5.0,
    }  # fmt: skip
    assert [d.code for d in variables.diagnostics] == ["lsv-line"]


def test_values_on_the_line_of_the_field():
    text = (
        "pth PATH nd Priv\nNODE[1]\n"
        "$MAIN_JNTP JNTP Arm: 1 Ax: 7 1: 1.5 2: 0 3: -90 4: 0 5: 60 6: 0 7: 90\n"
        "NODE[2]\n$MAIN_XTND XTND Arm: 1 Ax: 1 X: 2 Y: 3 Z: 4 A: 5 E: 6 R: 7 1: 45\n"
    )
    entries = read(text).entries
    names = "pth.node[1].$main_jntp", "pth.node[2].$main_xtnd"
    first, second = (entries.row[name] for name in names)
    assert entries.numbers_of(first) == (1.5, 0, -90, 0, 60, 0)
    assert entries.aux_of(first) == ((1, 90.0),)
    assert entries.aux_of(second) == ((1, 45.0),)
    found = followed(text, "MOVE JOINT TO pth.NODE[1]", "MOVE LINEAR TO pth.NODE[2]")
    assert known(found) == [1.5, 2.0]


@pytest.mark.parametrize(
    ("entry", "why"),
    [
        (path("NODE[1]", "NODE[2]") + " NODE[3] = 7\n", "not understood"),
        (path("NODE[1]") + " [2]\n $MAIN_POS POS\n" + place(2), "may be a part"),
        ("pth PATH nd Priv\n $MAIN_POS POS\n" + place(1), "before the first part"),
        ("pth PATH nd Priv\n NODE[1]\n" + place(1), "whose value"),
        (path("NODE[1]", head="pth PATH nd"), "whose it is"),
        (path("NODE[1]") + " X: 9\n FALSE\n", "no value of $MAIN_POS"),
        (path("NODE[1]") + " 7.00\n", "no value of $MAIN_POS"),
        (path("NODE[1.5]"), "no whole number"),
        (path("NODE[1]", head="pth APATH nd Priv"), "not read"),
        (path("[1]") + " t AINT[2]\n [1]: 3\n [2]: 4\n", "may be a part"),
        ("r REC rt Priv\n p POS\n" + place(1) + " [1]:\n", "no such parts"),
        ("r REC rt Priv\n NODE[1]\n p POS\n" + place(1), "no such parts"),
    ],
)
def test_an_odd_line_leaves_the_whole_entry_unread(entry, why):
    variables = read("p POS Priv\n" + place(8) + entry + "q POS Priv\n" + place(9))
    assert first_numbers(variables) == {"p": 8.0, "q": 9.0}
    (found,) = variables.diagnostics
    assert found.code == "lsv-parts"
    assert found.message.startswith(entry[: entry.index(" ")])
    assert why in found.message


@pytest.mark.parametrize(
    ("more", "why"),
    [
        (" p POS\n" + place(7) + " p POS\n" + place(8), "p is there twice"),
        (" sub REC st\n p POS\n" + place(7), "sub has parts"),
        (" $JNT_OVR AINT[2]\n [1]: 5\n [2]: 6\n", "$JNT_OVR has parts"),
        (" NODE[1]\n q POS\n" + place(7), "NODE[1] is there twice"),
    ],
)
def test_a_node_that_is_not_sure_is_left_out(more, why):
    text = path("NODE[1]") + more + path("NODE[3]").partition("\n")[2]
    variables = read(text + "q POS Priv\n" + place(9))
    assert set(variables.entries.row) == {"pth.node[3].$main_pos", "q"}
    (found,) = variables.diagnostics
    assert why in found.message


def test_elements_of_a_field_are_not_nodes():
    text = path("NODE[1]") + " t AINT[2]\n [1]: 5\n [2]: 6\n x POS\n" + place(7)
    variables = read(text)
    assert first_numbers(variables) == {"pth.node[1].$main_pos": 1.0}
    assert "and 1 more" in variables.diagnostics[0].message


def test_a_name_that_a_path_and_something_else_have_is_neither():
    variables = read(path("NODE[1]") + "pth POS Priv\n" + place(5))
    assert not variables.entries.row
    assert {d.code for d in variables.diagnostics} == {"lsv-duplicate"}


def test_too_many_values_are_none():
    text = path("NODE[1]") + " X: 7.00\n"
    variables = read(text)
    row = variables.entries.row["pth.node[1].$main_pos"]
    assert all(map(math.isnan, variables.entries.numbers_of(row)))
    assert [d.code for d in variables.diagnostics] == ["lsv-too-many"]


def test_node_lines_belong_to_paths_only():
    variables = read("q POS Priv\n" + place(5) + "pth PTH nd Priv\n NODE[1]\n")
    assert first_numbers(variables) == {"q": 5.0}
    assert [d.code for d in variables.diagnostics] == ["lsv-line"] * 2


def test_a_node_of_its_own_settings_is_not_gone_to_as_a_whole():
    text = path("NODE[1]") + " $LIN_SPD REA\n 0.5\n"
    found = followed(text, "MOVE LINEAR TO pth.NODE[1]", "MOVE LINEAR TO q")
    assert "settings of its own ($LIN_SPD, $MAIN_POS)" in found.visits.reasons[1].text
    assert known(followed(text, "MOVE LINEAR TO pth.NODE[1].$MAIN_POS")) == [1.0]


def test_a_node_with_two_positions_keeps_both():
    text = path("NODE[1]") + " $MAIN_XTND XTND Arm: 1 Ax: 1\n" + place(7)
    moves = [
        f"MOVE LINEAR TO pth.NODE[1]{f}" for f in ("", ".$MAIN_POS", ".$MAIN_XTND")
    ]
    assert known(followed(text, *moves[1:])) == [1.0, 7.0]
    assert known(followed(text, *moves)) == [UNKNOWN] * 3


USES = (
    "node_app(pth, 1)",
    "NODE_DEL(pth, 1)",
    "node_ins(pth, 1)",
    "outside(pth)",
    "MOVE LINEAR TO pth.NODE[n]",
    "pth.NODE[n] := other.NODE[1]",
    "pth.NODE[n].$MAIN_POS := q",
    "READ lun (pth)",
    "MOVE ALONG pth",
    "MOVE ALONG pth[1..2]",
    "MOVE ARM[2] ALONG pth",
)


@pytest.mark.parametrize("use", USES)
def test_what_may_use_or_change_any_node_keeps_them_all(use):
    moves = ["MOVE LINEAR TO pth.NODE[1]", "MOVE LINEAR TO pth.NODE[2].$MAIN_POS"]
    values = path("NODE[1]", "NODE[2]") + path("NODE[1]", head="other PATH nd Priv")
    last = "MOVE LINEAR TO other.NODE[1]"
    assert known(followed(values, *moves, last)) == [1.0, 2.0, 1.0]
    found = known(followed(values, *moves, use, *moves, last))
    assert set(found[:-1]) == {UNKNOWN}
    if "other" not in use:
        assert found[-1] == 1.0


@pytest.mark.parametrize("builtin", ["node_app", "node_del", "node_ins"])
def test_built_ins_leave_no_node_known(builtin):
    found = followed(path("[1]:"), f"{builtin}(pth, 1)", "MOVE LINEAR TO pth.NODE[1]")
    assert found.visits.target.literal.tolist() == [UNKNOWN]


def test_assignments_replace_what_the_file_says():
    values = path("NODE[1]", "NODE[2]", "NODE[3]")
    found = followed(
        values,
        "pth.NODE[1].$MAIN_POS := POS(9, 2, 3, 4, 5, 6, '')",
        "pth.NODE[2] := pth.NODE[3]",
        "MOVE LINEAR TO pth.NODE[1]",
        "MOVE LINEAR TO pth.NODE[2]",
        "go(pth.NODE[3])",
    )
    assert known(found) == [9.0, 3.0, 3.0]
    v = found.visits
    assert [v.target.names[k] for k in v.target.name] == [
        "pth.NODE[1].$MAIN_POS", "pth.NODE[3].$MAIN_POS", "pth.NODE[3].$MAIN_POS",
    ]  # fmt: skip


def test_a_joint_of_a_field_that_is_assigned_counts():
    joints = " 1: 1 2: 0 3: -90 4: 0 5: 60 6: 0\n"
    values = f"r REC rt Priv\n j JNTP Arm: 1 Ax: 6\n{joints}"
    found = followed(values, "r.j[1] := 7", "MOVE JOINT TO r.j").visits
    assert found.target.values[0].tolist() == [7, 0, -90, 0, 60, 0]
    assert found.target.literal.tolist() == [UNKNOWN]


def test_what_a_head_says_holds_for_all_parts():
    values = path("NODE[1]", head="pth PATH nd Xport")
    found = followed(values, "MOVE LINEAR TO pth.NODE[1]").visits
    assert found.literals.shared.tolist() == [True]
    values = path("NODE[1]", head="pth PATH nd Arm: 2 Priv")
    found = followed(values, "MOVE LINEAR TO pth.NODE[1]").visits
    assert found.target.literal.tolist() == [UNKNOWN]
    assert "arm 2" in found.reasons[found.reason[0]].text


def test_edits_hit_their_node_and_nothing_else():
    values = path("NODE[1]", "NODE[2]", "NODE[3]").replace("\n", "\r\n")
    found = followed(values, "MOVE LINEAR TO pth.NODE[2]").visits
    files = (source_from_bytes("job.pdl", HEAD.encode()),
             source_from_bytes("job.lsv", values.encode()))  # fmt: skip
    new = found.target.values + np.array([0.5, 0, 0, 0, 0, 0])
    _, own = edits(found.literals, files, found.target.literal, new, PDL2_DIALECT)
    assert apply(values.encode(), own) == values.replace("X: 2.00", "X: 2.500").encode()


def test_a_field_is_no_entry_to_copy_for_the_variable_of_its_name():
    text = "r REC rt Priv\np POS\n" + place(1) + "p POS Priv\n" + place(2)
    values = source_from_bytes("job.lsv", text.encode())
    with pytest.raises(CloneError, match=r"line 3 of job\.lsv is no entry of p"):
        copy_entry(values, 3, "p", "p__2", [])
    with pytest.raises(CloneError, match="r is a record or a path"):
        copy_entry(values, 3, "r", "r__2", [])
    copy = copy_entry(values, 6, "p", "p__2", [])
    assert apply(values.data, [copy]).decode() == text + "p__2 POS Priv\n" + place(2)
