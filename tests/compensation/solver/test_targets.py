from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from postproc.compensation.solver.targets import targets_from_visits, with_tracks
from postproc.language.pdl2.pose_encoding import configurations
from postproc.language.visits import Meaning
from postproc.motion.targets import TargetKind
from postproc.robot.cell import Cell, load_cell
from postproc.robot.pose import inverse, pose_from_record
from tests.made_visits import FRAMES, visits


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Cell:
    path: Path = tmp_path_factory.mktemp("cell") / "cell.toml"
    path.write_text(
        '[robot]\narm = "nj220-2.7"\n[home]\njoints_deg = [0, 0, -90, 0, 45, 0]\n'
        '[aux]\n1 = "gun"\n2 = "track"\n'
    )
    return load_cell(path)


POSE = [100.0, 200.0, 300.0, 10.0, 80.0, -20.0]


def test_world_base_flange_tool_is_uframe_pose(cell: Cell) -> None:
    targets, reasons = targets_from_visits(visits([Meaning.POSE], [POSE]), cell)
    tool, base, uframe = pose_from_record(FRAMES)
    expected = uframe @ pose_from_record(np.array(POSE))
    np.testing.assert_allclose(base @ targets.tcp[0], expected, atol=1e-12)
    np.testing.assert_allclose(targets.tool[0], tool)
    assert targets.slot[0] == 2 and targets.turns[0, 0] == 1
    assert reasons.none.all()


def test_joints_and_home(cell: Cell) -> None:
    nothing = [np.nan] * 6
    given = visits(
        [Meaning.JOINTS, Meaning.HOME, Meaning.CALIBRATION, Meaning.BY],
        [[10, 20, -90, 0, 30, 0], nothing, nothing, [1, 0, 0, 0, 0, -5]],
    )
    targets, reasons = targets_from_visits(given, cell)
    kinds = [
        TargetKind.JOINTS,
        TargetKind.JOINTS,
        TargetKind.UNKNOWN,
        TargetKind.JOINT_STEP,
    ]
    assert targets.kind.tolist() == kinds
    np.testing.assert_allclose(targets.joints[1], cell.home)
    np.testing.assert_allclose(np.rad2deg(targets.joints[3]), [1, 0, 0, 0, 0, -5])
    assert reasons[2].text == "a value is not known"
    assert (targets.slot == -1).all()


def test_the_calibration_position_is_the_cells(cell: Cell) -> None:
    angles = np.deg2rad([0.0, 0.0, -90.0, 0.0, 90.0, 0.0])
    given = visits([Meaning.CALIBRATION, Meaning.HOME], [[np.nan] * 6] * 2)
    known = replace(cell, calibration=angles, home=None)
    targets, _ = targets_from_visits(given, known)
    assert targets.kind.tolist() == [TargetKind.JOINTS, TargetKind.UNKNOWN]
    np.testing.assert_allclose(targets.joints[0], angles)


def test_steps_along_the_frames(cell: Cell) -> None:
    nan = np.nan
    given = visits(
        [Meaning.RELATIVE_TOOL, Meaning.RELATIVE_BASE, Meaning.RELATIVE_UFRAME,
         Meaning.AWAY, Meaning.ABOUT],
        [[1, 2, 3, nan, nan, nan], [1, 2, 3, nan, nan, nan], [1, 2, 3, nan, nan, nan],
         [50, nan, nan, nan, nan, nan], [0, 0, 2, 30, 6, nan]],
    )  # fmt: skip
    targets, _ = targets_from_visits(given, cell)
    tool, base = TargetKind.TOOL_STEP, TargetKind.BASE_STEP
    assert targets.kind.tolist() == [tool, base, base, tool, base]
    _, base_pose, uframe = pose_from_record(FRAMES)
    R = (inverse(base_pose) @ uframe)[:3, :3]
    shifts = targets.tcp[:4, :3, 3] * 1000
    np.testing.assert_allclose(shifts[0], [1, 2, 3], atol=1e-12)
    np.testing.assert_allclose(shifts[1], [1, 2, 3], atol=1e-12)
    np.testing.assert_allclose(shifts[2], R @ [1, 2, 3], atol=1e-12)
    np.testing.assert_allclose(shifts[3], [0, 0, -50], atol=1e-12)
    turn = Rotation.from_matrix(targets.tcp[4, :3, :3]).as_rotvec()
    np.testing.assert_allclose(turn, np.deg2rad(30) * R[:, 2], atol=1e-12)


def test_near_stops_short_along_the_approach(cell: Cell) -> None:
    given = visits([Meaning.POSE, Meaning.NEAR], [POSE, POSE],
                   distance_mm=np.array([np.nan, 40.0]))  # fmt: skip
    targets, _ = targets_from_visits(given, cell)
    at, short = targets.tcp
    np.testing.assert_allclose(short[:3, :3], at[:3, :3])
    np.testing.assert_allclose(at[:3, 3] - short[:3, 3], 0.04 * at[:3, 2], atol=1e-12)


@pytest.mark.parametrize("frame", ["tool", "base", "uframe"])
def test_an_unknown_frame_is_a_reason_and_no_guess(cell: Cell, frame: str) -> None:
    given = visits([Meaning.POSE, Meaning.JOINTS], [POSE, [0, 0, -90, 0, 30, 0]],
                   **{frame: np.array([-1, -1])})  # fmt: skip
    targets, reasons = targets_from_visits(given, cell)
    assert targets.kind.tolist() == [TargetKind.UNKNOWN, TargetKind.JOINTS]
    assert f"${frame.upper()} is not known" in reasons[0].text
    assert (reasons[1].text != "") == (frame == "tool")


def test_auxiliary_axes(cell: Cell) -> None:
    nan = np.nan
    aux = np.array([[90, nan, nan], [nan, 100, nan], [nan, nan, 5], [nan, nan, nan]])
    targets, reasons = targets_from_visits(
        visits([Meaning.POSE] * 4, [POSE] * 4, aux=aux), cell
    )
    assert targets.kind.tolist() == [
        TargetKind.POSE,
        TargetKind.UNKNOWN,
        TargetKind.UNKNOWN,
        TargetKind.POSE,
    ]
    assert "track" in reasons[1].text and "[aux]" in reasons[2].text
    assert reasons[0].text == reasons[3].text == ""


@pytest.mark.parametrize(
    ("column", "value", "why"),
    [(1, 0.0, ""), (1, -0.0, ""), (1, 1e-3, "track"), (2, 0.0, "[aux]")],
)
def test_an_arm_on_a_track_that_is_at_0(cell: Cell, column, value, why) -> None:
    aux = np.full((1, 3), np.nan)
    aux[0, column] = value
    given = visits([Meaning.POSE], [POSE], aux=aux)
    targets, reasons = targets_from_visits(given, cell)
    assert (why in reasons[0].text) if why else (reasons[0].text == "")
    assert (targets.kind[0] == TargetKind.POSE) == (why == "")


@pytest.mark.parametrize(
    ("column", "places", "why"),
    [
        (1, [0.0, np.nan, 0.0], ["", "", ""]),
        (1, [np.nan, 500.0, 0.0], ["says nothing", "is a track", ""]),
        (2, [np.nan, 500.0, np.nan], ["", "not declared", ""]),
    ],
)
def test_a_track_stays_where_it_was_left(cell: Cell, column, places, why) -> None:
    aux = np.full((3, 3), np.nan)
    aux[:, column] = places
    given = with_tracks(visits([Meaning.POSE] * 3, [POSE] * 3, aux=aux), cell)
    targets, reasons = targets_from_visits(given, cell)
    found = [reasons[row].text for row in range(3)]
    assert all(w in f if w else not f for w, f in zip(why, found, strict=True))
    assert (targets.kind == TargetKind.POSE).tolist() == [not w for w in why]


def test_joint_angles_are_the_same_anywhere_on_a_track(cell: Cell) -> None:
    aux = np.full((2, 3), np.nan)
    aux[0, 1] = 500.0
    given = visits([Meaning.POSE, Meaning.JOINTS], [POSE, POSE], aux=aux)
    assert np.isnan(with_tracks(given, cell).target.aux[1]).all()


def test_a_remote_tool_is_not_guessed(cell: Cell) -> None:
    given = visits([Meaning.POSE], [POSE], tool_remote=np.array([True]))
    targets, reasons = targets_from_visits(given, cell)
    assert targets.kind[0] == TargetKind.UNKNOWN and "$TOOL_RMT" in reasons[0].text


def test_a_value_known_at_run_time_only(cell: Cell) -> None:
    given = visits([Meaning.POSE, Meaning.UNKNOWN], [[*POSE[:5], np.nan], [np.nan] * 6])
    targets, reasons = targets_from_visits(given, cell)
    assert targets.kind.tolist() == [TargetKind.UNKNOWN] * 2
    assert reasons[0].text == "a value is not known"


def test_configuration_strings() -> None:
    texts = ("", " ", "W", "S E W T1:1 T2:-1", "W T1:0 T2:0 T3:0", "e t1 : -2")
    slots, turns = configurations(texts)
    assert slots.tolist() == [0, 0, 4, 7, 4, 1]
    np.testing.assert_array_equal(turns[3], [1, -1, np.nan])
    np.testing.assert_array_equal(turns[4], [0, 0, 0])
    np.testing.assert_array_equal(turns[5], [-2, np.nan, np.nan])
