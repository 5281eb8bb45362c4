"""How often the true error of a target is within the bound that `--tolerance` states.

    python docs/studies/tolerance.py [--seeds 580000 580019]

For each virtual arm: a survey of 300 poses from both sides, a model, the job of
`paths.py` compensated, and one arrival at every target of it, with the repeatability of
the arm's joints.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np
import paths

from postproc.report.simulation import (
    DEFAULT,
    campaign_length,
    setup_of,
    virtual_arm,
    visits_of,
)
from postproc.robot.cell import load_cell
from postproc.simulation.program import run_program

TOLERANCES = (0.05, 0.1, 0.2, 0.4, 0.8)  # [mm]


def study(seed: int, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return true errors and 95 % bounds of the targets of one arm [mm]."""
    arm = ("--set", f"simulation.seed={seed}")
    place = paths.fit_a_survey(folder, *arm)
    cell, job = load_cell(place), folder / "job.pdl"
    job.write_text(paths.job(seed, cell))
    out, report = folder / "out.pdl", folder / "out.json"
    paths.done(
        "compensate", job, "--cell", place, "--model", folder / "model.json",
        "-o", out, "--tolerance", 0.3, "--report", report,
    )  # fmt: skip
    bound = np.array(json.loads(report.read_bytes())["tolerance"]["bound_95_mm"], float)
    setup, original, ran = setup_of(cell), visits_of(job, cell), visits_of(out, cell)
    virtual = virtual_arm(
        seed, [*DEFAULT], chain=setup.chain, coupling=setup.coupling,
        rows=campaign_length(ran), tool=setup.tool, tracker=setup.tracker,
        gravity=setup.gravity,
    )  # fmt: skip
    asked, done = (run_program(virtual, setup, one) for one in (original, ran))
    visit, here, there = np.intersect1d(asked.visit, done.visit, return_indices=True)
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=done.arrivals.q.shape) * virtual.joint_noise
    landed = virtual.tcp(done.arrivals, noise)[there]
    error = landed - virtual.nominal_tcp(asked.arrivals)[here]
    error, bound = 1e3 * np.linalg.norm(error, axis=1), bound[visit]
    known = ~np.isnan(bound)
    return error[known], bound[known]


def report_share(name: str, within: np.ndarray) -> None:
    """Print how many of some targets are within their bounds."""
    share = f"{100 * within.mean():.1f} %" if len(within) else "none"
    print(f"{name}: {share} of {len(within)} within")


def report_coverage(error: np.ndarray, bound: np.ndarray) -> None:
    """Print the coverage of all targets, by quartile of the bound, and of passes."""
    report_share("all", error <= bound)
    quartile = np.searchsorted(np.quantile(bound, [0.25, 0.5, 0.75]), bound)
    for k in range(4):
        own = quartile == k
        low, high = bound[own].min(), bound[own].max()
        name = f"quartile {k + 1}, bound {low:.3f} to {high:.3f} mm"
        report_share(name, (error <= bound)[own])
    for tolerance in TOLERANCES:
        passes, near = bound <= tolerance, np.abs(bound / tolerance - 1.0) <= 0.1
        shares = []
        for own in (passes, passes & near):
            beyond = 100 * (error[own] > tolerance).mean() if own.any() else np.nan
            shares.append(f"{own.sum()} ({beyond:.2f} % of them outside)")
        print(
            f"{tolerance} mm: pass {shares[0]}, "
            f"with a bound within 10 % of it {shares[1]}"
        )


def main() -> None:
    """Print one line an arm, then the coverage and the targets that pass."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs=2, default=(580000, 580019))
    first, last = parser.parse_args().seeds
    print("| arm | targets | within the bound | mean error mm | mean bound mm |")
    print("|---|---|---|---|---|", flush=True)
    errors, bounds = [], []
    for seed in range(first, last + 1):
        with tempfile.TemporaryDirectory() as folder:
            error, bound = study(seed, Path(folder))
        share = 100 * (error <= bound).mean()
        print(f"| {seed} | {len(error)} | {share:.1f} % | {error.mean():.4f} | "
              f"{bound.mean():.4f} |", flush=True)  # fmt: skip
        errors.append(error)
        bounds.append(bound)
    report_coverage(np.concatenate(errors), np.concatenate(bounds))


if __name__ == "__main__":
    main()
