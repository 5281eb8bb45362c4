"""Write blind.md: what the diagnosis finds in data whose answers are not known.

PYTHONPATH=. python docs/studies/diagnosed.py [--shared ../shared]
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import numpy as np
from measured import BLIND_TOOL, FLANGE, SETUP, _registered

from postproc.calibration.diagnosis.diagnose import Extension, extend_model
from postproc.calibration.diagnosis.result import Finding
from postproc.calibration.effect_selection import fit_survey, model_of
from postproc.calibration.fit import into_base_frame
from postproc.calibration.measurements import Measurements, read_survey_file
from postproc.model.effect_sum import Combination
from postproc.model.effects import BASE_EFFECTS
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.robot.arm import Arm, load_arm
from postproc.robot.pose import MM

OUT = Path(__file__).parent / "blind.md"
UR10_BASE = ("geometry", "backlash")


def describe(f: Finding) -> str:
    """Write a finding in a few words."""
    where = "" if f.joint is None else f" of joint {f.joint}"
    by = f", driven by {f.source}" if f.effect in ("coupling", "curve") else ""
    settings = {
        k: v for k, v in f.parameters.items() if k in ("row", "order", "centre", "t0")
    }
    told = "".join(f", {k} {v[0]:.4g} {v[2]}" for k, v in settings.items())
    others = [e + (f" {j}" if j else "") for e, j in f.confusable_with]
    either = f"; or as well {', '.join(others)}" if others else ""
    return f"**{f.effect}**{where}{by}{told} (p = {f.p_value:.0e}, share {f.share:.0%}, peak {f.peak_mm:.2f} mm{either})"  # noqa: E501


def mean_length(error: np.ndarray) -> tuple[float, float, float]:
    """Return mean, 95th percentile and maximum of error lengths [mm]."""
    e = np.linalg.norm(error, axis=1) / MM
    return float(e.mean()), float(np.percentile(e, 95)), float(e.max())


def campaign(name: str, folder: Path, arm: Arm) -> str:
    """Diagnose one campaign; one row of the table."""
    survey = read_survey_file(folder / f"{name}_survey.csv", arm, BLIND_TOOL)
    base = model_of(fit_survey(survey, arm, BASE_EFFECTS, None), survey)
    found = extend_model(survey, arm, base)
    verify = read_survey_file(folder / f"{name}_verify.csv", arm, BLIND_TOOL)
    before = mean_length(left(verify, arm, base))
    after = mean_length(left(verify, arm, found.model))
    d = found.diagnosis
    text = "<br>".join(describe(f) for f in d.findings) or "nothing"
    return (
        f"| {name} | {d.verdict} | {text} | {d.before.mean_mm:.4f} -> "
        f"{d.after.mean_mm:.4f} | {before[0]:.4f} -> {after[0]:.4f} "
        f"| {before[1]:.3f} -> {after[1]:.3f} | {before[2]:.3f} -> {after[2]:.3f} |"
    )


def left(rows: Measurements, arm: Arm, model: Model) -> np.ndarray:
    """Return what a model's compensation would leave, (n, 3) [m]."""
    nominal = ArmStates(arm, rows.states).walk.tcp
    return np.asarray(rows.position - nominal - model.error(arm, rows.states))


def blind(folder: Path) -> list[str]:
    """Diagnose all campaigns."""
    arm = load_arm("nj220-2.7")
    head = [
        "| campaign | verdict | found | survey, held out: mean mm | verify: mean mm "
        "| p95 | max |",
        "|---|---|---|---|---|---|---|",
    ]
    rows = []
    for name in "abcdefgh":
        rows.append(campaign(name, folder, arm))
        print(rows[-1], flush=True)
    return [*head, *rows]


def ur10(folder: Path) -> list[str]:
    """Diagnose series B from geometry and backlash, and try the result on series D."""
    arm = load_arm("ur10")
    series = read_survey_file(
        folder / "measurements_joint_configurations.csv", arm, FLANGE
    )
    survey, placed = into_base_frame(series, arm)
    fit = fit_survey(survey, arm, UR10_BASE, placed.tracker, SETUP)
    base = model_of(fit, survey)
    found = extend_model(survey, arm, base, tracker=placed.tracker, setup=SETUP)
    d = found.diagnosis
    lines = [f"Verdict: {d.verdict}.", ""]
    lines += [f"- {describe(f)}" for f in d.findings] or ["- nothing"]
    lines += [f"- still there: {x.what} (p = {x.p_value:.1e})" for x in d.leftovers[:2]]
    lines += ["", "| rows | before: mean mm | p95 | max | after: mean mm | p95 | max |",
              "|---|---|---|---|---|---|---|"]  # fmt: skip
    lines.append(_row("series B, blocks of rows held out", found.held_out.before,
                      found.held_out.after))  # fmt: skip
    other = read_survey_file(folder / "measurements_iso_cubes.csv", arm, FLANGE)
    before, after = (
        _registered(arm, other, effects, values)
        for effects, values in (compensated(base), compensated(found.model))
    )
    lines.append(_row("series D, B's model, only registration refitted", before, after))
    return [*lines, "", *dropped(found)]


def compensated(model: Model) -> tuple[Combination, np.ndarray]:
    """Return what a model compensates."""
    effects, values, _ = model.compensable()
    return effects, values


def dropped(found: Extension) -> list[str]:
    """List rows that count less than fully."""
    return [f"- row {r.id}: {r.why}" for r in found.diagnosis.dropped]


def _row(name: str, before: np.ndarray, after: np.ndarray) -> str:
    cells = [f"{x:.4f}" for e in (before, after) for x in mean_length(e)]
    return f"| {name} | " + " | ".join(cells) + " |"


TEXT = """# Tracing effects in data whose answers are not known here

Written by `PYTHONPATH=. python docs/studies/diagnosed.py`.

## Blind campaigns

Each survey (400 rows) is fitted with geometry, backlash and backlash_profile, then
diagnosed. The columns "survey, held out" are errors on rows of the survey that neither
chose nor fitted anything. The verification rows were measured later, on a warm arm;
they are only evaluated: no step of the tool has been chosen or tuned on them. Effects
of the set-up (a nest that slipped, the tracker) are never compensated; what a survey
says about the present state of the tool is. Mean errors include the tracker's noise
(about 0.027 mm).
"""


def main() -> None:
    """Run and write the page."""
    parser = argparse.ArgumentParser()
    default = os.environ.get("POSTPROC_SHARED", "../shared")
    parser.add_argument("--shared", type=Path, default=Path(default))
    given = parser.parse_args()
    lines = [TEXT, *blind(given.shared / "blind"), "", "## A real arm: UR10", ""]
    lines += ur10(given.shared / "data" / "ipa-ur10")
    OUT.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
