"""Frames taught with the arm: where they really are, and what is left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.outcome import Status
from postproc.compensation.program import read_program
from postproc.compensation.solver.taught_frames import find_moved_frame, frame_of_points
from postproc.exceptions import CellError
from postproc.report.simulation import setup_of
from postproc.robot.cell import load_cell
from postproc.robot.pose import pose_from_record, record_from_pose
from postproc.simulation import land, make_arrivals, virtual_arm
from tests.compensation.shared_points import SWEEP
from tests.conftest import CELL, SEED
from tests.written import FIRST, POSE, program

ALL_UP = (1.0,) * 6
TRUE = (1600.0, -300.0, 900.0, 3.0, 2.0, -1.0)
UFRAME = "[uframe]\nxyz_mm = [1600.0, -300.0, 900.0]\n"


def with_uframe(folder, name, text):
    path = folder / f"{name}.toml"
    path.write_text(CELL.replace(UFRAME, text))
    return load_cell(path)


def section(record, more=""):
    numbers = [round(float(n), 6) for n in record]
    return f"[uframe]\nxyz_mm = {numbers[:3]}\neuler_zyz_deg = {numbers[3:]}\n{more}\n"


def teach(arm, cell, feature, sides=ALL_UP):
    """Drive the virtual arm until its tool is at a point of the part, (6,) [rad]."""
    q = np.radians([-5.0, 10.0, -95.0, 10.0, 50.0, 10.0])
    for _ in range(30):
        arrived = make_arrivals(q[None], np.array([sides]), cell.tool.pose)
        J = cell.arm.jacobian(q[None], cell.tool.pose[None, :3, 3])[0, :3]
        q = q - np.linalg.pinv(J) @ (arm.tcp(arrived)[0] - feature)
    assert np.linalg.norm(arm.tcp(arrived)[0] - feature) < 1e-9
    return q


@pytest.fixture
def taught(job_cell):
    """Joint angles of the three points, and the frame that the controller makes."""
    arm, true = virtual_arm(SEED), pose_from_record(np.array([TRUE]))[0]
    corners = np.array([[0, 0, 0, 1], [0.35, 0, 0, 1], [0.1, 0.4, 0, 1]])
    joints = np.array([teach(arm, job_cell, (true @ c)[:3]) for c in corners])
    points = (job_cell.arm.flange(joints) @ job_cell.tool.pose)[:, :3, 3]
    return joints, record_from_pose(frame_of_points(points))


def lines():
    rng = np.random.default_rng(0)
    for _ in range(15):
        x, y, z = rng.uniform([0, 0, 20], [300, 400, 200])
        yield f"MOVE LINEAR TO POS({x:.3f}, {y:.3f}, {z:.3f}, 0.0, 175.0, 0.0, '')"


def errors(source, cell, asked_in, model):
    outcome = compensate(source, cell, model, name="job.pdl")
    wanted = read_program({"job.pdl": source}, asked_in).visits
    done = read_program(dict(outcome.outputs), cell).visits
    landing = land(virtual_arm(SEED), setup_of(cell), wanted, done)
    return outcome, 1e3 * np.linalg.norm(landing.error, axis=1)[3:]


def test_targets_in_a_taught_frame_land_on_the_part(tmp_path, taught, job_model):
    joints, record = taught
    rows = np.round(np.degrees(joints), 6).tolist()
    text = f'source = "taught"\ntaught_deg = {rows}'
    known = with_uframe(tmp_path, "known", section(record, text))
    naive = with_uframe(tmp_path, "naive", section(record))
    part = with_uframe(tmp_path, "part", section(TRUE))
    source = program(*SWEEP, FIRST, *lines())
    outcome, error = errors(source, known, part, job_model)
    assert set(outcome.decisions.status.tolist()) == {int(Status.CORRECTED)}
    _, misled = errors(source, naive, part, job_model)
    assert misled.mean() > 0.8
    assert error.mean() < 0.25 * misled.mean()
    assert error.max() < 0.3  # backlash of the three points: their sides are unknown
    assert outcome.after.max_mm < 0.01
    stated = 1e3 * np.linalg.norm(outcome.decisions.std_error, axis=1)[3:]
    assert np.sqrt(np.mean(error**2)) < 2.0 * np.sqrt(np.mean(stated**2))
    assert any("taught_direction" in d.message for d in outcome.diagnostics)
    text += f"\ntaught_direction = {[[1] * 6] * 3}"
    stated_sides = with_uframe(tmp_path, "sides", section(record, text))
    outcome, surer = errors(source, stated_sides, part, job_model)
    assert surer.max() < 0.5 * error.max()
    assert not any("taught_direction" in d.message for d in outcome.diagnostics)


def test_targets_in_a_frame_composed_with_a_taught_one_are_left(
    tmp_path, taught, job_model
):
    joints, record = taught
    rows = np.round(np.degrees(joints), 6).tolist()
    text = section(record, f'source = "taught"\ntaught_deg = {rows}')
    known = with_uframe(tmp_path, "known", text)
    composed = "$UFRAME := $UFRAME : POS(0, 0, 5, 0, 0, 0, '')"
    outcome = compensate(program(composed, FIRST, *lines()), known, job_model)
    assert not (outcome.decisions.status[1:] == Status.CORRECTED).any()
    whole = compensate(program(FIRST, *lines()), known, job_model)
    assert (whole.decisions.status == Status.CORRECTED).all()


def taught_points(seed, sides, cell):
    """Teach three points of the part from some sides; the controller's frame too."""
    arm, true = virtual_arm(seed), pose_from_record(np.array([TRUE]))[0]
    corners = np.array([[0, 0, 0, 1], [0.35, 0, 0, 1], [0.1, 0.4, 0, 1]])
    pairs = zip(corners, sides, strict=True)
    joints = np.array([teach(arm, cell, (true @ c)[:3], s) for c, s in pairs])
    points = (cell.arm.flange(joints) @ cell.tool.pose)[:, :3, 3]
    return joints, tuple(record_from_pose(frame_of_points(points)).tolist())


def test_taught_frames_say_how_unsure_they_are(job_cell, job_model):
    """Stated against true error, the sides at the points drawn; a model of the arm."""
    true, rng = pose_from_record(np.array([TRUE]))[0], np.random.default_rng(3)
    inside = np.array([[0.1, 0.1, 0.1], [0.3, 0.2, 0.05], [0.0, 0.4, 0.2]])
    real = inside @ true[:3, :3].T + true[:3, 3]
    off, told = {False: [], True: []}, {False: [], True: []}
    for _ in range(40):
        sides = rng.choice([-1.0, 1.0], (3, 6))
        joints, record = taught_points(SEED, sides, job_cell)
        for known in (False, True):
            stated = {record: sides} if known else {}
            cell = replace(job_cell, taught_sides=stated)
            frame, _ = find_moved_frame(joints, record, cell, job_model)
            nominal = inside @ frame.spanned[:3, :3].T + frame.spanned[:3, 3]
            shift, variance = frame.shift(nominal)
            off[known].append(nominal + shift - real)
            told[known].append(variance)
    for known in (False, True):
        ratio = np.mean(np.square(off[known])) / np.mean(told[known])
        assert ratio < 1.4  # nobody teaches without scatter: stated, but not drawn
        assert known or ratio > 0.7
    assert np.square(off[True]).mean() < 0.1 * np.square(off[False]).mean()


def test_stated_sides_stand_for_every_point(tmp_path, taught):
    joints, record = taught
    rows = np.round(np.degrees(joints), 6).tolist()
    text = f'source = "taught"\ntaught_deg = {rows}\ntaught_direction = '
    for wrong in ("[[1, 1, 1, 1, 1, 1]]", f"{[[2] * 6] * 3}"):
        with pytest.raises(CellError, match="taught_direction"):
            with_uframe(tmp_path, "wrong", section(record, text + wrong))
    cell = with_uframe(tmp_path, "right", section(record, text + f"{[[1] * 6] * 3}"))
    assert [s.tolist() for s in cell.taught_sides.values()] == [[[1.0] * 6] * 3]


def test_joint_targets_do_not_depend_on_the_frame(tmp_path, taught, job_model):
    _, record = taught
    cell = with_uframe(tmp_path, "blind", section(record, 'source = "taught"'))
    outcome = compensate(program(FIRST, POSE), cell, job_model, name="job.pdl")
    d = outcome.decisions
    assert [Status(s) for s in d.status] == [Status.CORRECTED, Status.REJECTED]
    assert "give taught_deg" in d.reasons[d.why[1]].text


def test_a_frame_marked_in_the_program_is_not_trusted(job_cell, job_model):
    lines = ("$UFRAME := POS(1600, -300, 900, 0, 0, 0, '') -- TAUGHT", FIRST, POSE)
    outcome = compensate(program(*lines), job_cell, job_model, name="job.pdl")
    assert outcome.decisions.status.tolist() == [Status.CORRECTED, Status.REJECTED]


def test_a_taught_tool_is_not_trusted(tmp_path, job_model):
    path = tmp_path / "cell.toml"
    tool = "[tool]\n"
    path.write_text(CELL.replace(tool, f'{tool}source = "taught"\n'))
    outcome = compensate(program(FIRST, POSE), load_cell(path), job_model)
    assert outcome.decisions.status.tolist() == [Status.REJECTED] * 2


def test_points_of_another_frame_are_refused(tmp_path, taught, job_model):
    rows = np.round(np.degrees(taught[0]), 6).tolist()
    text = f'source = "taught"\ntaught_deg = {rows}'
    cell = with_uframe(tmp_path, "other", section((*TRUE[:2], 800, 0, 0, 0), text))
    with pytest.raises(CellError, match="give another frame"):
        compensate(program(FIRST, POSE), cell, job_model)


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ("taught_deg = [[0, 0, -90, 0, 60, 0]]", "needs source"),
        ('source = "taught"\ntaught_deg = [[0, 0, -90, 0, 60, 0]]', "a point on"),
    ],
)
def test_a_wrong_section_is_refused(tmp_path, more, why):
    with pytest.raises(CellError, match=why):
        with_uframe(tmp_path, "wrong", section(TRUE, more))
