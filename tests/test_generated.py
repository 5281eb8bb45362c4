"""A few of the random programs of `make generated`, landing on the virtual arm."""

import re

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.language.visits import Meaning
from tests.generated.found import (
    ALL,
    ALONG,
    CLONED,
    DONE,
    KNOWN,
    PAIRS,
    UNSURE,
    Found,
    within,
)
from tests.generated.landing import lands, program
from tests.language.pdl2.reread import reread

SEEDS = range(100, 148)
LOST = "previous target"  # is not reached
ARCS = re.compile("points of (an|the|its) arc")
WIDE = (
    5858  # a rounded corner before an arc, which no small shift of its point makes up
)
HANDLED = 5361  # moves to a point that a handler changes, computed from another one


@pytest.fixture(scope="module")
def found(job_cell, job_model) -> Found:
    whole = Found()
    for seed in SEEDS:
        whole.add(lands(seed, job_cell, job_model))
    return whole


def test_compensated_programs_land_where_they_say(found):
    errors = found.pairs(KNOWN)
    assert len(errors) > 100
    assert errors[:, 0].mean() > 1.0
    assert errors[:, 1].mean() < 0.03
    assert errors[:, 1].max() < 0.1


def test_cloned_points_do_so_too(found):
    errors = found.pairs(CLONED)
    assert len(errors) > 10
    assert errors[:, 1].mean() < 0.03


def test_what_is_not_sure_is_listed_with_an_error_that_holds(found):
    errors = found.pairs(UNSURE)
    assert len(errors) > 20
    assert errors[:, 1].mean() < 0.5 * errors[:, 0].mean()
    assert within(found.z) >= 0.95
    assert len(found.pairs(ALL)) == len(errors) + len(found.pairs(KNOWN))
    assert set(found.error_mm) == set(PAIRS)


def test_only_what_is_computed_from_a_target_moves_along(found):
    errors = found.pairs(ALONG)
    assert errors[:, 1].mean() < 0.5 * errors[:, 0].mean()


def test_what_is_seen_at_one_value_from_one_side_is_compensated(found):
    assert found.wrong == []
    compensated = sum(n for text, n in found.once.items() if text.startswith(DONE))
    # Points drawn at random often make arcs that no correction should touch, and
    # now and then moves that no arm can make.
    arcs = sum(n for text, n in found.once.items() if ARCS.search(text))
    lost = sum(n for text, n in found.once.items() if LOST in text)
    assert compensated > 0.9 * (found.once.total() - arcs - lost) > 100
    assert arcs < 0.1 * found.once.total() and lost < 0.05 * found.once.total()
    assert found.once[DONE] > 100


def test_what_a_point_that_a_handler_changes_may_be_stays(job_cell, job_model):
    assert lands(HANDLED, job_cell, job_model).wrong == []


def test_no_point_moves_farther_than_a_correction_may(job_cell, job_model):
    made, options = program(WIDE)
    pages = {name: data for name, data in made.files.items() if name != "job.pdl"}
    done = compensate(
        made.files["job.pdl"], job_cell, job_model, pages=pages, options=options
    )
    moved = (done.decisions.corrected - done.visits.target.values)[:, :3]
    poses = done.visits.target.meaning == Meaning.POSE
    way = np.linalg.norm(np.nan_to_num(moved[poses]), axis=1)
    assert 0 < way.max() <= job_cell.limits.correction_mm


@pytest.mark.parametrize("seed", range(24))
def test_numbers_are_read_back_from_the_text(seed):
    made, _ = program(seed)
    again, lines = reread(made, {})
    assert again.ops == made.ops and again.handlers == made.handlers
    assert lines == {line: line for line in lines}
