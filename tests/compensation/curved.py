"""KRL jobs for a simulated KR 210, its model, and where they really go."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import numpy as np
import pytest

from postproc.calibration.effect_selection import fit_survey, model_of
from postproc.compensation.compensate import compensate
from postproc.compensation.options import DEFAULT_OPTIONS
from postproc.compensation.program import plan_visits, prepare_cell, read_program
from postproc.language.krl.pose_encoding import KRL_DIALECT
from postproc.model.model import Model
from postproc.robot.arm import load_arm
from postproc.robot.cell import load_cell
from tests.calibration.simulator import random_arm, random_states, survey_of

KR = load_arm("kr210-r2700-extra")
TOOL = (80.0, -40.0, 150.0)
CELL = f"""
[robot]
arm = "kr210-r2700-extra"
absolute_accuracy = false
[tool]
xyz_mm = {list(TOOL)}
source = "cad"
"""
CENTRE = np.deg2rad([10.0, -80.0, 100.0, 20.0, 50.0, -30.0])
SPREAD = np.deg2rad([40.0, 25.0, 25.0, 60.0, 35.0, 60.0])
HEAD = f"""DEF job ( )
$TOOL={{X {TOOL[0]},Y {TOOL[1]},Z {TOOL[2]},A 0,B 0,C 0}}
$BASE=$NULLFRAME
BAS(#VEL_CP,0.2)
PTP {{A1 0,A2 -90,A3 90,A4 0,A5 30,A6 0}}
PTP {{A1 12,A2 -75,A3 104,A4 24,A5 54,A6 -26}}
"""


def drawn_arm(seed: int) -> Any:
    """Draw the errors of a KR 210."""
    drawn = random_arm(np.random.default_rng(seed), tool=False)
    drawn.arm = KR
    return drawn


def surveyed(truth: Any, seed: int) -> Model:
    """Survey an arm around where jobs move it, and fit a model."""
    rng = np.random.default_rng(seed)
    states = random_states(400, rng)
    states = states.with_(q=CENTRE + rng.uniform(-1.0, 1.0, (400, 6)) * SPREAD)
    position, _ = truth.measure(states, rng)
    survey = survey_of(states, position)
    return model_of(fit_survey(survey, KR, None, None), survey)


@pytest.fixture(scope="module", name="cell")
def curved_cell(tmp_path_factory):
    path = tmp_path_factory.mktemp("cell") / "cell.toml"
    path.write_text(CELL)
    return load_cell(path)


@pytest.fixture(scope="module", name="truth")
def curved_truth():
    return drawn_arm(16)


@pytest.fixture(scope="module", name="model")
def curved_model():
    return _fitted_model()


@cache
def _fitted_model() -> Model:
    """Fit the model of that arm once for all modules that test with it."""
    return surveyed(drawn_arm(16), 17)


def tool_pose() -> np.ndarray:
    """Return the TCP in the flange frame [m]."""
    pose = np.eye(4)
    pose[:3, 3] = np.array(TOOL) / 1000.0
    return pose


def frame(T: np.ndarray) -> str:
    """Write a pose as KRL does."""
    abc = KRL_DIALECT.orientations(T[None, :3, :3], np.zeros((1, 3)))[0]
    numbers = [*(T[:3, 3] * 1000.0), *abc]
    pairs = zip("XYZABC", numbers, strict=True)
    return "{" + ",".join(f"{name} {value:.4f}" for name, value in pairs) + "}"


def job(*lines: str) -> bytes:
    """Write a program."""
    return (HEAD + "\n".join(lines) + "\nEND\n").encode()


def points(text: bytes) -> np.ndarray:
    """Read the places of all written poses, (k, 3) [m]."""
    found = re.findall(rb"X ([-.\d]+),Y ([-.\d]+),Z ([-.\d]+),A", text)[1:]
    return np.array(found, float) / 1000.0


def plans(source: bytes, cell, model):
    """Compensate a program; return the outcome and both plans."""
    done = compensate(source, cell, model, name="job.src")
    ready = prepare_cell(cell, model, DEFAULT_OPTIONS)
    both = [
        plan_visits(read_program({"job.src": text}, ready).visits, ready).plan
        for text in (source, done.outputs["job.src"])
    ]
    return done, both
