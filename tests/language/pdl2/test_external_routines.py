"""Routines that are not at hand: what is known of them, and what they leave unknown."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from postproc.language.language import JobReading, Start
from postproc.language.pdl2.external_routines import list_motionless
from postproc.language.pdl2.interpreter import resolve
from postproc.language.pdl2.program import parse
from postproc.language.text.source import Source
from postproc.language.visits import ELSEWHERE, START
from tests.language.pdl2.test_opaque_calls import handler, program, routine

FIRST = "MOVE LINEAR TO POS(1, 2, 3, 0, 180, 0, '')"
THEN = "MOVE LINEAR TO POS(9, 2, 3, 0, 180, 0, '')"
JOINTS = "MOVE JOINT TO {1, 2, 3, 4, 5, 6}"
HEAD = [
    "VAR n : INTEGER",
    "ROUTINE tt_tool(a : INTEGER) : INTEGER EXPORTED FROM TT_lib",
]


def followed(*body: str, head: list[str] = HEAD, **said: object) -> JobReading:
    text = program("job", head, list(body))
    return resolve(parse(Source("job.pdl", text.encode())), Start(**said))  # type: ignore[arg-type]


def reasons(found: JobReading) -> list[str]:
    return [found.visits.reasons[k].text for k in found.visits.reason.tolist()]


def codes(found: JobReading) -> list[str]:
    return [d.code for d in found.diagnostics]


CALLS = ("tt_tool(1)", "n := tt_tool(1)", "IF tt_tool(1) = 1 THEN\nENDIF",
         "CALL TT_tool", "$par := tt_tool(1)", "set_tool(2)", "ToolFrame",
         "update_tool")  # fmt: skip


@pytest.mark.parametrize("call", CALLS)
@pytest.mark.parametrize("target", [THEN, JOINTS])
def test_targets_after_an_unknown_routine_are_left(call: str, target: str) -> None:
    found = followed(FIRST, call, target)
    before, after = reasons(found)
    assert before == ""
    assert "not known here" in after and "$TOOL" in after and "[routines]" in after
    assert found.visits.graph.predecessors(1).tolist() == [ELSEWHERE]
    assert codes(found) == ["unknown-routine"]


def test_what_is_to_be_pasted_is_said_once_and_helps() -> None:
    body = [FIRST, "tt_tool(1)", THEN, "tt_tool(2)", THEN]
    found = followed(*body)
    (said,) = found.diagnostics
    (line,) = re.findall(r'tt_tool = "motionless"', said.message)
    assert said.line == 6 and "[frames.routines.tt_tool]" in said.message
    name, what = line.replace('"', "").split(" = ")
    assert reasons(followed(*body, routines={name: what})) == [""] * 3


def test_frames_that_are_set_again_are_known() -> None:
    frames = [f"${name} := POS(1, 2, 3, 0, 0, 0, '')" for name in
              ("TOOL", "BASE", "UFRAME")]  # fmt: skip
    found = followed(FIRST, "tt_tool(1)", *frames, THEN)
    assert reasons(found) == ["", ""]
    assert found.visits.graph.predecessors(1).tolist() == [ELSEWHERE]


def test_settings_that_the_program_has_made_are_forgotten() -> None:
    found = followed("$MOVE_TYPE := LINEAR", "tt_tool(1)", THEN.replace("LINEAR ", ""))
    assert "$MOVE_TYPE" in reasons(found)[0]


@pytest.mark.parametrize(
    ("patterns", "still"),
    [
        (("tt_*",), True),
        (("TT_Tool",), True),
        (("tt_lib.*",), True),
        (("*.tt_tool",), True),
        (("tt_lib",), False),
        (("tt",), False),
        (("other.*",), False),
        ((), False),
    ],
)
def test_patterns_of_the_cell(patterns: tuple[str, ...], still: bool) -> None:
    found = followed(FIRST, "tt_tool(1)", THEN, motionless=patterns)
    assert (reasons(found)[1] == "") is still
    assert codes(found) == ([] if still else ["unknown-routine"])


def test_a_pattern_means_the_one_program_that_is_imported() -> None:
    one = ["IMPORT 'TT_lib'"]
    for head, still in ((one, True), ([*one, "IMPORT 'b'"], False)):
        found = followed(FIRST, "tt_tool(1)", THEN, head=head, motionless=("tt_lib.*",))
        assert (reasons(found)[1] == "") is still


def test_what_the_cell_says_by_name_holds_against_its_patterns() -> None:
    found = followed(FIRST, "tt_tool(1)", THEN, motionless=("*",),
                     routines={"TT_lib.tt_tool": "moves"})  # fmt: skip
    assert found.visits.graph.predecessors(1).tolist() == [ELSEWHERE]
    assert reasons(found)[1] == ""


def test_the_shipped_list_counts_unless_calls_are_strict() -> None:
    body = [FIRST, "spot(1)", THEN]
    assert reasons(followed(*body)) == ["", ""]
    assert codes(followed(*body)) == ["routine-assumed-motionless"]
    strict = followed(*body, assume_motion=True)
    assert reasons(strict)[1] and codes(strict) == ["unknown-routine"]
    assert reasons(followed(*body, assume_motion=True, motionless=("spot",))) == [
        "",
        "",
    ]


def test_the_shipped_list_names_no_routine_that_sets_frames_or_moves() -> None:
    assert all(re.fullmatch(r"[a-z_]\w*", name) for name in list_motionless())
    wrong = re.compile(r"tool|frame|base|home|move|park|change|dock|^tf$|^rtf$")
    assert not [name for name in list_motionless() if wrong.search(name)]


def test_the_page_lists_the_shipped_list() -> None:
    page = Path(__file__).parents[3] / "docs" / "routines.md"
    section = page.read_text("utf-8").split("\n## ")[2]
    rows = [row for row in section.splitlines() if row.startswith("| ")]
    listed = [name for row in rows for name in re.findall(r"`(\w+)`", row)]
    assert sorted(listed) == sorted(list_motionless())


def test_built_in_routines_are_known() -> None:
    body = ["n := prog_state('x')", "err_post(1, 'x')", "bit_set(n, 1)", "n := abs(n)"]
    found = followed(FIRST, *body, THEN, assume_motion=True)
    assert reasons(found) == ["", ""] and codes(found) == []


def test_a_function_that_calls_one_leaves_the_same_unknown() -> None:
    inner = routine("f", "tt_tool(1)", "RETURN(1)", takes=": INTEGER")
    inner = ["VAR n : INTEGER", *inner]
    found = followed(FIRST, "n := f", THEN, head=inner)
    assert "$TOOL" in reasons(found)[1]
    assert "unknown-routine" in codes(found)
    found = followed(FIRST, "n := f", THEN, head=inner, motionless=("tt_*",))
    assert reasons(found) == ["", ""]


def test_a_handler_that_calls_one_may_change_all_at_any_time() -> None:
    found = followed(*handler("tt_tool(1)"), FIRST)
    assert "a condition handler" in reasons(found)[0]
    assert ELSEWHERE in found.visits.graph.predecessors(0).tolist()
    assert "unknown-routine" in codes(found)
    still = followed(*handler("tt_tool(1)"), FIRST, motionless=("tt_tool",))
    assert reasons(still) == [""]
    assert still.visits.graph.predecessors(0).tolist() == [START]
