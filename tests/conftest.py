"""A cell, a virtual arm and a model fitted to it, for tests of whole jobs."""

from __future__ import annotations

import gc
import os
import signal
import sys
from dataclasses import replace
from pathlib import Path

import hypothesis
import numpy as np
import pytest

from postproc.calibration.fit import fit
from postproc.cli import YOUNG
from postproc.model.effects import BASE_EFFECTS
from postproc.model.model import Model, load_model
from postproc.robot.cell import Cell, load_cell
from postproc.simulation import (
    measure_rows,
    read_rows,
    sample_survey,
    virtual_arm,
    write_measurements,
)
from postproc.simulation.kinematics import NJ220, Chain
from postproc.simulation.reference import WORKING_RANGE
from tests.any_controller import EVERY, any_controller
from tests.pipes import made_device, made_pipe

# How long an example takes says how busy a machine is.
hypothesis.settings.register_profile("postproc", deadline=None)
hypothesis.settings.load_profile("postproc")

ROOT = Path(__file__).parents[1]
SEED = 4
POSES = 300

CELL = f"""
[robot]
arm = "nj220-2.7"
{EVERY}
[tool]
xyz_mm = [80.0, -40.0, 150.0]
[uframe]
xyz_mm = [1600.0, -300.0, 900.0]
[home]
joints_deg = [0.0, 0.0, -90.0, 0.0, 60.0, 0.0]
[tracker]
xyz_mm = [4000.0, -3000.0, 1500.0]
[survey]
points_mm = [[80.0, -40.0, 150.0], [-120.0, 60.0, 180.0], [30.0, 130.0, 320.0]]
[aux]
1 = "gun"
"""


# The tests start hundreds of processes: where Python is to write no bytecode, each
# would compile the package again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# The tests make hardly any cycles, as commands do: see `postproc.cli.main`.
gc.set_threshold(YOUNG, *gc.get_threshold()[1:])


def pytest_collection_finish() -> None:
    """Never search again what was loaded by now."""
    gc.freeze()


# Commands that the tests start are to hear signals, also where the tests run in the
# background of a shell, or behind nohup, which let what they start ignore some.
HEARD = {
    signal.SIGINT: signal.default_int_handler,
    signal.SIGHUP: signal.SIG_DFL,
    signal.SIGTERM: signal.SIG_DFL,
}
for _number, _handler in HEARD.items():
    if signal.getsignal(_number) == signal.SIG_IGN:
        signal.signal(_number, _handler)


@pytest.fixture(scope="session")
def job_folder(tmp_path_factory):
    """A folder with cell.toml and model.json of virtual arm SEED."""
    return make_job(tmp_path_factory.mktemp("job"))


@pytest.fixture(scope="session")
def bench_cell() -> Cell:
    """The cell of the shipped programs, and of those that the bench makes."""
    return any_controller(load_cell(ROOT / "programs" / "cell.toml"))


@pytest.fixture(scope="session")
def bench_model(tmp_path_factory) -> Model:
    """A model fitted to the arm of that cell."""
    text = (ROOT / "programs" / "cell.toml").read_text()
    return load_model(make_job(tmp_path_factory.mktemp("job"), text) / "model.json")


def make_job(
    folder: Path,
    text: str = CELL,
    seed: int = SEED,
    poses: int = POSES,
    quiet: bool = False,
    chain: Chain = NJ220,
) -> Path:
    """Write a cell, a survey of a virtual arm, and the model fitted to it.

    Args:
        folder: Where they go.
        text: Of the cell.
        seed: Of the arm and its survey.
        poses: Of the survey.
        quiet: The survey's arm repeats exactly, and its tracker has no noise.
        chain: The arm of the cell, as the virtual arm has it.
    """
    (folder / "cell.toml").write_text(text)
    cell = load_cell(folder / "cell.toml")
    rows = folder / "rows.csv"
    arm = virtual_arm(seed, chain=chain, coupling=cell.arm.coupling)
    targets = sample_survey(arm, poses, seed=seed, within=working_range(chain))
    with rows.open("w") as out:
        names = [f"q{j}_deg" for j in range(1, 7)]
        sides = [f"lambda{j}" for j in range(1, 7)]
        out.write(",".join(["id", *names, *sides, "tool_id"]) + "\n")
        for i, (q, side) in enumerate(zip(targets.q, targets.side, strict=True)):
            cells = [*np.degrees(q), *np.sign(side), i % 3]
            out.write(f"{i + 1}," + ",".join(f"{c:.5f}" for c in cells) + "\n")
    from postproc.report.simulation import setup_of

    if quiet:
        arm = replace(arm, joint_noise=np.zeros(6), tracker_noise=(0.0, 0.0))
    campaign = measure_rows(arm, setup_of(cell), read_rows(rows))
    write_measurements(campaign, folder / "survey.csv")
    effects = BASE_EFFECTS  # all that this arm has: a search takes long
    fit(folder / "survey.csv", cell=cell, effects=effects).model.save(
        folder / "model.json"
    )
    return folder


def working_range(chain: Chain) -> np.ndarray:
    """Return where the NJ 220 works in the angles of another arm, (6, 2) [rad]."""
    if chain is NJ220:
        return WORKING_RANGE
    ends = NJ220.dh_angles(np.array(WORKING_RANGE).T)
    q = np.sort(chain.controller_angles(ends).T, axis=1)
    return np.clip(q, chain.lower[:, None], chain.upper[:, None])


@pytest.fixture(scope="session")
def job_cell(job_folder):
    """The cell of the job folder."""
    return load_cell(job_folder / "cell.toml")


@pytest.fixture(scope="session")
def job_model(job_folder):
    """The model of the job folder."""
    from postproc.model.model import load_model

    return load_model(job_folder / "model.json")


@pytest.fixture(scope="session")
def free_model(job_folder, job_cell) -> Model:
    """A model of the same survey that has free forms, too."""
    effects = (*BASE_EFFECTS, "joint_map", "elm")
    return fit(job_folder / "survey.csv", cell=job_cell, effects=effects).model


@pytest.fixture
def desk(job_folder, tmp_path):
    """An empty folder to work in, with the cell and the model of the job folder."""
    from tests.written import Desk

    return Desk(tmp_path, job_folder / "cell.toml", job_folder / "model.json")


@pytest.fixture
def pipe(tmp_path):
    """A pipe of our own, with a name."""
    return made_pipe(tmp_path / "pipe")


@pytest.fixture
def device():
    """A device of our own."""
    with made_device() as path:
        yield path
