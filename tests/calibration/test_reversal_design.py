"""Reversals are repeated until the flanks of gaps that matter can be told."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.calibration.pose_design import Design, design_survey
from postproc.calibration.reversal_design import (
    FAR,
    MATTERS,
    MORE,
    STEPS,
    TELLS,
    ReversalDesign,
    design_reversals,
    nats_between,
)
from postproc.model.backlash_width import on_the_way
from postproc.model.kinematics import ArmStates
from postproc.model.noise import SAME_POSE
from postproc.robot.cell import Cell, load_cell
from postproc.robot.state import make_states
from tests.compensation.paths.test_path_error import CELL

POSES, EACH = 120, 4


@pytest.fixture(scope="module")
def cell() -> Cell:
    return load_cell(CELL)


@pytest.fixture(scope="module")
def design(cell: Cell) -> Design:
    return design_survey(cell.arm, cell.probes, POSES, tracker=cell.tracker)


@pytest.fixture(scope="module")
def found(cell: Cell, design: Design) -> ReversalDesign:
    return design_reversals(cell.arm, design, cell.probes, EACH)


def test_drives_turn_back_until_what_matters_is_told(found: ReversalDesign) -> None:
    many = np.bincount([drive for _, drive in found.turns])
    assert len(many) == 6 and many.min() >= EACH and many.max() <= MORE * EACH
    told = found.least * found.lever <= MATTERS
    assert (told | (many == MORE * EACH)).all()
    assert told.any()


def test_more_reversals_tell_smaller_gaps(
    cell: Cell, design: Design, found: ReversalDesign
) -> None:
    fewer = design_reversals(cell.arm, design, cell.probes, 1)
    assert (fewer.least >= found.least).all() and (fewer.least > found.least).any()


def test_steps_are_stops_of_their_own() -> None:
    """Rows whose angles differ by less are readings of one stop."""
    assert (np.diff(STEPS, prepend=0.0) > SAME_POSE).all()


def test_poses_are_those_of_long_levers(
    cell: Cell, design: Design, found: ReversalDesign
) -> None:
    tools = np.atleast_2d(cell.probes)[design.probe]
    jacobian = ArmStates(cell.arm, make_states(design.q, tool=tools)).jacobian
    lever = np.linalg.norm(jacobian @ np.linalg.inv(cell.arm.coupling), axis=1)
    for drive in range(6):
        poses = [pose for pose, own in found.turns if own == drive]
        assert len(set(poses)) == len(poses) <= max(FAR * POSES, MORE * EACH)
        assert np.mean(lever[poses, drive]) > 1.1 * np.median(lever[:, drive])


def test_nats_are_those_of_readings_with_noise() -> None:
    """The mean of log likelihood ratios of drawn readings is what is foretold."""
    rng, gap, clear = np.random.default_rng(3), 8e-5, np.array([4e4, 6e4])
    back = 2.0 * np.append(0.0, STEPS) / gap
    sharp, elastic = (on_the_way(1.0 - back / w, w) * gap / 2 for w in (1.0, 2.0))
    ratios = np.zeros(4000)
    for one in clear:
        read = one * sharp + rng.normal(size=(len(ratios), len(back)))
        for sign, way in ((1.0, elastic), (-1.0, sharp)):
            left = read - one * way
            left -= left.mean(axis=1, keepdims=True)
            ratios += sign * 0.5 * (left**2).sum(axis=1)
    found = nats_between(clear, np.array([gap]))[0]
    assert ratios.mean() == pytest.approx(found, rel=0.05)
    assert nats_between(clear, np.array([1e-6]))[0] < 1e-3 < TELLS
