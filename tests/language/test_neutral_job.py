"""One job in every language: the same visits, states, corrections and landings."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.eligibility.configuration_flags import STRANDED
from postproc.compensation.program import plan_visits, read_program
from postproc.report.simulation import setup_of
from postproc.simulation import virtual_arm
from postproc.simulation.program import land
from tests.conftest import SEED
from tests.language.neutral_job import LANGUAGES, compensated, drawn, rapid

SAME = {
    "kind", "meaning", "via", "fly", "tool_remote", "wrist_joint", "nearest_turn"
}  # fmt: skip
STOP_MM = 0.1


def readings(cell, seed):
    job = drawn(cell, seed)
    return [read_program(write(job), cell) for write in LANGUAGES.values()]


@pytest.mark.parametrize("seed", range(6))
def test_visits_and_states_are_the_same(bench_cell, seed):
    one, *others = (reading.visits for reading in readings(bench_cell, seed))
    for two in others:
        assert_same_visits(one, two, bench_cell)


def assert_same_visits(one, two, bench_cell):
    assert len(one) == len(two) > 40
    for name in SAME:
        a, b = one.columns[name], two.columns[name]
        assert np.array_equal(a, b), name
    assert np.array_equal(one.graph.pred, two.graph.pred)
    assert np.array_equal(one.graph.pred_start, two.graph.pred_start)
    assert np.array_equal(one.reason, two.reason)
    fly = one.motion.fly & ~one.motion.via
    for name in ("size_mm", "blend", "rule"):
        a, b = one.columns[name][fly], two.columns[name][fly]
        np.testing.assert_array_equal(a, b)
    np.testing.assert_allclose(one.speed.linear, two.speed.linear)
    plans = [plan_visits(v, bench_cell) for v in (one, two)]
    more = plans[0].reasons.none & ~plans[1].reasons.none
    # Where the arm has stranded, a line to S and T does not tell the configuration.
    found = {plans[1].reasons[k].code for k in np.flatnonzero(more)}
    assert found <= {STRANDED.code}
    assert (
        more.sum() <= 2 and not (plans[1].reasons.none & ~plans[0].reasons.none).any()
    )
    assert plans[0].reasons.none.mean() > 0.9
    a, b = (planned.plan for planned in plans)
    np.testing.assert_allclose(a.q, b.q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(a.side, b.side, rtol=0, atol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_corrections_are_the_same(bench_cell, bench_model, seed):
    job = drawn(bench_cell, seed)
    one, *others = (
        compensated(name, write(job), bench_cell, bench_model)
        for name, write in LANGUAGES.items()
    )
    for two in others:
        assert_same_corrections(one, two)


def assert_same_corrections(one, two):
    a, b = one.decisions, two.decisions
    assert (a.status == b.status).all() and (a.status == 0).mean() > 0.8
    np.testing.assert_allclose(a.correction, b.correction, rtol=0, atol=1e-9)
    # Position [mm] and joint angles have the same decimals in both languages.
    joints = one.visits.target.meaning == 1
    np.testing.assert_array_equal(a.corrected[~joints, :3], b.corrected[~joints, :3])
    np.testing.assert_array_equal(a.corrected[joints, :6], b.corrected[joints, :6])


def test_only_numbers_of_targets_differ(bench_cell, bench_model):
    source = rapid(drawn(bench_cell, 1))
    found = compensate(source, bench_cell, bench_model, name="job.mod")
    lines = found.outputs["job.mod"].splitlines()
    assert lines.pop(1).startswith(b"! postproc ")
    for old, new in zip(source.splitlines(), lines, strict=True):
        if old != new:
            assert b"robtarget" in old or b"Move" in old
            assert old.split(b"],")[1:] == new.split(b"],")[1:] or b"MoveC" in old


@pytest.mark.parametrize("name", LANGUAGES)
def test_the_tool_lands_at_stops(bench_cell, bench_model, name):
    source = LANGUAGES[name](drawn(bench_cell, 2))
    found = compensated(name, source, bench_cell, bench_model)
    given, made = (
        read_program(files, bench_cell).visits
        for files in (source, {**source, **found.outputs})
    )
    arm = virtual_arm(SEED, tool=setup_of(bench_cell).tool)
    landing = land(arm, setup_of(bench_cell), given, made)
    stops = ~given.motion.fly[landing.visit] & ~given.motion.via[landing.visit]
    stops &= landing.visit > 0  # where the arm begins, its joints lie nobody knows how
    miss = 1000.0 * np.linalg.norm(landing.error[stops], axis=1)
    assert stops.sum() > 15
    assert miss.mean() <= 0.02 and miss.max() <= STOP_MM
