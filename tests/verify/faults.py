"""Plant faults, one a program, and see whether the second opinion finds them.

    python -m tests.verify.faults [--count 100] [--first 0]

A fault is *found* where the second opinion disagrees. It is *not reached* where nothing
that it makes wrong is compared: then it is said why. All else is *missed*.
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
from postproc.compensation.findings.second_opinion import facts_of
from postproc.model.model import Model, load_model
from postproc.motion.planner import plan
from postproc.robot.arm import Arm, build_arm
from postproc.robot.cell import Cell, load_cell
from postproc.robot.direction import arrivals_of_rows
from postproc.robot.trajectory import Motion
from postproc.verify.judge import judge
from postproc.verify.opinion import Claim, Opinion
from tests.any_controller import any_controller
from tests.conftest import make_job
from tests.language.neutral_job import LANGUAGES, drawn
from tests.verify.judged import PROGRAMS, Compensated, compensated

FOUND, MISSED = "found", "MISSED"
FLY = "not reached: a fly point, passed on a blend"
NEAR = "not reached: near a reversal, or the way there was not made"
NO_STOP = "not reached: no stop's direction turns on it"
NO_FLAGS = "not reached: a JOINT move without flags, and no line or arc behind it"


Claims = tuple[Claim, Claim]  # of source and output
Wrong = tuple[str, Claims, str]  # what, the claims, and what it is if not found


@dataclass(frozen=True)
class Planted:
    """A fault, what came of it, and on which row it was found."""

    kind: str
    program: int
    what: str
    came: str
    row: str = ""


@dataclass(frozen=True)
class Case:
    """A program and its right claims."""

    job: Compensated
    source: Claim
    output: Claim

    @classmethod
    def of(cls, job: Compensated) -> Case:
        """Claim what the planner claims."""
        cell, record = job.cell, job.outcome.record
        before = planner._claim("source", planner.read_program(job.source, cell).visits,
                                cell)  # fmt: skip
        after = planner._claim("output", planner.read_program(job.output, cell).visits,
                               cell)  # fmt: skip
        return cls(job, before, planner._take_directions(after, before.visits, record))

    def weigh_rows(self, claims: Claims) -> Opinion:
        """Judge other claims of source and output."""
        return judge("job", facts_of(self.job.cell), *claims)

    @property
    def right(self) -> Claims:
        """The claims without a fault."""
        return self.source, self.output

    def with_directions(self, direction: np.ndarray) -> Claims:
        """Claim that the output was corrected for other directions."""
        return self.source, replace(self.output, direction=direction.astype(float))


def case(seed: int, cell: Cell, model: Model) -> Case:
    """Draw a program in one of the languages."""
    name = list(LANGUAGES)[seed % len(LANGUAGES)]
    files = LANGUAGES[name](drawn(cell, seed))
    return Case.of(compensated({name: files[name], **files}, cell, model))


def wrong_arm(arm: Arm, joint: int) -> Arm:
    """Turn a joint the other way, in forward and inverse kinematics alike."""
    file, dh, opw = arm.file, arm.file.dh, arm.file.opw
    assert opw is not None
    sense, flip = list(dh.sense), list(opw.flip_axes)
    shift = list(dh.shift_deg)
    sense[joint], flip[joint] = -sense[joint], not flip[joint]
    shift[joint] = -shift[joint]
    changed = {
        "dh": dh.model_copy(update={"sense": sense, "shift_deg": shift}),
        "opw": opw.model_copy(update={"flip_axes": flip}),
    }
    return replace(build_arm(file.model_copy(update=changed)), play=arm.play)


def sign_of_a_joint(one: Case, rng: np.random.Generator) -> Wrong:
    """The planner's kinematics turns one joint the other way."""
    joint = int(rng.integers(6))
    cell = replace(one.job.cell, arm=wrong_arm(one.job.cell.arm, joint))
    made = [planner._claim(c.label, c.visits, cell) for c in one.right]
    return f"axis {joint + 1}", (made[0], made[1]), MISSED


def wrong_lambda(one: Case, rng: np.random.Generator) -> Wrong:
    """A target is corrected for the other side of one joint."""
    told = np.argwhere(one.output.direction != 0)
    i, j = told[rng.integers(len(told))]
    direction = np.array(one.output.direction)
    direction[i, j] *= -1
    v = one.output.visits
    why = FLY if v.motion.fly[i] or v.motion.via[i] else MISSED
    return f"{one.output.place(i)} axis {j + 1}", one.with_directions(direction), why


def reversal_left_out(one: Case, rng: np.random.Generator) -> Wrong:
    """Where joints turn back inside of a move is not seen."""
    told = arrivals_of_rows(one.job.cell.arm, one.output.q).direction
    return "every move", *_only_where_told(one, told)


def orientation_law(one: Case, rng: np.random.Generator) -> Wrong:
    """The planner turns the wrist joint by joint instead of about one axis."""
    cell = one.job.cell
    targets, _ = planner.targets_from_visits(one.output.visits, cell)
    law = replace(targets, wrist_joint=np.asarray(targets.move == Motion.LINEAR))
    wrist = np.deg2rad(cell.limits.wrist_deg)
    told = plan(cell.arm, law, wrist, timed=False).direction
    return "every line", *_only_where_told(one, told)


def wrong_branch(one: Case, rng: np.random.Generator) -> Wrong:
    """One target is reached on another branch, before and after the correction."""
    cell, named = one.job.cell, np.flatnonzero(one.output.slot >= 0)
    for i in rng.permutation(named).tolist():
        others = [
            k for k in rng.permutation(8).tolist()
            if k != one.output.slot[i] and all(
                not np.isnan(_on_branch(c, i, k, cell).q[i]).any() for c in one.right
            )
        ]  # fmt: skip
        if others:
            break
    source, output = (_on_branch(c, i, others[0], cell) for c in one.right)
    why = NO_FLAGS if _free(one, i) else MISSED
    return f"{output.place(i)} branch {others[0]}", (source, output), why


def _on_branch(claim: Claim, i: int, branch: int, cell: Cell) -> Claim:
    """Claim that a visit is reached on a branch, and all that follows from it."""
    q, slot = np.array(claim.q), np.array(claim.slot)
    found = cell.arm.inverse(cell.arm.flange(claim.q[i : i + 1])).q
    q[i], slot[i] = found.reshape(8, 6)[branch], branch
    singular, torque = planner._singular(cell, q), np.empty((0, 6))
    if len(claim.torque):
        torque = planner._torque(cell, q, claim.payload)
    return replace(claim, q=q, slot=slot, singular=singular, torque=torque)


def _free(one: Case, i: int) -> bool:
    """Tell whether nothing says on which branch a visit is."""
    v = one.output.visits
    behind = np.flatnonzero(v.graph.before == i)
    return bool(
        v.motion.kind[i] == Motion.JOINT
        and not v.target.config_given[i]
        and (v.motion.kind[behind] == Motion.JOINT).all()
    )


def _only_where_told(one: Case, told: np.ndarray) -> tuple[Claims, str]:
    """Take directions of another planner, and say whether a stop turns on them."""
    right, v = one.output.direction, one.output.visits
    other = (told != right) & (told != 0) & (right != 0)
    stops = other[~(v.motion.fly | v.motion.via)].any()
    return one.with_directions(told), MISSED if stops else NO_STOP


Fault = Callable[[Case, np.random.Generator], Wrong]
FAULTS: tuple[Fault, ...] = (
    sign_of_a_joint, wrong_lambda, reversal_left_out, orientation_law, wrong_branch,
)  # fmt: skip


def plant(seed: int, cell: Cell, model: Model) -> Planted:
    """Plant the fault of a seed in the program of that seed."""
    fault, rng = FAULTS[seed % len(FAULTS)], np.random.default_rng(seed)
    one = case(seed, cell, model)
    assert one.weigh_rows(one.right).agrees, seed
    what, wrong, otherwise = fault(one, rng)
    opinion = one.weigh_rows(wrong)
    rows = [row.what for row in opinion.rows if row.beyond]
    came = FOUND if rows else otherwise
    if (
        came == MISSED
        and not compares_directions(one, wrong)
        and fault is not wrong_branch
    ):
        came = NEAR
    return Planted(fault.__name__, seed, what, came, next(iter(rows), ""))


def compares_directions(one: Case, wrong: Claims) -> bool:
    """Tell whether a direction that is wrong is among those that are compared.

    As many fewer are, where the planner says that it does not know these.
    """
    told = one.output.direction
    unsaid = one.with_directions(np.where(wrong[1].direction != told, 0.0, told))
    right, less = (_compared(one.weigh_rows(claims)) for claims in (one.right, unsaid))
    return less < right


def _compared(opinion: Opinion) -> int:
    (row,) = (r for r in opinion.rows if r.what == "output: approach directions")
    return row.compared


def main() -> int:
    """Plant, and print what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        text = (PROGRAMS / "cell.toml").read_text()
        folder = make_job(Path(name), text)
        cell = any_controller(load_cell(folder / "cell.toml"))
        model = load_model(folder / "model.json")
        seeds = range(given.first, given.first + given.count)
        planted = [plant(seed, cell, model) for seed in seeds]
    for kind in (fault.__name__ for fault in FAULTS):
        own = [p for p in planted if p.kind == kind]
        print(kind, dict(Counter(p.came for p in own)))
        print("   first by", dict(Counter(p.row for p in own if p.row)))
    missed = [p for p in planted if p.came == MISSED]
    for p in missed:
        print(p)
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main())
