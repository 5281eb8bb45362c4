"""A few of the random programs of `make generated`, landing on the virtual arm."""

import numpy as np
import pytest

from tests.generated import lands
from tests.language.reachable import reachable, reread


def test_compensated_programs_land_where_they_say(job_cell, job_model):
    found = [lands(seed, job_cell, job_model) for seed in range(100, 108)]
    errors = np.array([pair for one in found for pair in one.error_mm])
    assert len(errors) > 15
    assert errors[:, 0].mean() > 1.0
    assert errors[:, 1].mean() < 0.03
    status = sum((one.status for one in found), start=type(found[0].status)())
    assert status["compensated"] == status.total() > 5


@pytest.mark.parametrize("seed", range(20))
def test_numbers_are_read_back_from_the_text(seed):
    made = reachable(seed, exact=False)
    again = reread(made, "-- stamp\n" + made.text)
    assert again.ops == made.ops
