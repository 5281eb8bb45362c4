"""Claims of docs/figures.md, measured at full size: python -m tests.evidence."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

from postproc.calibration.effect_selection import fit_survey, model_of
from postproc.calibration.fit import fit
from postproc.calibration.measurements import Measurements
from postproc.calibration.survey_program import write_survey
from postproc.compensation.compensate import compensate
from postproc.compensation.outcome import Status
from postproc.compensation.program import plan_visits, read_program, with_measured_play
from postproc.compensation.program import states_of as planned_states
from postproc.compensation.solver.inverse_model import new_numbers, solve_visits
from postproc.language.visits import Meaning
from postproc.model.effects import BASE_EFFECTS
from postproc.model.model import Model
from postproc.report.simulation import setup_of, simulate_file, visits_of
from postproc.robot.arm import load_arm
from postproc.robot.cell import Cell, load_cell
from postproc.robot.state import States, make_states
from postproc.simulation import (
    VirtualArrivals,
    campaign_length,
    land,
    sample_survey,
    stream,
    virtual_arm,
)

ROOT = Path(__file__).parents[1]
CELL = ROOT / "programs" / "cell.toml"
TRACKER = np.array([3.15, -2.48, 1.12])  # [m]
ARMS, ROWS, HELD_OUT = range(1001, 1051), 300, 200


def states_of(a: VirtualArrivals) -> States:
    """Describe what the virtual arm did as the model sees it."""
    known = {
        name: getattr(a, name)
        for name in ("travel", "speed", "temperature", "payload", "payload_com")
    }
    return make_states(a.q, np.sign(a.side), a.tool[:, :3, 3], **known)


def coverage() -> str:
    """Pool, over arms, the coordinates of true errors inside the 95 % intervals."""
    arm, inside = load_arm("nj220-2.7"), []
    for seed in ARMS:
        made = virtual_arm(seed)
        rows = sample_survey(made, ROWS, seed=seed)
        survey = Measurements(
            path=Path("survey"),
            states=states_of(rows),
            position=made.measure(rows, TRACKER, stream(seed, "tracker")),
            ids=tuple(map(str, range(ROWS))),
            line=np.arange(ROWS),
            inferred=np.zeros(ROWS, dtype=bool),
            sha256="0" * 64,
        )
        model = model_of(fit_survey(survey, arm, BASE_EFFECTS, TRACKER), survey)
        others = sample_survey(made, HELD_OUT, seed=seed + 5000)
        told = model.predict(arm, states_of(others))
        off = np.abs(made.error(others) - told.error) / told.std_model
        inside.append((off < 1.96).mean())
    return (
        f"coverage: {np.mean(inside):.1%} of {len(inside) * HELD_OUT * 3} coordinates "
        f"of true errors on {len(inside)} arms (per arm {min(inside):.1%} to "
        f"{max(inside):.1%})"
    )


def direction(seed: int = 41) -> str:
    """Compare fits with and without direction, and the published ones."""
    said = [f"drilling job, virtual arm {seed}, true error mean / max mm:"]
    with tempfile.TemporaryDirectory() as name:
        survey = _surveyed(Path(name), seed)
        for title, how in (
            ("with direction", {"effects": BASE_EFFECTS}),
            ("without direction", {"effects": ("geometry",)}),
            ("eja-elm", {"method": "eja-elm"}),
            ("elm", {"method": "elm"}),
        ):
            error = _drilled(survey, seed, how)
            said.append(f"  {title}: {error.mean():.4f} / {error.max():.4f}")
    return "\n".join(said)


def _surveyed(folder: Path, seed: int) -> Path:
    """Let a virtual arm run a survey of 300 poses; return the readings."""
    write_survey(CELL, folder / "survey.pdl", ROWS)
    simulate_file(folder / "survey.pdl", CELL, seed).write(folder / "survey.csv")
    return folder / "survey.csv"


def _drilled(survey: Path, seed: int, how: dict[str, object]) -> np.ndarray:
    """Return the true errors [mm] of the compensated drilling job."""
    cell = load_cell(CELL)
    model = fit(survey, cell=cell, **how).model  # type: ignore[arg-type]
    source = ROOT / "programs" / "drilling.pdl"
    done = compensate(source.read_bytes(), cell, model, name=source.name)
    original = visits_of(source, cell)
    executed = read_program(done.outputs, cell).visits
    setup = setup_of(cell)
    rows = campaign_length(original)
    arm = virtual_arm(seed, coupling=setup.coupling, rows=rows, tool=setup.tool)
    landing = land(arm, setup, original, executed)
    targets = original.target.literal[landing.visit] >= 0
    return np.linalg.norm(landing.error[targets], axis=1) * 1e3


def digits(seed: int = 41) -> str:
    """Tell what solving leaves and digits add on the drilling job's POS literals."""
    with tempfile.TemporaryDirectory() as name:
        model = fit(_surveyed(Path(name), seed), cell=load_cell(CELL)).model
    left, added = solved_and_written(load_cell(CELL), model)
    return (
        f"digits: solving leaves {left.max():.3f} um at most, the digits written add "
        f"{added.max():.3f} um at most, over {len(left)} POS literals"
    )


def solved_and_written(cell: Cell, model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Return residuals of solving and shifts by rounding [um], (n,) each."""
    source = ROOT / "programs" / "drilling.pdl"
    done = compensate(source.read_bytes(), cell, model, name=source.name)
    cell = with_measured_play(cell, model)
    reading = read_program({source.name: source.read_bytes()}, cell)
    planned = plan_visits(reading.visits, cell)
    at = planned_states(planned.plan, cell, cell.temperature)
    at = at.with_(direction=done.decisions.side)
    exact = solve_visits(model, cell, planned, at)
    rows = (done.decisions.status == Status.CORRECTED) & (
        done.visits.target.meaning == Meaning.POSE
    )
    shift = done.decisions.corrected - new_numbers(
        reading.visits, cell.arm, planned.plan, exact, planned.plan.aside
    )
    added = np.linalg.norm(shift[rows, :3], axis=1) * 1e3
    return exact.residual[rows] * 1e6, added


CLAIMS = {claim.__name__: claim for claim in (coverage, direction, digits)}

if __name__ == "__main__":
    for chosen in sys.argv[1:] or CLAIMS:
        print(CLAIMS[chosen](), flush=True)
