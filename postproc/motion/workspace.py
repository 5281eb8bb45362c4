"""The arrays that a trace fills in program order."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from postproc.motion.sampling import sample
from postproc.motion.targets import Kind, Targets
from postproc.pose import inverse
from postproc.robot.arm import Arm

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

STRAIGHT = 1e-3  # [rad] at axis 5, below this the two wrist branches are one
CHUNK = 50_000  # poses solved at a time; solving needs room for copies
SAME_POSE = 1e-7  # [m] and sines; poses that several predecessors agree on


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
        branches: All solutions of what could be solved beforehand, (r, 8, 6) [rad].
        row: Row of `branches` for each sample, (s,), -1 where there is none.
        solved: Row of `branches` for each target, (n,), -1 where there is none.
    """

    def __init__(self, arm: Arm, targets: Targets) -> None:
        """Place what does not depend on joint angles and solve for it in one batch."""
        self.arm, self.targets = arm, targets
        n = len(targets)
        self.tool_inverse = inverse(targets.tool)
        self.q = np.full((n, 6), np.nan)
        self.slot = np.full(n, -1, dtype=np.int64)
        self.reason = np.zeros(n, dtype=np.int64)
        self.flange = np.full((n, 4, 4), np.nan)
        self._place()
        self._settle_steps()
        self.samples = sample(targets, self.flange)
        self.source = np.array(self.samples.source)
        self.path = np.full((int(self.samples.start[-1]), 6), np.nan)
        self._solve()

    def _place(self) -> None:
        """Place the flange at poses and joint angles."""
        targets = self.targets
        pose = targets.kind == Kind.POSE
        self.flange[pose] = targets.tcp[pose] @ self.tool_inverse[pose]
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

    def after_step(self, v: int, flange: Array) -> Array:
        """Place the flange after step `v` from a flange pose, (4, 4) [m]."""
        step, tcp = self.targets.tcp[v], flange @ self.targets.tool[v]
        if self.targets.kind[v] == Kind.TOOL_STEP:
            tcp = tcp @ step
        else:
            tcp = tcp.copy()
            tcp[:3, :3] = step[:3, :3] @ tcp[:3, :3]
            tcp[:3, 3] += step[:3, 3]
        moved: Array = tcp @ self.tool_inverse[v]
        return moved

    def _solve(self) -> None:
        """Solve for all known poses, then all inner samples, in one batch."""
        n, kind, samples = len(self.q), self.targets.kind, self.samples
        known = ~np.isnan(self.flange).any(axis=(1, 2)) & (kind != Kind.JOINTS)
        poses = np.flatnonzero(known)
        self.solved = np.full(n, -1)
        self.solved[poses] = np.arange(len(poses))
        everything = np.concatenate([self.flange[poses], samples.flange])
        self.branches = np.empty((len(everything), 8, 6))
        for i in range(0, len(everything), CHUNK):
            rows = slice(i, i + CHUNK)
            self.branches[rows] = self.arm.inverse(everything[rows]).q
        self.row = np.full(int(samples.start[-1]), -1)
        self.row[samples.inner] = len(poses) + np.arange(len(samples.inner))
        self.row[samples.start[1:] - 1] = self.solved[samples.visit]

    def is_known(self, v: int) -> bool:
        """Tell whether the joint angles at a target are known already."""
        return v >= 0 and not np.isnan(self.q[v, 0])

    def branch_at(self, v: int) -> int:
        """Return the branch at a target, -1 where it is not known or not one alone."""
        straight = abs(self.q[v, 4]) < STRAIGHT
        return -1 if straight else int(self.slot[v])

    def span(self, edge: int) -> slice:
        """Return the samples of an edge."""
        return slice(int(self.samples.start[edge]), int(self.samples.start[edge + 1]))
