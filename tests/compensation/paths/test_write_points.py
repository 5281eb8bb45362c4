"""Points on ways: where they lie, and that nothing else of a program changes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from postproc.arrays import Floats
from postproc.compensation.output.equivalence import equivalent
from postproc.compensation.output.rewrite import VerificationError
from postproc.compensation.paths.backlash_preload import BacklashPreload
from postproc.compensation.paths.write_points import (
    PathPoints,
    between,
    insert,
    without,
)
from postproc.compensation.program import ParsedProgram, read_program
from postproc.language.pdl2.insert_moves import Pdl2Splitter
from postproc.language.pdl2.language import Pdl2
from postproc.language.pdl2.program import parse
from postproc.language.text.source import Edit
from postproc.robot.cell import load_cell
from tests.written import program

CELL = load_cell(Path(__file__).parents[3] / "programs/cell.toml")
NOTHING = np.zeros(0, dtype=np.int64)
TURNED = BacklashPreload(
    np.array([1.0, -1.0, 0.5, 0.0, 1.0, -1.0]), np.array([2e-4, 0.0, -1e-4]), (1, 2)
)
ENDS = (
    (100.0, 200.0, 150.0, 80.0, 160.0, 10.0),
    (300.0, 100.0, 50.0, 120.0, 140.0, -40.0),
)


def pos(numbers: tuple[float, ...]) -> str:
    return f"POS({', '.join(map(str, numbers))}, '')"


JOB = program(
    "MOVE JOINT TO {5.0, 10.0, -95.0, 20.0, 50.0, 30.0}",
    f"MOVE LINEAR TO {pos(ENDS[0])}",
    "IF $DIN[3] THEN",
    f"  MOVE LINEAR TO {pos(ENDS[1])} -- other",
    "  r := p",
    "ENDIF",
    "FOR i := 1 TO 2 DO",
    f"  MOVE JOINT TO {pos(ENDS[0])}",
    "ENDFOR",
    f"MOVE LINEAR TO {pos(ENDS[1])} WITH $LIN_SPD = 0.2",
    declared="p, r : POSITION\r\n  i : INTEGER",
)


def read() -> ParsedProgram:
    return read_program({"job.pdl": JOB}, CELL)


def last(reading: ParsedProgram) -> int:
    return int(
        np.flatnonzero(reading.visits.place.line == reading.visits.place.line.max())[0]
    )


def test_points_lie_on_the_line_and_turn_about_one_axis() -> None:
    visits = read().visits
    share = np.array([0.0, 0.25, 0.9, 1.0])
    found = between(visits, last(read()), share)
    first, second = map(np.array, ENDS)
    np.testing.assert_allclose(
        found[:, :3], first[:3] + share[:, None] * (second - first)[:3], atol=1e-9
    )
    turns = Rotation.from_euler("ZYZ", [e[3:] for e in ENDS], degrees=True)
    wanted = Slerp([0, 1], turns)(share).as_matrix()
    np.testing.assert_allclose(
        visits.dialect.poses(found)[:, :3, :3], wanted, atol=1e-9
    )


def test_a_program_with_points_is_the_same_without_them() -> None:
    reading = read()
    visit = last(reading)
    points = {visit: (0.1, 0.5), 2: (0.3,)}
    splitter = Pdl2().splitter(reading.sources)
    found, own = insert(reading, PathPoints(points, {visit: TURNED}), splitter, CELL)
    v, w = reading.visits, found.visits
    assert len(w) == len(v) + 3 == len(own) + 3
    new = np.setdiff1d(np.arange(len(w)), own)
    assert (
        equivalent(
            v, without(w, np.isin(np.arange(len(w)), new)), NOTHING, v.target.values
        )
        == ""
    )
    assert w.motion.fly[new].tolist() == [True, False, True]
    rounded: Floats = np.abs(
        w.target.values[new[1:]] - between(v, visit, np.array([0.1, 0.5]))
    )
    assert rounded[:, :3].max() < 1e-3 and rounded[1].max() < 1e-3
    turn = w.dialect.poses(
        np.vstack([between(v, visit, np.array([0.1])), w.target.values[new[1]]])
    )
    turned = Rotation.from_matrix(turn[0, :3, :3].T @ turn[1, :3, :3]).as_rotvec()
    np.testing.assert_allclose(turned, TURNED.turn, atol=2e-6)
    np.testing.assert_array_equal(found.aims[new[1]], TURNED.side)
    assert np.isnan(np.delete(found.aims, new[1], axis=0)).all()
    assert found.given == reading.sources and len(found.cloned[0]) == 2


@dataclass(frozen=True)
class Wrong(Pdl2Splitter):
    """Writes something else."""

    text: bytes = b""
    keeps: bool = True

    def points(self, *given: Any) -> Edit:
        edit = super().points(*given)
        return Edit(edit.span, edit.new * self.keeps + self.text)


def test_what_else_changes_is_found() -> None:
    reading = read()
    programs = [parse(source) for source in reading.sources]
    for text, keeps, said in (
        (b"  $LIN_SPD := 0.01\r\n", True, "another speed: linear"),
        (b"-- none\r\n", False, "0 of 1"),
        (b"  MOVE JOINT TO {1.0, 2.0, -80.0, 4.0, 5.0, 6.0}\r\n", True, "2 of 1"),
    ):
        wrong = Wrong(programs, text, keeps)
        with pytest.raises(VerificationError, match=said):
            insert(reading, PathPoints({2: (0.5,)}), wrong, CELL)
