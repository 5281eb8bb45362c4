"""Laws of the weight beside shapes, and at further joints."""

from dataclasses import replace

import pytest

from postproc.calibration.diagnosis.candidates import Library, Projection
from postproc.calibration.diagnosis.investigate import no_progress
from postproc.calibration.diagnosis.search import Search, search
from postproc.calibration.diagnosis.table import Causes
from postproc.calibration.diagnosis.weight import pass_on, weigh_laws
from postproc.calibration.regression import Fit
from postproc.simulation import Planted, stream
from tests import weight_laws
from tests.calibration.planted import TRACKER, campaign, planted_arm, survey

BENDS = {4: 0.38, 5: 0.29, 6: 0.5}  # [mm] at the tool


def searched(base: Fit) -> Search:
    """Search among names and shapes alone, which is fast."""
    causes = Causes(Library.of(base))
    null = causes.null(Projection.of(base), 0)
    return search(base, causes, null, no_progress)


def joints(found: Search, effect: str) -> set[int | None]:
    """List the joints of an effect that were added."""
    families = [a.candidate.family for a in found.additions]
    return {f.joint for f in families if f.effect == effect}


@pytest.fixture(scope="module")
def shaped() -> Search:
    """What a search finds where shapes take the weight of four joints."""
    return searched(weight_laws.measured(31_003, 5.0, "plain").base)


@pytest.mark.slow
def test_the_law_of_the_weight_stays_where_shapes_took_it(shaped):
    found = weigh_laws(shaped, no_progress)
    assert joints(shaped, "compliance") == {2, 3, 5}
    assert joints(found, "compliance") == {2, 3, 4, 5}
    assert found.fit.log_evidence > shaped.fit.log_evidence
    assert sum(a.together for a in found.additions) >= 1


@pytest.mark.slow
def test_shapes_stay_alone_where_no_joint_yields():
    found = searched(weight_laws.measured(31_001, 1.0, "whole", nothing=True).base)
    assert weigh_laws(found, no_progress) is found


@pytest.mark.slow
def test_a_search_without_shapes_is_not_asked(shaped):
    bare = replace(shaped, fit=shaped.base, additions=())
    assert weigh_laws(bare, no_progress) is bare


def test_a_law_is_passed_on_to_joints_where_it_stands_out_less():
    laws = [Planted("bending", j, peak_mm=mm) for j, mm in BENDS.items()]
    c = campaign(33_002, (), 0.0)
    arm = planted_arm(33_002, *laws, rows=400)
    rows = survey(planted_arm(33_002, rows=400), 33_002, 400)
    position = arm.measure(rows, TRACKER, stream(33_002, "tracker"))
    before = searched(replace(c, position=position).base_fit())
    assert joints(before, "bending") == {4, 6}
    assert joints(pass_on(before, no_progress), "bending") == {4, 5, 6}
