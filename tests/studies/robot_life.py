"""Years of an arm: a survey, a check of ten readings a month, and what happens to it.

    python -m tests.studies.robot_life --seeds 700 739

Draws arms with geometry, gaps, waves and soft joints of their own (no code of the
package moves them), sets the tracker up anew for every check, and counts alarms, names
and what is left after a refresh.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from postproc.calibration.fit import fit_measurements
from postproc.model.model import Model
from postproc.record.check_rows import CheckRows, place_check
from postproc.record.control import CheckVerdict, Watch
from postproc.record.events import Event
from postproc.record.knowledge import Knowledge
from postproc.robot.cell import Cell, load_cell
from postproc.robot.state import make_states
from tests.calibration.simulator import HIGH, LOW, NJ, PLATE
from tests.record.drawn_robots import (
    Robot,
    check_poses,
    draw_poses,
    draw_robot,
    measure,
)

MONTHS, SURVEYED, SEEN = 24, 220, 300


def survey(robot: Robot, cell: Cell, rng: np.random.Generator) -> Model:
    """Survey an arm in the tracker's frame, and fit it."""
    rows = measure(robot, *draw_poses(SURVEYED, rng), rng, len(PLATE))
    found = fit_measurements(rows, cell, frame="tracker", validate=False)
    return found.model


def left_mm(robot: Robot, model: Model, rng: np.random.Generator) -> float:
    """Return what a model leaves of an arm where it was surveyed, on average [mm].

    But for the place of the base frame, which a survey in the tracker's frame defines.
    """
    q = rng.uniform(LOW, HIGH, (SEEN, 6))
    side = rng.choice([-1.0, 1.0], (SEEN, 6))
    states = make_states(q, side, PLATE[:1].repeat(SEEN, axis=0))
    true = robot.tcp(q, side, states.tool)
    assert model.registration is not None
    nest = states.with_(tool=model.registration.probes[:1].repeat(SEEN, axis=0))
    said = NJ.tcp(q, nest.tool) + model.error(NJ, nest)
    turn, _ = Rotation.align_vectors(true - true.mean(0), said - said.mean(0))
    left = (true - true.mean(0)) - turn.apply(said - said.mean(0))
    return float(np.linalg.norm(left, axis=1).mean()) * 1e3


def watch_months(
    robot: Robot, model: Model, poses: tuple[np.ndarray, np.ndarray], months: int,
    rng: np.random.Generator,
) -> tuple[Watch, list[CheckVerdict]]:  # fmt: skip
    """Check an arm month after month."""
    watch, verdicts = Watch(Knowledge.of(model, NJ)), []
    for _ in range(months):
        rows = place_check(measure(robot, *poses, rng), NJ, model, "tracker")
        verdict, watch = watch.judge(rows)
        verdicts.append(verdict)
    return watch, verdicts


def happen(
    robot: Robot, kind: str, factor: float, least: dict[str, float],
    rng: np.random.Generator,
) -> tuple[Robot, Event, str]:  # fmt: skip
    """Change an arm by a cause of a size that its checks find, times a factor."""
    sign = float(rng.choice([-1, 1]))
    theta, tool, base = robot.dh_theta.copy(), robot.tool.copy(), robot.base.copy()
    size = factor * np.sqrt(2.0) * 1e-3
    if kind.startswith("zero"):
        j = int(kind.split()[-1])
        theta[j - 1] += sign * size * least[f"zero of joint {j}"]
        return replace(robot, dh_theta=theta), Event("remastered", (j,)), kind
    if kind == "motor":
        theta[3] += sign * 3e-4 * factor
        waves = [
            (j, o, s, float(rng.uniform(0, 6.28)) if (j, o) == (3, 8.0) else p)
            for j, o, s, p in robot.waves
        ]
        changed = replace(robot, dh_theta=theta, waves=waves)
        return changed, Event("motor", (4,)), "motor of joint 4"
    if kind == "tool":
        way = rng.standard_normal(3)
        tool += size * least["tool"] * way / np.linalg.norm(way)
        return replace(robot, tool=tool), Event("tool"), "tool"
    if kind == "base":
        way = rng.standard_normal(3)
        base[:3] += size * least["base"] * way / np.linalg.norm(way)
        return replace(robot, base=base), Event("base"), "base"
    j = int(rng.integers(1, 4))
    gaps = robot.backlash.copy()
    gaps[j - 1, 0] += sign * factor * 1e-4
    return replace(robot, backlash=gaps), Event("gear", (j,)), f"gear of joint {j}"


CHANGED = {
    "zero of joint 2": ("geometry.theta2",), "zero of joint 3": ("geometry.theta3",),
    "zero of joint 5": ("geometry.theta5",), "motor": ("geometry.theta4",),
    "tool": tuple(f"geometry.tool_{a}" for a in "xyz"),
    "base": tuple(f"geometry.base_{a}" for a in "xyz"),
    "gear": tuple(f"backlash.b{j}" for j in (1, 2, 3)),
}  # fmt: skip
"""What of a model each kind of change moves, but for new waves."""


def refit_informed(known: Knowledge, kind: str, rows: CheckRows) -> Model:
    """Refit by one who knows what changed: all else stays as the checks have it."""
    names = known.model.effects.names
    free = np.zeros(len(known.mean), dtype=bool)
    free[[k for k, name in enumerate(names) if name in CHANGED[kind]]] = True
    covariance = np.zeros_like(known.covariance)
    covariance[free, free] = 1e-6  # [m^2], [rad^2]: a change of a millimetre or so
    free_only = replace(known, covariance=covariance)
    return free_only.update(rows).to_model()


KINDS = ("zero of joint 2", "zero of joint 3", "zero of joint 5", "motor", "tool",
         "base", "gear")  # fmt: skip


def main(argv: Sequence[str] | None = None) -> None:
    """Run the study and print its figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", nargs=2, type=int, default=[650, 652])
    parser.add_argument("--months", type=int, default=MONTHS)
    given = parser.parse_args(argv)
    cell = load_cell(Path(__file__).parents[2] / "programs" / "cell.toml")
    alarms, checks, worst = 0, 0, 0
    found = {(k, f): [] for k in KINDS for f in (1.0, 2.0)}
    for seed in range(given.seeds[0], given.seeds[1] + 1):
        begun = time.perf_counter()
        rng = np.random.default_rng(seed)
        robot = draw_robot(rng)
        model = survey(robot, cell, rng)
        fitted, poses = time.perf_counter(), check_poses(rng)
        watch, verdicts = watch_months(robot, model, poses, given.months, rng)
        own = sum(not v.in_control for v in verdicts)
        alarms, checks, worst = alarms + own, checks + len(verdicts), max(worst, own)
        least = verdicts[-1].power.found
        print(
            f"{seed}: fit {fitted - begun:.1f} s, left {left_mm(robot, model, rng):.4f}"
            f" mm, {own} alarms of {len(verdicts)}, scale {watch.scale:.2f}, found "
            + ", ".join(f"{k} {np.sqrt(2) * v:.3f}" for k, v in least.items()
                        if "motor" not in k and "gear" not in k),
            flush=True,
        )  # fmt: skip
        print("   blind:", verdicts[-1].power.blind, "alike:", verdicts[-1].power.alike)
        for kind in KINDS:
            for factor in (1.0, 2.0):
                changed, event, name = happen(robot, kind, factor, least, rng)
                rows = place_check(measure(changed, *poses, rng), NJ, model, "tracker")
                verdict, _ = watch.judge(rows)
                causes = [s.cause for s in verdict.shown[:2]]
                first = [n for c in causes for n in (c.name, *c.also)]
                after = watch.after(event).knowledge.update(rows).to_model()
                found[kind, factor].append(
                    (not verdict.in_control, name in first,
                     left_mm(changed, after, rng), left_mm(changed, model, rng),
                     left_mm(changed, refit_informed(watch.knowledge, kind, rows), rng))
                )  # fmt: skip
        print(f"   {time.perf_counter() - fitted:.1f} s", flush=True)
    print(f"{alarms} alarms in {checks} checks, at most {worst} an arm")
    for (kind, factor), each in found.items():
        means = (np.mean(column) for column in zip(*each, strict=True))
        told, named, after, before, informed = means
        print(
            f"{kind} x {factor:g}: found {told:.0%}, named {named:.0%}, "
            f"left {before:.3f} -> {after:.4f} mm (informed {informed:.4f})"
        )


if __name__ == "__main__":
    main()
