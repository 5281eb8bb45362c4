"""The Python interface: one verb, loaded when it is asked for."""

from __future__ import annotations

import subprocess
import sys

import pytest

import postproc
from tests.plant import program

LAZY = """
import sys
import postproc
assert not [m for m in sys.modules if m.startswith(("postproc.", "numpy"))]
assert callable(postproc.compensate)
from postproc.compensate import compensate as function
assert postproc.compensate is sys.modules["postproc.compensate"]
"""


def test_compensates_bytes(job_folder):
    cell = postproc.load_cell(job_folder / "cell.toml")
    model = postproc.load_model(job_folder / "model.json")
    outcome = postproc.compensate(program("job", 2, 1), cell, model)
    assert isinstance(outcome, postproc.Outcome)
    assert outcome.exit_code == 0
    assert outcome.outputs["program.pdl"].startswith(b"-- postproc ")
    assert outcome.decisions.count(postproc.report.Status.SAFE) == 3


def test_module_and_verb_have_one_name(job_cell, job_model):
    from postproc.compensate import compensate
    from postproc.compensate import compensate as function

    source = program("job", 1, 1)
    outcomes = [call(source, job_cell, job_model) for call in (compensate, function)]
    assert outcomes[0].outputs == outcomes[1].outputs


def test_nothing_is_loaded_before_it_is_asked_for():
    done = subprocess.run([sys.executable, "-c", LAZY], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_all_public_names_are_there():
    for name in postproc.__all__:
        assert getattr(postproc, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        postproc.nothing  # noqa: B018
