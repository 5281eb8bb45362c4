"""What a tracker reads while the virtual arm runs: places, times, stops."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.robot.trajectory import Motion
from postproc.simulation import VirtualCell, run_program, virtual_arm
from postproc.simulation.program import SETTLE
from postproc.simulation.track import record_track
from tests.simulation.builders import Program

SETUP = VirtualCell()


def program():
    made = Program().joints(0, 0, -90, 0, 60, 0)
    made.add([1800.0, 0.0, 1500.0, 0.0, 120.0, 0.0], Motion.LINEAR)
    made.add([1800.0, 200.0, 1500.0, 0.0, 120.0, 0.0], Motion.LINEAR)
    return made.visits()


def test_the_arm_is_read_where_it_is():
    arm, visits = virtual_arm(3).without_noise(), program()
    run = run_program(arm, SETUP, visits)
    assert run.why == ("",) * 3
    track = record_track(arm, SETUP, run, 200.0)
    landed = arm.tcp(run.arrivals)
    for place in landed:
        apart = np.linalg.norm(track.position - place, axis=1)
        assert apart.min() < 1e-6
        assert (apart < 1e-6).sum() >= SETTLE * 200.0 - 1  # it stands there
    np.testing.assert_allclose(np.diff(track.time), 0.005)
    begin = np.linalg.norm(track.position - track.position[0], axis=1)
    assert track.time[np.argmax(begin > 1e-9)] >= 0.5  # the clock begins before
    np.testing.assert_allclose(track.position[-1], landed[-1], atol=1e-9)


def test_readings_scatter_as_the_tracker_does_and_are_seeded():
    arm = virtual_arm(3)
    run = run_program(arm, SETUP, program())
    one, other = (record_track(arm, SETUP, run, 100.0) for _ in range(2))
    np.testing.assert_array_equal(one.position, other.position)
    quiet = record_track(arm.without_noise(), SETUP, run, 100.0)
    off = one.position - quiet.position
    span = np.linalg.norm(quiet.position - SETUP.tracker, axis=1)
    sigma = arm.tracker_noise[0] + arm.tracker_noise[1] * span
    assert np.std(off / sigma[:, None]) == pytest.approx(1.0, abs=0.05)


def test_it_is_written_in_millimetres(tmp_path):
    arm = virtual_arm(3)
    track = record_track(arm, SETUP, run_program(arm, SETUP, program()), 50.0)
    track.write(tmp_path / "t.csv")
    head, first, *_ = (tmp_path / "t.csv").read_text().splitlines()
    assert head == "time_s,x_mm,y_mm,z_mm"
    read = np.loadtxt(tmp_path / "t.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(read[:, 1:], 1e3 * track.position, atol=1e-4)
    assert len(first.split(",")) == 4
