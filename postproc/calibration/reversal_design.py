"""Where drives turn back step by step in a survey, and what the steps will tell.

A step of a drive tells how wide the flank of its joint is if it is neither much smaller
nor much larger than the gap, and if the tool moves by more than readings scatter. What
a set of reversals tells of a gap is the expected log likelihood ratio of a sharp gap
and of a flank that gives way over two gaps, which is the least that counts as elastic.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.calibration.pose_design import TYPICAL_NOISE, Design
from postproc.calibration.reversal_test import CLEAR
from postproc.exceptions import PostprocError
from postproc.model.backlash_width import on_the_way
from postproc.model.kinematics import ArmStates
from postproc.robot.arm import Arm
from postproc.robot.pose import MM
from postproc.robot.state import make_states

STEPS = np.array([0.07, 0.14, 0.28, 0.56, 1.0, 1.6]) * 1e-3
"""How far a drive has turned back at each reading [rad]; each is a stop of its own."""
FAR = 0.1  # of the poses, those at which a drive moves the probe the farthest
REPEATS = 1e-5  # [rad] a usual scatter of every joint
MORE = 4  # times as often at the most as is asked for
MATTERS = 0.1 * MM  # [m] a step of the tool whose half is harm that counts
TELLS = 2.0 * CLEAR  # nats that are expected: some six in seven are told then
GAPS = np.geomspace(0.01, 0.4, 75) * 1e-3  # [rad] gaps that are looked at
ELASTIC = 2.0  # gaps: the narrowest flank that is no sharp gap


@dataclass(frozen=True)
class ReversalDesign:
    """Where drives turn back, and what that will tell.

    Attributes:
        turns: Poses of the survey and drives, both from 0.
        least: The smallest gap of each drive whose flank will be told, flank to flank,
            (6,) [rad]; infinite where none will.
        lever: How far the tool moves as a drive turns, at the most, (6,) [m/rad].
    """

    turns: tuple[tuple[int, int], ...]
    least: Floats
    lever: Floats

    def summary(self) -> str:
        """Say beforehand what the reversals will tell.

        >>> ReversalDesign((), np.full(6, 4e-5), np.full(6, 2.0)).summary()
        'reversals tell flanks of gaps of: joint 1, 2, 3, 4, 5, 6 0.040 mrad (0.08 mm)'
        """
        said = dict[str, list[str]]()
        for joint, (gap, lever) in enumerate(zip(self.least, self.lever, strict=True)):
            word = f"{gap * 1e3:.3f} mrad ({gap * lever / MM:.2f} mm)"
            word = word if np.isfinite(gap) else "none"
            said.setdefault(word, []).append(str(joint + 1))
        told = (f"joint {', '.join(own)} {word}" for word, own in said.items())
        return f"reversals tell flanks of gaps of: {'; '.join(told)}"


def design_reversals(
    arm: Arm, design: Design, probes: Floats, count: int
) -> ReversalDesign:
    """Choose poses at which each drive shows well how it crosses its gap.

    A drive turns back as often as it takes to tell the flank of every gap that matters:
    one that moves the tool by `MATTERS` or more where the drive moves it farthest.

    Args:
        arm: The arm.
        design: The poses of a survey.
        probes: Probe points in the flange frame, (k, 3) [m].
        count: How many poses for every drive at the least, 1 or more; at the most MORE
            times as many.

    Raises:
        PostprocError: There are fewer poses than are asked for.
    """
    if MORE * count > len(design.q):
        raise PostprocError(
            f"survey.reversals: {count} need {MORE * count} poses, and there are "
            f"{len(design.q)}. Ask for more --poses"
        )
    tools = np.atleast_2d(probes)[design.probe]
    by_joint = ArmStates(arm, make_states(design.q, tool=tools)).jacobian
    by_drive = by_joint @ np.linalg.inv(arm.coupling)
    scatter = np.hypot(TYPICAL_NOISE, REPEATS * np.linalg.norm(by_joint, axis=(1, 2)))
    lever = np.linalg.norm(by_drive, axis=1)
    turns, least = list[tuple[int, int]](), np.empty(6)
    for drive in range(6):
        clear, angle = lever[:, drive] / scatter, design.q[:, drive]
        longest = float(lever[:, drive].max())
        for often in range(count, MORE * count + 1):
            poses = _spread(clear, angle, often)
            least[drive] = _smallest_gap(clear[poses])
            if least[drive] * longest <= MATTERS:
                break
        turns += [(int(pose), drive) for pose in poses]
    return ReversalDesign(tuple(turns), least, lever.max(axis=0))


def _spread(clear: Floats, angle: Floats, often: int) -> Ints:
    """Choose poses that show a drive well, evenly over its angles, (often,).

    Args:
        clear: How far the drive moves the probe, in standard errors, (n,) [1/rad].
        angle: Its joint's, (n,) [rad].
        often: How many.
    """
    many = max(often, int(FAR * len(clear)))
    far = np.argsort(-clear, kind="stable")[:many]
    along = far[np.argsort(angle[far], kind="stable")]
    return along[((np.arange(often) + 0.5) / often * many).astype(np.int64)]


def _smallest_gap(clear: Floats) -> float:
    """Return the gap from which on reversals tell all flanks [rad].

    Args:
        clear: How far the drive moves the probe at each, in standard errors, (k,).
    """
    dull = np.flatnonzero(nats_between(clear, GAPS) < TELLS)
    if not len(dull):
        return float(GAPS[0])
    return float(GAPS[dull[-1] + 1]) if dull[-1] + 1 < len(GAPS) else float("inf")


def nats_between(clear: Floats, gap: Floats) -> Floats:
    """Return by how much reversals tell a sharp gap from an elastic flank, (g,) [nats].

    Half the squared difference of what both predict, in standard errors, each reversal
    less its mean.

    Args:
        clear: How far the drive moves the probe at each, in standard errors, (k,).
        gap: From flank to flank, (g,) [rad].
    """
    back = 2.0 * np.append(0.0, STEPS) / gap[:, None]  # of half a gap
    sharp, elastic = (on_the_way(1.0 - back / w, w) for w in (1.0, ELASTIC))
    apart = (sharp - elastic) * gap[:, None] / 2.0
    apart -= apart.mean(axis=1, keepdims=True)
    return np.asarray(0.5 * (apart**2).sum(axis=1) * (clear**2).sum())
