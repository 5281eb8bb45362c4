"""Speeds of the cell hold where a program sets none, and the findings say so."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.compensation.program import read_program
from postproc.robot.cell import load_cell
from tests.compensation.paths.test_path_error import CELL
from tests.written import FIRST, POSE, program

MOTION = "[motion]\nlinear_mm_s = 120.0\noverride = 50.0\n"


@pytest.mark.parametrize(
    ("lines", "speed", "share"),
    [
        ((), 0.12, 0.5),
        (("$LIN_SPD := 0.25",), 0.25, 0.5),
        (("$LIN_SPD := fast",), np.nan, 0.5),
        (("$GEN_OVR := 80",), 0.12, 0.8),
        (("$PROG_SPD_OVR := 10",), 0.12, 0.05),
    ],
)
def test_the_speed_of_the_cell_holds_until_a_program_sets_one(
    tmp_path, lines: tuple[str, ...], speed: float, share: float
) -> None:
    place = tmp_path / "cell.toml"
    place.write_text(MOTION + CELL.read_text())
    text = program(FIRST, *lines, POSE, declared="fast : REAL")
    visits = read_program({"job.pdl": text}, load_cell(place)).visits
    np.testing.assert_allclose(visits.speed.linear[-1], speed)
    np.testing.assert_allclose(visits.speed.override[-1], share)


def test_without_one_it_is_not_known() -> None:
    visits = read_program({"job.pdl": program(FIRST, POSE)}, load_cell(CELL)).visits
    assert np.isnan(visits.speed.linear[-1])
