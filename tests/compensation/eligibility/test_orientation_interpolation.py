"""$ORNT_TYPE: where another way of turning the tool may matter."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from postproc.compensation.program import plan_visits, read_program
from postproc.robot.cell import Cell, load_cell


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Cell:
    path: Path = tmp_path_factory.mktemp("cell") / "cell.toml"
    path.write_text('[robot]\narm = "nj220-2.7"\n')
    return load_cell(path)


def left(cell: Cell, kind: str, *moves: str) -> list[bool]:
    begin = "MOVE JOINT TO POS(1500, 0, 1700, 0, 150, 0, '')"
    lines = [f"$ORNT_TYPE := {kind}", begin, *moves]
    text = "\n".join(["PROGRAM job", "BEGIN", *lines, "END job"])
    visits = read_program({"job.pdl": text.encode()}, cell).visits
    reasons = plan_visits(visits, cell).reasons
    return ["$ORNT_TYPE" in reasons[i].text for i in range(1, len(visits))]


def line(y: float, a: float, e: float, r: float, word: str = "LINEAR") -> str:
    return f"MOVE {word} TO POS(1500, {y}, 1700, {a}, {e}, {r}, '')"


@pytest.mark.parametrize("kind", ["EUL_WORLD", "RPY_WORLD"])
def test_three_angles_in_proportion_are_followed_in_small_steps(
    cell: Cell, kind: str
) -> None:
    moves = [line(10, 0, 150, 0), line(20, 0.5, 150, 0.5), line(30, 10, 140, 0)]
    assert left(cell, kind, *moves) == [False, False, True]
    assert left(cell, "RS_WORLD", *moves) == [False] * 3
    assert left(cell, kind, line(30, 10, 140, 0, "JOINT")) == [False]


def test_euler_angles_near_0_and_180_deg(cell: Cell) -> None:
    down = line(10, 0, 180, 0)
    moves = [down, line(20, 0, 180, 40), line(30, 20, 180, 0), line(40, 30, 179.7, 0)]
    assert left(cell, "EUL_WORLD", *moves) == [True, False, False, True]
    assert left(cell, "EUL_WORLD", down, line(20, 0, 179.995, 0))[1:] == [False]
    assert left(cell, "EUL_WORLD", down, line(20, 0, 179.9, 0))[1:] == [True]


def test_what_is_not_known_and_what_goes_along_an_arc(cell: Cell) -> None:
    plain = line(10, 0, 150, 0)
    assert left(cell, "$DIN[1]", plain, line(20, 0, 150, 0, "JOINT")) == [True, False]
    arc = "MOVE CIRCULAR TO POS(1500, 40, 1700, 0, 150, {0}, '')"
    arc += " VIA POS(1510, 20, 1700, 0, 150, {1}, '')"
    turned, straight = arc.format(10, 5), arc.format(0, 0)
    assert left(cell, "RS_TRAJ", plain, turned) == [False, True, True]
    assert left(cell, "RS_TRAJ", plain, straight) == [False, False, False]


@pytest.mark.parametrize("turn", [0, 10])
def test_arcs_on_which_the_wrist_axes_turn_in_proportion(cell: Cell, turn: int) -> None:
    plain = line(10, 0, 150, 0)
    arc = f"MOVE CIRCULAR TO POS(1500, 40, 1700, 0, 150, {turn}, '') "
    arc += f"VIA POS(1510, 20, 1700, 0, 150, {turn / 2}, '')"
    assert left(cell, "WRIST_JNT", plain, arc, plain) == [False, True, True, False]
    assert left(cell, "RS_WORLD", plain, arc, plain) == [False] * 4
    away = arc.replace("1510", "9510")
    assert not any(left(cell, "WRIST_JNT", plain, away))  # out of reach it is anyway


def test_the_bound_holds_for_angles_in_proportion() -> None:
    rng = np.random.default_rng(0)
    u = np.linspace(0.0, 1.0, 41)[:, None]
    for _ in range(200):
        ends = np.deg2rad(rng.uniform([-180, 20, -180], [180, 160, 180]))
        ends = np.array([ends, ends + np.deg2rad(rng.uniform(-4, 4, 3))])
        euler = Rotation.from_euler("ZYZ", ends[0] + u * (ends[1] - ends[0]))
        turn = (euler[0].inv() * euler[-1]).as_rotvec()
        one_axis = euler[0] * Rotation.from_rotvec(u * turn)
        off = (one_axis.inv() * euler).magnitude().max()
        sine = np.sin(ends[:, 1]).min()
        angle = np.linalg.norm(turn)
        assert off <= angle**2 / (8 * sine) * 1.05 + 1e-9
