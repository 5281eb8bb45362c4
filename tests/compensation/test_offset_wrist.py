"""An arm without a closed form is compensated with the numeric inverse."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.calibration.effect_selection import fit_survey, model_of
from postproc.compensation.compensate import compensate
from postproc.compensation.options import DEFAULT_OPTIONS
from postproc.compensation.outcome import Status
from postproc.compensation.program import plan_visits, prepare_cell, read_program
from postproc.compensation.solver.targets import UNNAMED
from postproc.robot.arm import load_arm
from postproc.robot.cell import load_cell
from postproc.robot.pose import record_from_pose
from tests.calibration.simulator import Simulated, random_arm, random_states, survey_of

UR10 = load_arm("ur10")
HOME = np.array([20.0, -60.0, 80.0, -110.0, -70.0, 30.0])
CELL = """
[robot]
arm = "ur10"
controller = "comau"
[tool]
xyz_mm = [80.0, -40.0, 150.0]
source = "cad"
"""


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    path = tmp_path_factory.mktemp("cell") / "cell.toml"
    path.write_text(CELL)
    return load_cell(path)


@pytest.fixture(scope="module")
def truth() -> Simulated:
    drawn = random_arm(np.random.default_rng(6), tool=False)
    drawn.arm = UR10
    return drawn


@pytest.fixture(scope="module")
def model(truth):
    rng = np.random.default_rng(7)
    states = random_states(400, rng)
    q = np.deg2rad(HOME + rng.uniform(-45.0, 45.0, (400, 6)))
    states = states.with_(q=q)
    position, _ = truth.measure(states, rng)
    survey = survey_of(states, position)
    return model_of(fit_survey(survey, UR10, None, None), survey)


def job(cell) -> bytes:
    rng, lines = np.random.default_rng(8), []
    for k in range(16):
        q = np.deg2rad(HOME + rng.uniform(-25.0, 25.0, 6))
        pose = (UR10.flange(q[None])[0] @ cell.tool.pose)[None]
        numbers = ", ".join(f"{v:.4f}" for v in record_from_pose(pose)[0])
        if k % 3 == 0:
            angles = ", ".join(f"{v:.5f}" for v in np.rad2deg(q))
            lines.append(f"  MOVE JOINT TO {{{angles}}}")
        else:
            lines.append(f"  MOVE LINEAR TO POS({numbers}, '')")
    head = [f"  MOVE JOINT TO {{{', '.join(map(str, HOME))}}}"]
    return "\n".join(["PROGRAM job", "BEGIN", *head, *lines, "END job", ""]).encode()


def test_targets_land_where_they_should(cell, truth, model):
    source = job(cell)
    done = compensate(source, cell, model, name="job.pdl")
    decided = done.decisions
    safe = decided.status == Status.CORRECTED
    assert safe.mean() > 0.9
    ready = prepare_cell(cell, model, DEFAULT_OPTIONS)
    wanted, made = (
        plan_visits(read_program({"job.pdl": text}, ready).visits, ready).plan
        for text in (source, done.outputs["job.pdl"])
    )
    sure = safe & (np.abs(made.direction) == 1).all(axis=1)
    assert sure.sum() > 10
    tool = np.tile(cell.tool.pose[:3, 3], (len(safe), 1))
    before = truth.tcp(wanted.q, wanted.direction, tool) - wanted.tcp[:, :3, 3]
    after = truth.tcp(made.q, made.direction, tool) - wanted.tcp[:, :3, 3]
    off = [1e3 * np.linalg.norm(x[sure], axis=1) for x in (before, after)]
    assert off[0].mean() > 0.5
    assert off[1].mean() < 0.02 and off[1].max() < 0.05


def test_a_line_through_a_singularity_is_left(cell, model):
    straight = np.array(HOME)
    straight[4] = 0.5  # the wrist is nearly straight
    poses = []
    for q in (HOME, straight):
        pose = (UR10.flange(np.deg2rad(q)[None])[0] @ cell.tool.pose)[None]
        poses.append(", ".join(f"{v:.4f}" for v in record_from_pose(pose)[0]))
    lines = [f"MOVE JOINT TO {{{', '.join(map(str, HOME))}}}",
             f"MOVE LINEAR TO POS({poses[1]}, '')"]  # fmt: skip
    text = "\n".join(["PROGRAM job", "BEGIN", *lines, "END job"]).encode()
    done = compensate(text, cell, model, name="job.pdl")
    assert done.decisions.status[1] != Status.CORRECTED


def test_flags_name_no_branch_of_such_an_arm(cell, model):
    """Where a joint move to a pose leads is not known, nor what goes on from there."""
    pose = (UR10.flange(np.deg2rad(HOME)[None])[0] @ cell.tool.pose)[None]
    numbers = ", ".join(f"{v:.4f}" for v in record_from_pose(pose)[0])
    home = f"MOVE JOINT TO {{{', '.join(map(str, HOME))}}}"
    lines = [
        f"MOVE JOINT TO POS({numbers}, '')",
        home,
        f"MOVE LINEAR TO POS({numbers}, '')",
    ]
    text = "\n".join(["PROGRAM job", "BEGIN", home, *lines, "END job"]).encode()
    decided = compensate(text, cell, model, name="job.pdl").decisions
    assert decided.status[1] != Status.CORRECTED
    assert decided.reasons[decided.why[1]] == UNNAMED
    assert (decided.status[[0, 2]] == Status.CORRECTED).all()
