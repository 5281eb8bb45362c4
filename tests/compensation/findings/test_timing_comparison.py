"""What is said of a program that is run in time, and when that ends with 1."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.findings.timing_comparison import InTime
from postproc.compensation.options import IN_TIME, Options
from postproc.motion.cycle_time import run
from postproc.motion.targets import TargetKind
from postproc.report.json import report_text
from tests.bench.made import milling
from tests.made_targets import make_targets

TIMED = Options(timing=True)
JOB = b"\n".join(
    [
        b"PROGRAM job", b"BEGIN",
        b"  MOVE JOINT TO {4.0, -6.0, -84.0, 9.0, 53.0, -12.0}",
        b"  MOVE JOINT TO {0.0, 0.0, -90.0, 0.0, 60.0, 0.0}",
        b"  $LIN_SPD := 0.2",
        b"  MOVE JOINT TO POS(-600, 10, 350, -87, 88, 3, '')",
        b"  MOVE LINEAR TO POS(-500, -10, 380, -87, 88, 3, '')",
        b"END job", b"",
    ]
)  # fmt: skip


@pytest.fixture(scope="module")
def outcome(bench_cell, bench_model):
    return compensate(JOB, bench_cell, bench_model, name="job.pdl", options=TIMED)


def test_what_is_written_is_the_same_with_and_without(bench_cell, bench_model, outcome):
    for source in (JOB, milling(300).source):
        both = [
            compensate(source, bench_cell, bench_model, options=options)
            for options in (TIMED, Options())
        ]
        assert both[0].outputs == both[1].outputs
        assert both[0].sidecar == both[1].sidecar
        assert both[0].in_time is not None and both[1].in_time is None


def test_long_programs_are_run_in_time_on_demand(bench_cell):
    usual, timed, never = (
        Options(timing=how).within(bench_cell) for how in (None, True, False)
    )
    assert usual.times(IN_TIME) and not usual.times(IN_TIME + 1)
    assert timed.times(10**6) and not never.times(1)


def test_the_report_tells_times_and_paths(outcome):
    told = json.loads(report_text(outcome))
    cycle, (path,) = told["timing"]["cycle_s"], told["path"]
    assert 1 < cycle["before"] == pytest.approx(cycle["after"], rel=0.02)
    assert told["timing"]["guessed"] == ["acceleration", "jerk"]
    assert path["line"] == 7 and path["length_mm"] == pytest.approx(106.3, abs=0.1)
    assert path["max_mm"]["after"] < path["max_mm"]["before"]
    assert len(path["curve"]["way_mm"]) == len(path["curve"]["after_mm"]) >= 20
    assert max(path["curve"]["after_mm"]) == pytest.approx(
        path["max_mm"]["after"], abs=1e-4
    )
    assert told["path_accuracy"]["after"]["n"] == 1
    assert [t["speed_mm_s"] for t in told["targets"]] == [0, 0, 0, 0]
    said = outcome.in_time.summary(outcome.visits)
    assert outcome.exit_code == 0 and "from guessed limits" in said
    largest = f"(systematic part): at most {path['max_mm']['after']:.3f} mm, "
    assert largest in said and said.index(", line 7 ") < said.index("; mean ")


def joint_cycle(arm, q, **more):
    kind = np.full(len(q), int(TargetKind.JOINTS))
    return run(arm, make_targets(kind, joints=np.array(q), **more))


@pytest.fixture
def pair(bench_cell):
    """A program of two moves, and ways to run it."""
    arm, home = bench_cell.arm, np.radians([5.0, 5.0, -95.0, 20.0, 50.0, -30.0])
    near = [home, home + 0.1, home - 0.1]
    beyond = [home, home + 0.1, np.append(arm.upper[:1] + 0.01, home[1:])]
    return {
        "same": joint_cycle(arm, near),
        "slow": joint_cycle(arm, near, override=np.full(3, 0.9)),
        "beyond": joint_cycle(arm, beyond),
    }


def told_of(outcome, before, after) -> InTime:
    return replace(outcome.in_time, before=before, after=after)


@pytest.mark.parametrize(
    ("before", "after", "code"),
    [
        ("same", "same", ""), ("same", "slow", "cycle-time-increased"),
        ("slow", "same", ""),
        ("same", "beyond", "joint-limit-exceeded"), ("beyond", "beyond", ""),
    ],
)  # fmt: skip
def test_a_program_that_runs_worse_ends_with_1(outcome, pair, before, after, code):
    found = told_of(outcome, pair[before], pair[after])
    codes = [d.code for d in found.findings(outcome.visits)]
    assert codes[-1:] == ([code] if code else [])
    assert replace(outcome, in_time=found).exit_code == int(bool(code))


def test_joints_that_cannot_follow_are_told(bench_cell, bench_model):
    source = JOB.replace(b"$LIN_SPD := 0.2", b"$LIN_SPD := 20")
    found = compensate(source, bench_cell, bench_model, options=TIMED)
    (finding,) = [d for d in found.diagnostics if d.code == "speed-not-reached"]
    assert finding.line == 7 and "of the programmed speed" in finding.message
    slowed = json.loads(report_text(found))["timing"]["slowed"]
    assert [row["line"] for row in slowed] == [7] and 0 < slowed[0]["share"] < 0.5
    assert found.exit_code == 0
