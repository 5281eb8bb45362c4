"""A check of few readings: poses that tell most, both sides, the first one again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.calibration.check_design import CheckDesign, _rows, design_check
from postproc.calibration.pose_design import draw_poses, usable
from postproc.exceptions import PostprocError
from postproc.robot.state import make_states
from tests.calibration.simulator import NJ, PLATE
from tests.written import cli

TRACKER = np.array([4.0, 1.0, 1.2])


def spread(check: CheckDesign) -> float:
    """Return the mean error [m] over the workspace that a check leaves uncertain."""
    tools = PLATE[check.probe]
    read = make_states(check.q, check.side, tools, tool_id=check.probe)
    X, _ = _rows(NJ, read, len(PLATE), None)
    own = X[:, :3].reshape(-1, X.shape[2])
    left = np.linalg.inv(np.eye(X.shape[2]) + own.T @ own)
    rng = np.random.default_rng(5)
    there, _ = _rows(NJ, draw_poses(NJ, PLATE, 200, None, rng), len(PLATE), None)
    one = there[:, :3].reshape(-1, X.shape[2]) * 3e-5
    return float(np.sqrt(np.einsum("ki,ij,kj->k", one, left, one).mean() * 3))


def test_readings_come_from_both_sides_and_the_first_comes_again() -> None:
    check = design_check(NJ, PLATE, 10, TRACKER)
    assert check.names == tuple("1a 1b 2a 2b 3a 3b 4a 4b 5a 1c".split())
    np.testing.assert_array_equal(check.q[-1], check.q[0])
    np.testing.assert_array_equal(check.side[-1], check.side[0])
    np.testing.assert_array_equal(check.side[1], -check.side[0])
    assert usable(NJ, check.q, PLATE[check.probe], TRACKER).all()
    assert len(np.unique(check.probe)) > 1


def test_its_poses_tell_more_than_drawn_ones() -> None:
    check = design_check(NJ, PLATE, 10)
    drawn = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        q = draw_poses(NJ, PLATE, 5, None, rng).q
        drawn.append(spread(replace(check, q=q[[0, 0, 1, 1, 2, 2, 3, 3, 4, 0]])))
    assert spread(check) < 0.8 * np.median(drawn)
    assert spread(check) < min(drawn)


def test_too_few_readings_are_refused() -> None:
    with pytest.raises(PostprocError, match="5 or more"):
        design_check(NJ, PLATE, 4)


@pytest.mark.parametrize("suffix", [".pdl", ".mod", ".src"])
def test_every_language_gives_the_readings_back(job_folder, tmp_path, suffix):
    text = (job_folder / "cell.toml").read_text()
    cell, out = tmp_path / "cell.toml", tmp_path / f"check{suffix}"
    cell.write_text(text)
    at = ("--cell", cell)
    asked = ("--checks", 10, "--model", job_folder / "model.json")
    found = cli("survey", *at, *asked, "-o", out)
    assert found.exit_code == 0, found.stderr
    assert "10 readings at 5 poses" in found.stderr
    assert "min at 20 %" in found.stderr
    rows = tmp_path / "rows.csv"
    assert cli("simulate", out, *at, "-o", rows).exit_code == 0
    ids = [line.split(",")[0] for line in rows.read_text().splitlines()[1:]]
    assert ids == "1a 1b 2a 2b 3a 3b 4a 4b 5a 1c".split()


def test_a_check_and_a_job_exclude_each_other(job_folder, tmp_path):
    out = tmp_path / "check.pdl"
    given = ("--cell", job_folder / "cell.toml", "--checks", 10, "--job", out)
    found = cli("survey", *given, "-o", out)
    assert found.exit_code == 2
    assert not out.exists()
