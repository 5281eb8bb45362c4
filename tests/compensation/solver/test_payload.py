"""Loads that were not surveyed: how much they leave unsure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.compensation.solver.payload import (
    beyond_survey,
    load_error,
    load_reasons,
    with_surveyed_load,
)
from postproc.robot.state import make_states

Q = np.deg2rad([[5.0, 10.0, -95.0, 20.0, 50.0, 30.0]] * 4)
LOADS = np.array([0.0, 0.4, 20.0, np.nan])


def states(loads=LOADS):
    n = len(loads)
    side, centre = np.ones((n, 6)), np.full((n, 3), 0.1)
    return make_states(Q[:n], side, payload=loads, payload_com=centre)


def test_loads_near_the_survey_count_as_surveyed(job_model, job_cell):
    assert job_model.ranges.payload == (0.0, 0.0)
    assert beyond_survey(job_model, job_cell, states()).tolist() == [0, 0, 1, 0]
    near = with_surveyed_load(job_model, job_cell, states())
    assert near.payload[:3].tolist() == [0.0] * 3 and np.isnan(near.payload[3])


def test_what_a_load_leaves_unsure_grows_with_it(job_model, job_cell):
    error = load_error(job_model, job_cell, states(np.array([0.4, 20.0, 40.0, 400.0])))
    size = np.linalg.norm(error, axis=1)
    assert size[0] == 0.0 and (np.diff(size) > 0.0).all()


def test_only_a_load_beyond_the_limit_of_the_cell_is_rejected(job_model, job_cell):
    loads = np.array([0.0, 0.7, 400.0])
    ((text, rejected),) = load_reasons(job_model, job_cell, states(loads)).items()
    assert "payload_mm" in text and rejected.tolist() == [False, False, True]
    limits = job_cell.limits.model_copy(update={"payload_mm": 50.0})
    free = replace(job_cell, limits=limits)
    ((_, none),) = load_reasons(job_model, free, states(loads)).items()
    assert not none.any()
