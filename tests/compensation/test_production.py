"""The shipped spot and milling jobs on a virtual arm, away from reversals and at them.

The milling job is cut: its first lines hold four passes in both directions, three
arcs between them and the approach; the whole job takes a minute.
"""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.findings.findings import SURE
from postproc.compensation.outcome import Outcome
from postproc.compensation.program import read_program
from postproc.model.model import load_model
from postproc.report.json import report_text
from postproc.report.simulation import setup_of
from postproc.robot.cell import load_cell
from postproc.simulation import land, run_program, virtual_arm
from tests.conftest import ROOT, SEED, make_job

PROGRAMS = ROOT / "programs"
LINES = 800  # of the milling job
STEP = 0.1  # [mm] a step that a turning joint makes


@dataclass(frozen=True)
class Ran:
    """A compensated program that the virtual arm ran.

    Attributes:
        outcome: The compensation.
        landed: True error at every target, (n, 3) [mm].
        error: The arm's own error there, (n, 3) [mm].
        side: Where its gears lay, (n, 6).
    """

    outcome: Outcome
    landed: np.ndarray
    error: np.ndarray
    side: np.ndarray

    @property
    def away(self) -> np.ndarray:
        """Tell which targets lie away from a reversal, by the gears of the arm, (n,).

        All joints rest on their flanks there and at both neighbours.
        """
        near = np.zeros(len(self.side), dtype=bool)
        loose = (np.abs(self.side) < 1).any(axis=1)
        turned = (np.diff(np.sign(self.side), axis=0) != 0).any(axis=1)
        for rows in (loose[1:], turned, loose[:-1]):
            near[1:] |= rows
            near[:-1] |= rows
        return ~near


@pytest.fixture(scope="module")
def production(tmp_path_factory):
    """Compensate a program, run it on the arm that the model was fitted to."""
    text = (PROGRAMS / "cell.toml").read_text(encoding="utf-8")
    folder = make_job(tmp_path_factory.mktemp("production"), text)
    cell, model = load_cell(folder / "cell.toml"), load_model(folder / "model.json")

    def ran(name: str, source: bytes, values: bytes | None = None) -> Ran:
        outcome = compensate(source, cell, model, name=name, variables=values)
        files = {name: source}
        if values is not None:
            files[name.replace(".pdl", ".lsv")] = values
        wanted = read_program(files, cell).visits
        given = read_program({**files, **outcome.outputs}, cell).visits
        arm, setup = virtual_arm(SEED, coupling=cell.arm.coupling), setup_of(cell)
        run = run_program(arm, setup, given)
        landing = land(arm, setup, wanted, given)
        assert len(run.visit) == len(landing.visit) == len(wanted)
        error = arm.tcp(run.arrivals) - arm.nominal_tcp(run.arrivals)
        return Ran(outcome, landing.error * 1e3, error * 1e3, run.arrivals.side)

    return ran


@pytest.fixture(scope="module")
def spot(production) -> Ran:
    source = (PROGRAMS / "spot.pdl").read_bytes()
    return production("spot.pdl", source, (PROGRAMS / "spot.lsv").read_bytes())


@pytest.fixture(scope="module")
def milling(production) -> Ran:
    lines = (PROGRAMS / "milling.pdl").read_bytes().splitlines(keepends=True)
    return production("milling.pdl", b"".join(lines[:LINES] + lines[-6:]))


def test_the_spot_job_lands(spot) -> None:
    targets = spot.outcome.visits.target.literal >= 0
    miss = np.linalg.norm(spot.landed[targets], axis=1)
    sure = np.abs(spot.outcome.decisions.side[targets]).min(axis=1) >= SURE
    assert targets.sum() == 107 and sure.sum() >= 95
    assert miss.mean() <= 0.03 and miss[sure].max() <= 0.1


def test_the_spot_job_says_what_it_assumes_of_fly_points(spot) -> None:
    notes = {d.code: d.message for d in spot.outcome.diagnostics}
    assert "fly points at more than 0.1 mm" in notes["fly-corner"]
    assert "fly-assumed" not in notes  # $FLY_TYPE and $FLY_PER are set


def test_the_milling_job_lands_away_from_reversals(milling) -> None:
    miss = np.linalg.norm(milling.landed, axis=1)
    assert milling.away.mean() > 0.75
    assert miss.mean() <= 0.03 and miss[milling.away].max() <= 0.1


def test_the_correction_steps_where_the_arm_does(milling) -> None:
    """Within one point, both ways; a step of one may be a little below the other."""
    arm = np.linalg.norm(np.diff(milling.error, axis=0), axis=1)
    ours = np.linalg.norm(np.diff(milling.outcome.decisions.correction, axis=0), axis=1)
    ours = ours * 1e3
    run = milling.outcome.visits.run_mates[1:] >= 0
    assert (run & (arm > STEP)).sum() > 10
    for sharp, other in ((arm, ours), (ours, arm)):
        padded = np.pad(other, 1)
        widest = np.maximum.reduce([padded[:-2], padded[1:-1], padded[2:]])
        assert (widest[run & (sharp > STEP)] > STEP / 2).all()


def test_the_correction_is_continuous_where_no_joint_turns(milling) -> None:
    rows = json.loads(report_text(milling.outcome))["targets"]
    side = np.array([row["side"] for row in rows])
    kept = (np.abs(np.diff(side, axis=0)) < 0.01).all(axis=1)
    steps = [row["step_mm"] for row in rows[1:]]
    smooth = [s for s, k in zip(steps, kept, strict=True) if k and s is not None]
    # 2 mm of way and 0.3 deg of turn: the error itself changes by some um a point.
    assert len(smooth) > 0.7 * len(rows) and max(smooth) < 0.02
    correction = np.array([row["correction_mm"] for row in rows])
    k = next(k for k in range(100, len(rows)) if steps[k - 1] is not None)
    assert steps[k - 1] == pytest.approx(
        np.linalg.norm(correction[k] - correction[k - 1]), abs=2e-5
    )
