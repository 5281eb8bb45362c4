"""Plant other kinds of faults: what a planner may read, convert or leave out wrongly.

    python -m tests.verify.misreadings [--programs 8] [--first 0]

Every kind is planted in as many programs. A fault is *found* where the second opinion
disagrees; *no effect* where a program has nothing that it changes; *not reached* where
what it changes is counted as not compared. All else is *missed*.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from postproc.compensation.findings import second_opinion as planner
from postproc.language.visits import Meaning, Visits
from postproc.model.model import Model, load_model
from postproc.robot.arm import build_arm
from postproc.robot.cell import Cell, load_cell
from postproc.robot.direction import arrivals_of_rows
from postproc.robot.trajectory import Motion
from postproc.verify.cycle import LINE_PERCENT, MOVE_S, SHORTEST_S
from postproc.verify.opinion import Claim
from tests.any_controller import any_controller
from tests.conftest import make_job
from tests.verify.faults import (
    FLY,
    FOUND,
    MISSED,
    NEAR,
    Case,
    Claims,
    compares_directions,
)
from tests.verify.generated import files_of
from tests.verify.judged import PROGRAMS, compensated

NOTHING = "no effect on this program"
SLIGHT = "not reached: only times over fly points change, or those of lines by less"
FREE = "not reached: a JOINT move whose flags name no turn"
LOST = "not reached: out of reach for such a planner, which corrects nothing there"
STEPS = "not reached: steps from where the arm is"
PLACED = (Meaning.POSE, Meaning.NEAR, Meaning.JOINTS, Meaning.HOME, Meaning.CALIBRATION)
SAME = 1e-9  # of angles, torques and times that are the same


def read_as(one: Case, misread: Callable[[Visits], Visits]) -> Claims:
    """Claim what a planner makes of visits that it misreads."""
    return planned(one, one.job.cell, misread)


def planned(
    one: Case, cell: Cell, misread: Callable[[Visits], Visits] = lambda v: v
) -> Claims:
    """Claim what a planner makes of misread visits, or in another cell."""
    source, output = one.right
    before, after = (
        replace(planner._claim(c.label, misread(c.visits), cell), visits=c.visits)
        for c in (source, output)
    )
    return before, planner._take_directions(
        after, before.visits, one.job.outcome.record
    )


def planned_anew(
    one: Case, cell: Cell, misread: Callable[[Visits], Visits] = lambda v: v
) -> Claims:
    """Likewise, and the correction is for the directions of that planner."""
    source, output = planned(one, cell, misread)
    own = planner._claim(output.label, misread(output.visits), cell).direction
    return source, replace(output, direction=own)


def _frames(
    v: Visits, which: str, change: Callable[[np.ndarray], np.ndarray]
) -> Visits:
    """Change the frames that visits use as tool, base or uframe."""
    frames = np.array(v.frame.poses).reshape(-1, 4, 4)
    rows = np.unique(v.columns[which])
    for k in rows[rows >= 0]:
        frames[k] = change(frames[k])
    return v.with_columns(poses=frames)


def _poses(v: Visits) -> np.ndarray:
    return np.isin(v.target.meaning, (Meaning.POSE, Meaning.NEAR, Meaning.FOR))


def _values(v: Visits, change: Callable[[np.ndarray], np.ndarray]) -> Visits:
    """Change the numbers of poses, (k, w)."""
    values, rows = np.array(v.target.values), _poses(v)
    values[rows] = change(values[rows])
    return v.with_columns(values=values)


# What is read wrongly.


def tool_too_long(one: Case, rng: np.random.Generator) -> Claims:
    """The tool is 0.1 mm longer."""
    shift = np.eye(4)
    shift[2, 3] = 1e-4
    return read_as(one, lambda v: _frames(v, "tool", lambda T: T @ shift))


def tool_left_out(one: Case, rng: np.random.Generator) -> Claims:
    """The tool is the flange."""
    return read_as(one, lambda v: _frames(v, "tool", lambda T: np.eye(4)))


def tool_inverse(one: Case, rng: np.random.Generator) -> Claims:
    """The tool is taken the other way round."""
    return read_as(one, lambda v: _frames(v, "tool", np.linalg.inv))


def frame_order(one: Case, rng: np.random.Generator) -> Claims:
    """Base and user frame are multiplied in the other order."""

    def swapped(v: Visits) -> Visits:
        inverse = _frames(v, "base", np.linalg.inv)
        return inverse.with_columns(base=v.frame.uframe, uframe=v.frame.base)

    return read_as(one, swapped)


def base_left_out(one: Case, rng: np.random.Generator) -> Claims:
    """The arm stands at the world's origin."""
    return read_as(one, lambda v: _frames(v, "base", lambda T: np.eye(4)))


def angles_in_other_order(one: Case, rng: np.random.Generator) -> Claims:
    """The first and third angle of poses are swapped, or w and x of quaternions."""

    def swapped(numbers: np.ndarray) -> np.ndarray:
        order = np.arange(numbers.shape[1])
        order[[3, 5]] = order[[5, 3]]
        return numbers[:, order]

    return read_as(one, lambda v: _values(v, swapped))


def inches(one: Case, rng: np.random.Generator) -> Claims:
    """Lengths of poses are in a unit that is 1 % longer."""
    scale = np.array([1.01, 1.01, 1.01])

    def longer(numbers: np.ndarray) -> np.ndarray:
        return np.column_stack([numbers[:, :3] * scale, numbers[:, 3:]])

    return read_as(one, lambda v: _values(v, longer))


def approach_sign(one: Case, rng: np.random.Generator) -> Claims:
    """A target that is to be neared is passed by as much."""
    return read_as(one, lambda v: v.with_columns(distance_mm=-v.target.distance_mm))


def speed_unit(one: Case, rng: np.random.Generator) -> Claims:
    """Speeds along paths are 20 % higher."""
    return planned_anew(
        one, one.job.cell, lambda v: v.with_columns(linear=v.speed.linear * 1.2)
    )


def override_left_out(one: Case, rng: np.random.Generator) -> Claims:
    """All moves go at 80 % though the program says another override."""

    def slower(v: Visits) -> Visits:
        return v.with_columns(override=np.full(len(v), 0.8))

    return planned_anew(one, one.job.cell, slower)


def arcs_as_lines(one: Case, rng: np.random.Generator) -> Claims:
    """Arcs are cut short: lines to their VIA point and end."""

    def straight(v: Visits) -> Visits:
        arc = v.motion.kind == Motion.CIRCULAR
        motion = np.where(arc, int(Motion.LINEAR), v.motion.kind)
        return v.with_columns(kind=motion, via=np.zeros(len(v), bool))

    return planned_anew(one, one.job.cell, straight)


def lines_as_joint_moves(one: Case, rng: np.random.Generator) -> Claims:
    """Lines are moves of the joints."""
    lines = Motion.LINEAR, Motion.JOINT

    def bent(v: Visits) -> Visits:
        return v.with_columns(
            kind=np.where(v.motion.kind == lines[0], lines[1], v.motion.kind)
        )

    return planned_anew(one, one.job.cell, bent)


def home_elsewhere(one: Case, rng: np.random.Generator) -> Claims:
    """Joint targets are read with the first two angles swapped."""

    def swapped(v: Visits) -> Visits:
        values, rows = (
            np.array(v.target.values),
            np.flatnonzero(v.target.meaning == Meaning.JOINTS),
        )
        values[rows[:, None], [0, 1]] = values[rows[:, None], [1, 0]]
        return v.with_columns(values=values)

    return read_as(one, swapped)


# What is wrong of the arm.


def _arm(one: Case, **changes: object) -> Cell:
    """Plan with another arm file; its play stays."""
    arm = one.job.cell.arm
    made = build_arm(arm.file.model_copy(update=changes))
    return replace(one.job.cell, arm=replace(made, play=arm.play, weight=arm.weight))


def coupling_made_up(one: Case, rng: np.random.Generator) -> Claims:
    """The drives of the wrist are taken as coupled, which those of the arm are not."""
    coupled = np.eye(6)
    coupled[4, 3], coupled[5, 3], coupled[5, 4] = -1.0, 1.0, -1.0
    joints = one.job.cell.arm.file.joints
    section = joints.model_copy(update={"drive_coupling": coupled.tolist()})
    return planned_anew(one, _arm(one, joints=section))


def a_link_too_long(one: Case, rng: np.random.Generator) -> Claims:
    """The forearm is 0.1 mm longer, in forward and inverse kinematics alike."""
    file = one.job.cell.arm.file
    assert file.opw is not None
    d = list(file.dh.d_mm)
    d[3] += 0.1
    changes = {
        "dh": file.dh.model_copy(update={"d_mm": d}),
        "opw": file.opw.model_copy(update={"c3_mm": file.opw.c3_mm + 0.1}),
    }
    return planned(one, _arm(one, **changes))


def other_velocity(one: Case, rng: np.random.Generator) -> Claims:
    """One joint is 10 % faster."""
    return planned_anew(one, _faster(one, "velocity_deg_s", rng))


def other_acceleration(one: Case, rng: np.random.Generator) -> Claims:
    """One joint has 20 % more acceleration."""
    return planned_anew(one, _faster(one, "acceleration_deg_s2", rng))


def _faster(one: Case, key: str, rng: np.random.Generator) -> Cell:
    joints = one.job.cell.arm.file.joints
    values = list(getattr(joints, key))
    values[int(rng.integers(3))] *= 1.1 if "velocity" in key else 1.2
    return _arm(one, joints=joints.model_copy(update={key: values}))


def limits_left_out(one: Case, rng: np.random.Generator) -> Claims:
    """Nobody looks at the limits of the joints."""
    source, output = one.right
    return source, replace(output, within=np.abs(output.within))


def limits_too_narrow(one: Case, rng: np.random.Generator) -> Claims:
    """The planner says that one move leaves a joint's range."""
    source, output = one.right
    within = np.array(output.within)
    rows = np.flatnonzero(within > 0)
    within[rng.permutation(rows)[:1]] = -1
    return source, replace(output, within=within)


def payload_doubled(one: Case, rng: np.random.Generator) -> Claims:
    """What is carried counts twice in the torques."""
    return _torques(one, lambda cell, q, load: planner._torque(
        cell, q, load * np.array([2.0, 1.0, 1.0, 1.0])))  # fmt: skip


def payload_at_the_flange(one: Case, rng: np.random.Generator) -> Claims:
    """Its centre is taken at the flange."""
    return _torques(one, lambda cell, q, load: planner._torque(
        cell, q, load * np.array([1.0, 0.0, 0.0, 0.0])))  # fmt: skip


def gravity_upward(one: Case, rng: np.random.Generator) -> Claims:
    """Weight pulls up, as on an arm that hangs."""
    return _torques(one, lambda cell, q, load: -planner._torque(cell, q, load))


def _torques(
    one: Case, made: Callable[[Cell, np.ndarray, np.ndarray], np.ndarray]
) -> Claims:
    first, second = (
        replace(c, torque=made(one.job.cell, c.q, c.payload)) for c in one.right
    )
    return first, second


# What is wrong of one arrival.


def _arrival(one: Case, rows: np.ndarray, rng: np.random.Generator) -> Claims:
    """Turn the lambda of one joint at one of some visits."""
    told = np.argwhere(one.output.direction != 0)
    told = told[np.isin(told[:, 0], np.flatnonzero(rows))]
    if not len(told):
        return one.right
    i, j = told[rng.integers(len(told))]
    direction = np.array(one.output.direction)
    direction[i, j] *= -1
    return one.with_directions(direction)


def _stops(one: Case) -> np.ndarray:
    v = one.output.visits
    return np.asarray(~(v.motion.fly | v.motion.via))


def lambda_behind_fly(one: Case, rng: np.random.Generator) -> Claims:
    """A stop behind a fly point is corrected for the other side."""
    v = one.output.visits
    return _arrival(
        one, _stops(one) & (v.graph.before >= 0) & v.motion.fly[v.graph.before], rng
    )


def lambda_behind_stop(one: Case, rng: np.random.Generator) -> Claims:
    """A stop behind a stop is corrected for the other side."""
    v = one.output.visits
    return _arrival(
        one, _stops(one) & (v.graph.before >= 0) & ~v.motion.fly[v.graph.before], rng
    )


def lambda_of_first_moves(one: Case, rng: np.random.Generator) -> Claims:
    """One of the first three arrivals is corrected for the other side."""
    return _arrival(one, _stops(one) & (np.arange(len(one.output)) < 3), rng)


def lambda_of_arcs(one: Case, rng: np.random.Generator) -> Claims:
    """The end of an arc is corrected for the other side."""
    arc = one.output.visits.motion.kind == Motion.CIRCULAR
    return _arrival(one, _stops(one) & arc, rng)


def lambda_one_late(one: Case, rng: np.random.Generator) -> Claims:
    """Every target is corrected for the side of the one before."""
    return one.with_directions(np.roll(one.output.direction, 1, axis=0))


def lambda_of_the_step(one: Case, rng: np.random.Generator) -> Claims:
    """The direction is that from target to target, whatever is between."""
    told = arrivals_of_rows(one.job.cell.arm, one.output.q).direction
    return one.with_directions(np.where(one.output.direction != 0, told, 0))


def all_lambda_turned(one: Case, rng: np.random.Generator) -> Claims:
    """Every direction has the other sign."""
    return one.with_directions(-one.output.direction)


def a_turn_off(one: Case, rng: np.random.Generator) -> Claims:
    """Axis 6 is a turn away at one pose, before and after."""
    v = one.output.visits
    rows = np.flatnonzero(_poses(v) & ~np.isnan(one.output.q).any(axis=1))
    return _elsewhere(one, rows, np.array([0, 0, 0, 0, 0, 2 * np.pi]), rng)


def a_joint_off(one: Case, rng: np.random.Generator) -> Claims:
    """One joint is 1e-5 rad off at one target."""
    rows = np.flatnonzero(~np.isnan(one.output.q).any(axis=1))
    step = 1e-5 * np.eye(6)[rng.integers(6)]
    return _elsewhere(one, rows, step, rng)


def _elsewhere(
    one: Case, rows: np.ndarray, step: np.ndarray, rng: np.random.Generator
) -> Claims:
    """Claim other joint angles at one of some visits, before and after."""
    if not len(rows):
        return one.right
    i, cell = int(rng.choice(rows)), one.job.cell
    made: list[Claim] = []
    for claim in one.right:
        q = np.array(claim.q)
        q[i] += step
        torque = planner._torque(cell, q, claim.payload)
        singular = planner._singular(cell, q)
        made.append(replace(claim, q=q, torque=torque, singular=singular))
    return made[0], made[1]


def swing_too_large(one: Case, rng: np.random.Generator) -> Claims:
    """What was written is 20 mm from what was to be: the elbow swings."""
    source, output = one.right
    q = np.array(output.q)
    q[:, 1] += 0.02
    return source, replace(output, q=q)


def a_move_left_out(one: Case, rng: np.random.Generator) -> Claims:
    """A stop is skipped: what follows comes from the target before it."""

    def skipped(v: Visits) -> Visits:
        pred, start = np.array(v.graph.pred), v.graph.pred_start[:-1]
        rows = np.flatnonzero(
            (v.graph.before >= 1) & (v.graph.before[v.graph.before] >= 0)
        )
        rows = rows[
            (v.motion.kind[rows] == Motion.JOINT) & (v.graph.before[rows] == rows - 1)
        ]
        if len(rows):
            i = int(rows[len(rows) // 2])
            pred[start[i]] = v.graph.before[v.graph.before[i]]
        return replace(v, graph=replace(v.graph, pred=pred))

    return planned_anew(one, one.job.cell, skipped)


Misreading = Callable[[Case, np.random.Generator], Claims]
KINDS: tuple[Misreading, ...] = (
    tool_too_long, tool_left_out, tool_inverse, frame_order, base_left_out,
    angles_in_other_order, inches, approach_sign, speed_unit, override_left_out,
    arcs_as_lines, lines_as_joint_moves, home_elsewhere, coupling_made_up,
    a_link_too_long, other_velocity, other_acceleration, limits_left_out,
    limits_too_narrow, payload_doubled, payload_at_the_flange, gravity_upward,
    lambda_behind_fly, lambda_behind_stop, lambda_of_first_moves, lambda_of_arcs,
    lambda_one_late, lambda_of_the_step, all_lambda_turned, a_turn_off, a_joint_off,
    swing_too_large, a_move_left_out,
)  # fmt: skip


@dataclass(frozen=True)
class Misread:
    """What came of one kind in one program, and on which row it was found."""

    kind: str
    program: int
    came: str
    row: str = ""


def misread(kind: Misreading, one: Case, seed: int) -> Misread:
    """Plant one kind in one program."""
    wrong = kind(one, np.random.default_rng(seed))
    rows = [row.what for row in one.weigh_rows(wrong).rows if row.beyond]
    came = FOUND if rows else otherwise(one, wrong)
    return Misread(kind.__name__, seed, came, next(iter(rows), ""))


def otherwise(one: Case, wrong: Claims) -> str:
    """Say why a fault was not found: by what it changes."""
    right, told = one.output, wrong[1]
    if not all(_same(one, wrong, name) for name in ("q", "torque", "singular")):
        return _of_places(right, told)
    if not _same(one, wrong, "within"):
        fewer = _compared(one, wrong) < _compared(one, one.right)
        return NEAR if fewer else MISSED
    if not _same(one, wrong, "direction"):
        changed = (told.direction != right.direction) & (told.direction != 0)
        passed = (right.visits.motion.fly | right.visits.motion.via)[
            changed.any(axis=1)
        ].all()
        found = not passed and compares_directions(one, wrong)
        return MISSED if found else FLY if passed else NEAR
    if _times_differ(right, told):
        return MISSED
    return NOTHING if _same(one, wrong, "time") else SLIGHT


def _of_places(right: Claim, told: Claim) -> str:
    """Say why nothing is compared where joint angles are wrong."""
    same = np.isclose(told.q, right.q, rtol=0, atol=SAME, equal_nan=True)
    rows, v = np.flatnonzero(~same.all(axis=1)), right.visits
    if np.isnan(told.q[rows]).any(axis=1).all():
        return LOST
    rows = rows[~np.isnan(told.q[rows]).any(axis=1)]
    if not np.isin(v.target.meaning[rows], PLACED).any():
        return STEPS
    turned = (np.abs(told.q[rows] - right.q[rows]) > np.pi).any(axis=1)
    free = turned.all() and (v.motion.kind[rows] == Motion.JOINT).all()
    return FREE if free else MISSED


def _same(one: Case, wrong: Claims, name: str) -> bool:
    """Tell whether two planners say the same of source and output."""
    return all(
        np.allclose(getattr(a, name), getattr(b, name), atol=SAME, equal_nan=True)
        for a, b in zip(one.right, wrong, strict=True)
    )


def _compared(one: Case, claims: Claims) -> int:
    """Count the limits that are compared."""
    what = "output: joint limits"
    return next(row.compared for row in one.weigh_rows(claims).rows if row.what == what)


def _times_differ(right: Claim, told: Claim) -> bool:
    """Tell whether a move between stops takes another time, by more than bounds."""
    v = right.visits
    passed = v.motion.fly | v.motion.via
    rows = (v.graph.before >= 0) & ~passed & ~passed[v.graph.before]
    ours, theirs = (c.time - c.time[v.graph.before] for c in (right, told))
    joint = v.motion.kind == Motion.JOINT
    bound = np.where(
        joint, 2 * MOVE_S, 0.02 * LINE_PERCENT * np.maximum(ours, SHORTEST_S)
    )
    return bool((rows & (np.abs(theirs - ours) > bound)).any())


def main() -> int:
    """Plant, and print what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--programs", type=int, default=8)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    found: list[Misread] = []
    with tempfile.TemporaryDirectory() as name:
        folder = make_job(Path(name), (PROGRAMS / "cell.toml").read_text())
        cell = any_controller(load_cell(folder / "cell.toml"))
        model: Model = load_model(folder / "model.json")
        for seed in range(given.first, given.first + given.programs):
            files = files_of(seed, cell)
            one = Case.of(compensated(files, cell, model))
            found += [misread(kind, one, seed) for kind in KINDS]
    for kind in KINDS:
        own = [p for p in found if p.kind == kind.__name__]
        rows = Counter(p.row for p in own if p.row)
        print(kind.__name__, dict(Counter(p.came for p in own)), dict(rows))
    missed = [p for p in found if p.came == MISSED]
    print(f"{len(found)} planted, {sum(p.came == FOUND for p in found)} found")
    for p in missed:
        print(p)
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main())
