"""The arrays that a trace fills in program order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints, pieces
from postproc.motion.sampling import sample
from postproc.motion.targets import Kind, Move, Targets
from postproc.motion.ways import OnDemand, Solved, Ways
from postproc.robot.arm import Arm
from postproc.robot.pose import inverse, is_unknown

STRAIGHT = 1e-3  # [rad] at axis 5, below this the two wrist branches are one
CHUNK = 50_000  # poses solved at a time; solving needs room for copies
SAME_POSE = 1e-7  # [m] and sines; poses that several predecessors agree on
LONG = 256  # targets on one path from which on one branch is cheaper than all of them


@dataclass(frozen=True)
class Known:
    """What is known beforehand of k targets, whatever leads to them.

    Attributes:
        rows: The targets, (k,).
        q: Their joint angles, (k, 6) [rad].
        flange: Their flange poses, (k, 4, 4) [m].
        slot: Their branches, (k,).
    """

    rows: Ints
    q: Floats
    flange: Floats
    slot: Ints


class Workspace:
    """What is known so far of n targets, e edges and s samples on them.

    Attributes:
        q: Joint angles at the targets, (n, 6) [rad], NaN where not known yet.
        flange: Flange poses at the targets, (n, 4, 4) [m], NaN where not known yet.
        slot: Branch taken, (n,), -1 where unknown.
        reason: Index into `REASONS`, (n,).
        samples: Where the samples stand.
        source: Predecessor of each edge, (e,); becomes -1 where a path stays unknown.
        path: Joint angles at the samples, (s, 6) [rad], NaN where not known yet.
        placed: Flange poses known beforehand that joint angles must be found for, (n,).
        told: Targets that are known whatever leads to them, (n,).
        long: Targets of long stretches of single Cartesian paths, (n,); these are
            followed on one branch, and the others are not looked for.
    """

    def __init__(self, arm: Arm, targets: Targets, known: Known | None = None) -> None:
        """Place what does not depend on joint angles and solve for it in one batch."""
        self.arm, self.targets = arm, targets
        n = len(targets)
        self.tool_inverse = inverse(targets.tool)
        self.q = np.full((n, 6), np.nan)
        self.slot = np.full(n, -1, dtype=np.int64)
        self.reason = np.zeros(n, dtype=np.int64)
        self._place()
        self.given = np.zeros(n, dtype=bool)
        if known is not None:
            self._give(known)
        self._settle_steps()
        self.samples = sample(targets, self.flange)
        self.source = np.array(self.samples.source)
        self.path = np.full((int(self.samples.start[-1]), 6), np.nan)
        self._inner = np.full(len(self.path), -1)
        self._inner[self.samples.inner] = np.arange(len(self.samples.inner))
        placed = ~is_unknown(self.flange)
        self.placed = placed & (targets.kind != Kind.JOINTS) & ~self.given
        self.told = np.zeros(n, dtype=bool)
        self.by_string = self._by_string()
        self.single = self._single_lines()
        self.long = self.single & (_run_lengths(self.single) >= LONG)

    def _place(self) -> None:
        """Place the flange at poses and joint angles."""
        targets = self.targets
        self.flange = targets.tcp @ self.tool_inverse
        self.flange[targets.kind != Kind.POSE] = np.nan
        joints = np.flatnonzero(targets.kind == Kind.JOINTS)
        self.q[joints] = targets.joints[joints]
        known = joints[~np.isnan(self.q[joints]).any(axis=1)]
        self.flange[known] = self.arm.flange(self.q[known])

    def _settle_steps(self) -> None:
        """Place the flange after steps from places that are known already."""
        kind = self.targets.kind
        steps = (kind == Kind.TOOL_STEP) | (kind == Kind.BASE_STEP)
        for v in np.flatnonzero(steps).tolist():
            sources = self.targets.pred[
                self.targets.pred_start[v] : self.targets.pred_start[v + 1]
            ]
            if len(sources) and (sources >= 0).all():
                after = [self.after_step(v, self.flange[s]) for s in sources]
                if np.ptp(after, axis=0).max() < SAME_POSE:
                    self.flange[v] = after[0]

    def after_step(self, v: int, flange: Floats) -> Floats:
        """Place the flange after step `v` from a flange pose, (4, 4) [m]."""
        step, tcp = self.targets.tcp[v], flange @ self.targets.tool[v]
        if self.targets.kind[v] == Kind.TOOL_STEP:
            tcp = tcp @ step
        else:
            tcp = tcp.copy()
            tcp[:3, :3] = step[:3, :3] @ tcp[:3, :3]
            tcp[:3, 3] += step[:3, 3]
        moved: Floats = tcp @ self.tool_inverse[v]
        return moved

    def _give(self, known: Known) -> None:
        """Take over what is known of some targets."""
        self.q[known.rows], self.slot[known.rows] = known.q, known.slot
        self.flange[known.rows] = known.flange
        self.given[known.rows] = True

    def _by_string(self) -> Bools:
        """Tell which targets need nothing but their configuration string."""
        t = self.targets
        told = (t.kind == Kind.POSE) & (t.slot >= 0) & ~t.nearest_turn
        return np.asarray(told & (t.move == Move.JOINT) & self.placed)

    def _single_lines(self) -> Bools:
        """Tell which targets continue a Cartesian path from the one before alone."""
        samples, out = self.samples, np.zeros(len(self.q), dtype=bool)
        single = np.flatnonzero(np.diff(self.targets.pred_start) == 1)
        edge = self.targets.pred_start[single]
        out[single] = samples.ready[edge] & (samples.source[edge] == single - 1)
        return np.asarray(out & self.placed)

    def solve(self, settled: Bools) -> None:
        """Solve for all branches where there is no long stretch, in one batch.

        Args:
            settled: Targets that are settled, with the ways to them, (n,).
        """
        samples, start = self.samples, self.samples.start
        poses = np.flatnonzero(self.placed & ~settled & ~self.long)
        edge = np.searchsorted(start, samples.inner, side="right") - 1
        visit = samples.visit[edge]
        inner = np.flatnonzero(~self.long[visit] & ~settled[visit])
        asked = np.concatenate([self.flange[poses], samples.flange[inner]])
        self.branches = np.empty((len(asked), 8, 6))
        for rows in pieces(len(asked), CHUNK):
            self.branches[rows] = self.arm.inverse(asked[rows]).q
        self.solved = np.full(len(self.q), -1)
        self.solved[poses] = np.arange(len(poses))
        self.row = np.full(int(start[-1]), -1)
        self.row[samples.inner[inner]] = len(poses) + np.arange(len(inner))
        self.row[start[1:] - 1] = self.solved[samples.visit]

    def solutions(self, v: int, flange: Floats) -> Floats:
        """Return all branches at target v with its flange pose, (8, 6) [rad]."""
        if self.solved[v] >= 0:
            known: Floats = self.branches[self.solved[v]]
            return known
        found: Floats = self.arm.inverse(flange[None]).q[0]
        return found

    def all_solutions(self, rows: Ints) -> Floats:
        """Return all branches at placed targets, (k, 8, 6) [rad]."""
        found = np.empty((len(rows), 8, 6))
        known = self.solved[rows] >= 0
        found[known] = self.branches[self.solved[rows[known]]]
        found[~known] = self.arm.inverse(self.flange[rows[~known]]).q
        return found

    def ways(self, span: slice) -> Ways:
        """Return the solutions at some samples of ready edges."""
        rows = self.row[span]
        if len(rows) and (rows >= 0).all():
            return Solved(self.branches[rows])
        return OnDemand(self.arm, self.flange_at(np.arange(span.start, span.stop)))

    def flange_at(self, at: Ints) -> Floats:
        """Look up the flange poses at samples of ready edges, (k, 4, 4) [m]."""
        samples, inner = self.samples, self._inner[at]
        last, inside = np.flatnonzero(inner < 0), np.flatnonzero(inner >= 0)
        edge = np.searchsorted(samples.start, at[last], side="right") - 1
        out = np.empty((len(at), 4, 4))
        out[last] = self.flange.take(samples.visit[edge], axis=0)
        out[inside] = samples.flange.take(inner[inside], axis=0)
        return out

    def is_known(self, v: int) -> bool:
        """Tell whether the joint angles at a target are known already."""
        return v >= 0 and not np.isnan(self.q[v, 0])

    def is_known_before(self, v: int, source: int) -> bool:
        """Tell whether a place is known when v is come to, in the program's order."""
        return self.is_known(source) and (source < v or bool(self.told[source]))

    def branch_at(self, v: int) -> int:
        """Return the branch at a target, -1 where it is not known or not one alone."""
        return int(self.branches_at(np.array([v]))[0])

    def branches_at(self, rows: Ints) -> Ints:
        """Return the branches at targets, (k,), likewise."""
        straight = np.abs(self.q[rows, 4]) < STRAIGHT
        return np.where(straight, -1, self.slot[rows])

    def span(self, edge: int) -> slice:
        """Return the samples of an edge."""
        return slice(int(self.samples.start[edge]), int(self.samples.start[edge + 1]))


def _run_lengths(inside: Bools) -> Ints:
    """Return the length of the run of True that each place lies in, (n,); else 0."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside, [0]])))
    begin, end = edges[::2], edges[1::2]
    out = np.zeros(len(inside), dtype=np.int64)
    out[inside] = np.repeat(end - begin, end - begin)
    return out
