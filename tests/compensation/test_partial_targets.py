"""Targets of which numbers are missing (KRL): the arm keeps these from before."""

from __future__ import annotations

import re

import numpy as np
import pytest

from postproc.compensation.options import DEFAULT_OPTIONS
from postproc.compensation.outcome import Status
from postproc.compensation.program import plan_visits, prepare_cell, read_program
from postproc.compensation.scale.windowing import cut_points
from postproc.compensation.solver.dependants import with_dependants
from postproc.language.krl.moves import PARTIAL
from postproc.motion.targets import AMBIGUOUS, CODE, NO_TARGET
from tests.compensation.curved import (  # noqa: F401
    CENTRE,
    KR,
    curved_cell,
    curved_model,
    curved_truth,
    frame,
    job,
    plans,
    tool_pose,
)

SPREAD = np.deg2rad([25.0, 8.0, 8.0, 30.0, 15.0, 30.0])


def places(k: int, seed: int) -> np.ndarray:
    """Draw TCP poses that lines connect, (k, 4, 4) [m]."""
    rng = np.random.default_rng(seed)
    return KR.flange(CENTRE + rng.uniform(-0.5, 0.5, (k, 6)) * SPREAD) @ tool_pose()


def reasons(decided) -> list[str]:
    return [decided.reasons[k].text for k in decided.why.tolist()]


def test_the_arm_stands_where_the_commanded_place_leads(cell, truth, model):
    """Before it, above it, aside by axes, and on from there: lines are corrected."""
    lines, wanted_z, n = [], [], 6
    for a, b in places(2 * n, 31).reshape(n, 2, 4, 4):
        wanted_z.append(a[2, 3] + 0.05)
        lines += [
            f"LIN {frame(a)}",
            f"LIN {{Z {1000 * wanted_z[-1]:.4f}}}",
            f"LIN {frame(b)}",
            "PTP {A1 12.5,A5 52}",
        ]
    done, (before, after) = plans(job(*lines), cell, model)
    decided = done.decisions
    status = decided.status[2:].reshape(n, 4)
    assert (status[:, [0, 2]] == Status.CORRECTED).all()
    assert (status[:, [1, 3]] == Status.RUNTIME).all()
    assert {
        reason
        for reason, one in zip(reasons(decided)[2:], status.ravel(), strict=True)
        if one == Status.RUNTIME
    } == {PARTIAL.text}
    assert (after.reason == 0).all()
    old, new = (p.tcp[2:, :3, 3].reshape(n, 4, 3) for p in (before, after))
    moved = new - old
    # What is written stays; the rest moves along with the corrected place before.
    assert np.allclose(new[:, 1, 2], wanted_z, atol=1e-7)
    assert np.allclose(moved[:, 1, :2], moved[:, 0, :2], atol=1e-7)
    assert np.linalg.norm(moved[:, 0, :2], axis=1).min() > 1e-4
    q = after.q[2:].reshape(n, 4, 6)
    assert np.allclose(np.rad2deg(q[:, 3, [0, 4]]), [12.5, 52.0])
    kept = [1, 2, 3, 5]
    assert np.array_equal(q[:, 3, kept], q[:, 2, kept])
    # Lines before and behind land where they should, or they would not be corrected.
    tool = np.tile(cell.tool.pose[:3, 3], (len(after.q), 1))
    landed = truth.tcp(after.q, after.direction, tool)[2:].reshape(n, 4, 3)
    plain = truth.tcp(before.q, before.direction, tool)[2:].reshape(n, 4, 3)
    assert np.linalg.norm((landed - old)[:, [0, 2]], axis=2).max() < 2e-5
    assert np.linalg.norm((plain - old)[:, [0, 2]], axis=2).min() > 3e-4


def test_only_full_targets_are_written_anew(cell, model):
    a, b = places(2, 33)
    source = job(f"LIN {frame(a)}", "LIN {X 900.5,Y 20.25,Z 1000}", f"LIN {frame(b)}")
    text = plans(source, cell, model)[0].outputs["job.src"]
    assert b"LIN {X 900.5,Y 20.25,Z 1000}" in text
    blank = [re.sub(rb"-?\d+(\.\d+)?", b"0", t).split(b"\n") for t in (source, text)]
    assert blank[0] == [line for line in blank[1] if not line.startswith(b";")]


@pytest.mark.parametrize(
    ("between", "partial"),
    [
        ("$TOOL={X 0,Y 0,Z 0,A 0,B 0,C 0}", "LIN {Z 1000}"),
        ("$BASE={X 10,Y 0,Z 0,A 0,B 0,C 0}", "LIN {Z 1000}"),
        ("", "LIN {A 10}"),
        ("", "PTP {Z 1000}"),
        ("", "LIN {Z 1000,E1 5}"),
        ("LIN XNOT", "LIN {Z 1000}"),
        ("LIN XNOT", "PTP {A1 10}"),
    ],
)
def test_what_is_not_sure_loses_the_place(cell, model, between, partial):
    a, b = places(2, 33)
    lines = f"LIN {frame(a)}", between, partial, f"LIN {frame(b)}"
    done, (before, _) = plans(job(*lines), cell, model)
    assert np.isnan(before.q[-2:]).all()
    assert (done.decisions.status[-2:] != Status.CORRECTED).all()


@pytest.mark.parametrize("partial", ["LIN {Z 1000}", "PTP {A1 10}"])
def test_the_ways_to_it_must_agree(cell, model, partial):
    a, b = places(2, 33)
    ways = ["IF $IN[1] THEN", f"LIN {frame(b)}", "ENDIF"]
    lines = f"LIN {frame(a)}", *ways, partial
    _, (before, _) = plans(job(*lines), cell, model)
    assert before.reason[-1] == CODE[AMBIGUOUS] and np.isnan(before.q[-1]).all()
    ways[1] = "LIN XNOT"  # of one way nobody knows where it ends
    _, (before, _) = plans(job(f"LIN {frame(a)}", *ways, partial), cell, model)
    assert before.reason[-1] == CODE[NO_TARGET] and np.isnan(before.q[-1]).all()


def test_what_moves_along_is_foretold(cell, model):
    a = places(1, 33)[0]
    lines = ["$BASE={X 10,Y 20,Z 30,A 40,B 10,C -20}", f"LIN {frame(a)}"]
    lines += ["LIN {Z 700}", "LIN {X 900,Y 300}", "LIN {X 850,Y 250,Z 650}"]
    ready = prepare_cell(cell, model, DEFAULT_OPTIONS)
    visits = read_program({"job.src": job(*lines)}, ready).visits
    before, values = plan_visits(visits, ready), np.array(visits.target.values)
    values[2, :3] += [0.5, -0.3, 0.8]
    after = plan_visits(visits.with_columns(values=values), ready)
    real = (after.plan.tcp - before.plan.tcp)[:, :3, 3]
    shift = np.where(np.arange(len(visits))[:, None] == 2, real, 0.0)
    found = with_dependants(visits, before, cell, values, shift)
    sizes = np.linalg.norm(real[2:], axis=1) * 1000.0
    # X, Y, Z stay; then X and Y, but Z of the line before was written; then nothing.
    assert sizes == pytest.approx([np.sqrt(0.98), np.sqrt(0.34), 0.0, 0.0], abs=1e-6)
    assert np.abs(found - real).max() < 1e-9
    assert cut_points(visits).tolist() == [True, True, False, False, False, False]
