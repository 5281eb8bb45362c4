"""Campaigns and their files."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from postproc.exceptions import MeasurementError, OutputError, PostprocError
from postproc.simulation import (
    VirtualCell,
    campaign_length,
    in_tracker_frame,
    measure_program,
    measure_rows,
    read_rows,
    virtual_arm,
    write_measurements,
)
from postproc.simulation.kinematics import pose
from tests.simulation.builders import Program

ARM = virtual_arm(1, "geometry,tool,backlash,windup")
TOOLS = pose(np.eye(3), np.array([[0.08, -0.04, 0.15], [0.0, 0.1, 0.2]]))
SETUP = VirtualCell(tool=TOOLS[0], home=np.zeros(6), payload=40.0)
HEADER = "id,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg"


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def program() -> Program:
    out = Program(frames=[[80, -40, 150, 0, 0, 0], [0] * 6])
    for k in range(6):
        where = (10 * k, k, -90 - k, 5 * k, 40, -k)
        out.joints(*where, base=1, uframe=1, id=f"P{k}" if k % 2 else "")
    return out


def test_only_marked_visits_are_measured_where_there_are_marks() -> None:
    campaign = measure_program(ARM, SETUP, program().visits())
    assert campaign.ids == ("P1", "P3", "P5")
    np.testing.assert_array_equal(campaign.arrivals.order, [0, 1, 2])
    bare = program()
    for row in bare.rows:
        row["id"] = ""
    assert measure_program(ARM, SETUP, bare.visits()).ids == tuple("123456")


def test_repeated_ids_are_numbered() -> None:
    twice = program()
    twice.rows[3]["id"] = "P1"
    assert measure_program(ARM, SETUP, twice.visits()).ids == ("P1", "P1#2", "P5")


def test_readings_are_near_the_truth_and_repeat() -> None:
    one, two = (measure_program(ARM, SETUP, program().visits()) for _ in range(2))
    np.testing.assert_array_equal(one.measured, two.measured)
    off = np.linalg.norm(one.measured - one.true, axis=1)
    assert (off > 0).all() and (off < 0.3e-3).all()
    perfect = measure_program(ARM.without_noise(), SETUP, program().visits())
    np.testing.assert_array_equal(perfect.measured, perfect.true)


def test_what_is_written_is_what_is_read(tmp_path: Path) -> None:
    campaign = measure_program(ARM, SETUP, program().visits())
    path = tmp_path / "m.csv"
    write_measurements(campaign, path)
    with path.open() as file:
        table = list(csv.DictReader(file))
    header = path.read_text().splitlines()[0].split(",")
    assert header[:7] == HEADER.split(",") and len(header) == len(set(header))
    x = np.array([[float(r[c]) for c in ("x_mm", "y_mm", "z_mm")] for r in table])
    np.testing.assert_allclose(x, campaign.measured * 1e3, atol=6e-5)
    rows = read_rows(path)
    assert rows.ids == campaign.ids
    np.testing.assert_allclose(rows.q, campaign.arrivals.q, atol=1e-7)
    np.testing.assert_array_equal(rows.side, campaign.arrivals.side)
    again = measure_rows(ARM, SETUP, rows)
    np.testing.assert_allclose(again.true, campaign.true, atol=1e-6)


def test_directions_can_be_kept_back(tmp_path: Path) -> None:
    campaign = measure_program(ARM, SETUP, program().visits())
    path = tmp_path / "m.csv"
    write_measurements(campaign, path, direction=False)
    header = path.read_text().splitlines()[0]
    assert "lambda" not in header and "travel" not in header
    assert read_rows(path).side is None


def test_rows_may_use_semicolons_and_decimal_commas(tmp_path: Path) -> None:
    header = HEADER.replace(",", ";")
    path = write(tmp_path / "r.csv", f"{header}\n7;1,5;2;-90;0;30;-4,25\n")
    rows = read_rows(path)
    assert rows.ids == ("7",) and rows.side is None
    np.testing.assert_allclose(np.degrees(rows.q[0]), [1.5, 2, -90, 0, 30, -4.25])
    assert np.isnan(rows.speed).all()


def test_covariates_of_the_file_win_over_the_cell(tmp_path: Path) -> None:
    text = f"{HEADER},payload_kg,temperature_c,tool_id\n"
    text += "1,0,0,-90,0,30,0,,31.5,1\n2,5,0,-90,0,30,0,60,,0\n"
    rows = read_rows(write(tmp_path / "r.csv", text))
    campaign = measure_rows(ARM, replace(SETUP, tools=TOOLS), rows)
    np.testing.assert_array_equal(campaign.arrivals.payload, [40.0, 60.0])
    assert campaign.arrivals.temperature[0] == 31.5
    np.testing.assert_array_equal(campaign.arrivals.tool, TOOLS[[1, 0]])
    assert campaign.arrivals.time[1] > campaign.arrivals.time[0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("id,q1_deg\n1,2\n", "q2_deg"),
        (f"{HEADER}\n", "no rows"),
        (f"{HEADER}\n1,0,0,-90,0,x,0\n", ":2: 'x' in column q5_deg"),
        (f"{HEADER}\n1,0,0,,0,1,0\n", "missing"),
    ],
)
def test_bad_rows_are_refused_with_their_place(tmp_path, text, message) -> None:
    with pytest.raises(MeasurementError, match=message):
        read_rows(write(tmp_path / "r.csv", text))


def test_missing_files_and_folders_are_named(tmp_path: Path) -> None:
    with pytest.raises(MeasurementError, match=r"none\.csv"):
        read_rows(tmp_path / "none.csv")
    campaign = measure_program(ARM, SETUP, program().visits())
    with pytest.raises(OutputError, match="folder does not exist"):
        write_measurements(campaign, tmp_path / "no" / "m.csv")


def test_the_tracker_frame_is_rigid() -> None:
    campaign = measure_program(ARM, SETUP, program().visits())
    moved = in_tracker_frame(campaign, ARM, SETUP)
    assert np.abs(moved.measured - campaign.measured).max() > 0.5
    for c in (campaign, moved):
        gaps = np.linalg.norm(np.diff(c.measured, axis=0), axis=1)
        np.testing.assert_allclose(
            gaps, np.linalg.norm(np.diff(campaign.measured, axis=0), axis=1)
        )
    span = np.linalg.norm(campaign.measured - SETUP.tracker, axis=1)
    np.testing.assert_allclose(np.linalg.norm(moved.measured, axis=1), span)


def test_tools_of_rows_are_the_files_own_or_the_cells(tmp_path: Path) -> None:
    header = f"{HEADER},tool_id"
    cell = replace(SETUP, tools=TOOLS)
    from_one = f"{header}\n1,0,0,-90,0,30,0,1\n2,0,0,-90,0,30,0,2\n"
    rows = read_rows(write(tmp_path / "a.csv", from_one))
    found = measure_rows(ARM, cell, rows).arrivals.tool
    np.testing.assert_array_equal(found, TOOLS)
    own = f"{header},tool_x_mm,tool_y_mm,tool_z_mm\n1,0,0,-90,0,30,0,9,1,2,3\n"
    rows = read_rows(write(tmp_path / "b.csv", own))
    found = measure_rows(ARM, cell, rows).arrivals.tool[0, :3, 3]
    np.testing.assert_allclose(found, [1e-3, 2e-3, 3e-3])
    unknown = f"{header}\n1,0,0,-90,0,30,0,4\n"
    with pytest.raises(PostprocError, match="2 probe points"):
        measure_rows(ARM, cell, read_rows(write(tmp_path / "c.csv", unknown)))


def test_tools_of_programs_take_the_numbers_of_the_probe_points() -> None:
    second = Program(frames=[[0, 100, 200, 0, 0, 0], [0] * 6])
    second.joints(0, 0, -90, 0, 40, 0, base=1, uframe=1)
    cell = replace(SETUP, tools=TOOLS)
    np.testing.assert_array_equal(
        measure_program(ARM, cell, second.visits()).tool_id, [1]
    )
    other = Program(frames=[[0, 0, 300, 0, 0, 0], [0] * 6])
    other.joints(0, 0, -90, 0, 40, 0, base=1, uframe=1)
    np.testing.assert_array_equal(
        measure_program(ARM, cell, other.visits()).tool_id, [0]
    )


def test_the_length_of_a_campaign_is_its_measured_visits() -> None:
    assert campaign_length(program().visits()) == 3
    assert campaign_length(Program().joints(0, 0, 0, 0, 0, 0).visits()) == 1
