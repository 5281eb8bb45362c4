"""The Python interface: one verb, loaded when it is asked for."""

from __future__ import annotations

import subprocess
import sys

import pytest

import postproc
from postproc.compensation.outcome import Status
from tests.plant import program

LAZY = """
import sys
import postproc
assert not [m for m in sys.modules if m.startswith(("postproc.", "numpy"))]
assert callable(postproc.compensate)
from postproc.compensation.compensate import compensate
assert postproc.compensate is compensate
"""


def test_compensates_bytes(job_folder):
    cell = postproc.load_cell(job_folder / "cell.toml")
    model = postproc.load_model(job_folder / "model.json")
    outcome = postproc.compensate(program("job", 2, 1), cell, model)
    assert isinstance(outcome, postproc.Outcome)
    assert outcome.exit_code == 0
    assert outcome.outputs["program.pdl"].startswith(b"-- postproc ")
    assert outcome.decisions.count(Status.SAFE) == 3


def test_nothing_is_loaded_before_it_is_asked_for():
    done = subprocess.run([sys.executable, "-c", LAZY], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_all_public_names_are_there():
    for name in postproc.__all__:
        assert getattr(postproc, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        postproc.nothing  # noqa: B018
