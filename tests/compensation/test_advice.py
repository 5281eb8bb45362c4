"""What messages advise for points that several moves share."""

from __future__ import annotations

import pytest

from postproc.compensation.options import Options
from tests.jobs.share import HERE, count

OWN, NO_HELP = (
    "give each move a point of its own",
    "--shared-points clone does not help",
)


def advice(job, **options):
    """Return the advice of every line whose arrivals differ."""
    found = count(HERE / job, options=Options(**options)).reasons
    return {line: why for (_, line), why in found.items() if "arrivals differ" in why}


@pytest.mark.parametrize(
    ("job", "said"),
    [("krl/job17", "(see --shared-points clone)"), ("rapid/job07", "(see --")],
)
def test_moves_that_share_a_point_are_told_what_parts_them(job, said):
    found = advice(job)
    assert found and all(OWN in why and said in why for why in found.values())


def test_one_move_that_makes_all_arrivals_is_not_sent_to_cloning():
    found = advice("krl/job40")
    assert found and all(NO_HELP in why for why in found.values())


def test_cloning_does_not_part_what_one_move_makes():
    lost = {line for line, why in advice("rapid/job18").items() if NO_HELP in why}
    left = count(HERE / "rapid/job18", options=Options(shared_points="clone")).reasons
    assert lost and lost <= {line for (_, line), why in left.items() if why}


def test_a_run_that_has_cloned_does_not_advise_to_clone():
    found = advice("rapid/job05", shared_points="clone")
    assert any(OWN in why and "can write none here" in why for why in found.values())
    assert not any("see --shared-points clone" in why for why in found.values())
