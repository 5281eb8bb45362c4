"""Moves that get no points on their ways."""

from __future__ import annotations

import pytest

from tests.written import cli

MOVES = (
    "MOVE JOINT TO {5.0, 10.0, -95.0, 20.0, 50.0, 30.0}",
    "MOVE JOINT TO POS(100.0, 200.0, 150.0, 0.0, 175.0, 0.0, '')",
    "MOVE LINEAR TO POS(150.4, 292.0, 201.4, 0.0, 175.0, 0.0, '')",
    "MOVE LINEAR TO POS(153.0, 194.3, 223.0, 0.0, 175.0, 0.0, '')",
)


WORDS = ("one of its ends is taught", "it weaves, or may", "states the payload")


@pytest.mark.parametrize(("line", "why"), [
    ("", ""), ("-- TAUGHT", WORDS[0]), ("$WEAVE_NUM := 1", WORDS[1]),
    ("$WEAVE_TYPE := 1", WORDS[1]), ("$WEAVE_NUM := 0", ""),
    ("$TOOL_MASS := 0.2", WORDS[2]),
])  # fmt: skip
def test_taught_ends_and_weaving_moves_stay_in_one_piece(desk, line, why):
    lines = [*MOVES[:3], line, MOVES[3]]
    if line.startswith("--"):
        lines = [*MOVES[:2], f"{MOVES[2]} {line}", MOVES[3]]
    job, out = desk.folder / "job.pdl", desk.folder / "out.pdl"
    text = "\n".join(["PROGRAM job", "VAR n : INTEGER", "BEGIN", *lines, "END job", ""])
    job.write_text(text)
    given = ("--cell", desk.cell, "--model", desk.model, "-o", out)
    found = cli("compensate", job, *given, "--path-tolerance", "0.01")
    words = [word for word in WORDS if word in found.stderr]
    assert words == ([why] if why else [])
    written = out.read_text().splitlines()
    assert not why or "inserted" not in written[written.index("END job") - 2]


def test_a_move_says_why_its_end_is_not_corrected(desk) -> None:
    job, out, cell = (
        desk.folder / name for name in ("job.pdl", "out.pdl", "cell.toml")
    )
    job.write_text("\n".join(["PROGRAM job", "BEGIN", *MOVES, "END job", ""]))
    cell.write_text(desk.cell.read_text() + "\n[limits]\nelbow_mm = 0.001\n")
    given = ("--cell", cell, "--model", desk.model, "-o", out)
    found = cli("compensate", job, *given, "--path-tolerance", "0.01")
    said = " ".join(found.stderr.split())
    assert "its end is not corrected: corrected, the elbow would move by more" in said
