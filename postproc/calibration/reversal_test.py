"""Over how many of its gaps each joint goes from flank to flank, seen at stops.

A survey may hold *reversals*: all joints arrive from afar, then one drive turns back
step by step, and every step is read. What the tool does from step to step is free of
all errors of the arm that stay the same there. The backlash of the model says where it
comes to on the other flank; on the way there a link with a sharp gap rests until its
drive has crossed it, and one with an elastic flank gives way over several gaps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.calibration.measurements import Measurements
from postproc.model.backlash_width import half_gap, half_widths, on_the_way
from postproc.model.flank_hypotheses import flanks_of, verdict_of
from postproc.model.kinematics import ArmStates
from postproc.model.model import UNLIKE, UNTOLD, Model, Width
from postproc.model.whitening import Whitener
from postproc.robot.arm import Arm
from postproc.robot.pose import MM

STILL = 1e-6  # [rad] a drive that is said to stand
SMALL = np.deg2rad(0.5)  # [rad] a step that is no approach of its own
LEAST = 3  # steps of a reversal
WIDTHS = (1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0, 8.0)  # gaps that are tried
CLEAR = 4.5  # nats by which a width is ruled out: three standard errors
LIKE = 0.2  # of the gap that the model has, by which the steps may differ
TELLS = 0.25  # standard error of that share up to which steps tell
LITTLE = 2e-5  # [m] off a path: what is open there matters to nobody
EXCESS = 4.0  # standard deviations that the steps may scatter by more than readings


@dataclass(frozen=True, eq=False)
class Reversals:
    """k reversals.

    Attributes:
        rows: Their rows, one reversal after the other, each with the arrival before it.
        first: The rows of each are first[i] .. first[i + 1] - 1, (k + 1,).
        drive: Which drive turns back, from 0, (k,).
    """

    rows: Measurements
    first: Ints
    drive: Ints

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.drive)


def split_reversals(
    survey: Measurements, arm: Arm
) -> tuple[Measurements, Reversals | None]:
    """Part reversals from the rest of a survey.

    Their arrivals from afar go with them: as rows of a fit they would count what an arm
    does at one pose many times.

    Args:
        survey: Rows in visit order.
        arm: Their arm.

    Returns:
        The survey without reversals, and these, None where there are none.
    """
    step = np.diff(survey.states.q, axis=0) @ arm.coupling.T
    moves = np.abs(step) > STILL
    drive = moves.argmax(axis=1)
    size = step[np.arange(len(step)), drive]
    back = (moves.sum(axis=1) == 1) & (np.abs(size) < SMALL)
    back &= np.diff(survey.states.tool_id) == 0
    found, i = list[tuple[int, int]](), 0
    while i < len(back):
        end = i
        while end < len(back) and back[end] and _goes_on(drive, size, i, end):
            end += 1
        came = survey.states.direction[i, drive[i]]
        if end - i >= LEAST and came * size[i] <= 0:  # or it is not known how it came
            found.append((i, end + 1))
        i = max(end, i + 1)
    if not found:
        return survey, None
    rows = np.concatenate([np.arange(*own) for own in found])
    first = np.cumsum([0, *(end - begin for begin, end in found)])
    begins = np.array([begin for begin, _ in found])
    rest = np.setdiff1d(np.arange(len(survey)), rows)
    return survey[rest], Reversals(survey[rows], first, drive[begins])


def _goes_on(drive: Ints, size: Floats, i: int, k: int) -> bool:
    """Tell whether step k is one of the drive of step i, the same way."""
    return bool(drive[k] == drive[i] and size[k] * size[i] > 0)


def flank_widths(model: Model, arm: Arm, found: Reversals) -> tuple[Width, ...]:
    """Say over how many gaps each joint goes from flank to flank.

    Args:
        model: A model of the same survey, its backlash among it.
        arm: The arm.
        found: Reversals; positions in the arm's base frame.

    Returns:
        Of every joint the shortest and the longest way that its steps do not rule out
        [gaps], 1 that of a sharp gap; `UNTOLD` where they do not tell, and `UNLIKE`
        where the joint does not do what the model says.
    """
    return tuple(
        _width([_compare_widths(model, arm, found, int(i)) for i in own])
        for own in (np.flatnonzero(found.drive == joint) for joint in range(6))
    )


def newer_widths(
    known: tuple[Width, ...], model: Model, arm: Arm, found: Reversals | None
) -> tuple[Width, ...]:
    """Say over how many gaps each joint goes, by what was known and by new reversals.

    New ones of a joint count, also where they leave open what was known before.

    Args:
        known: Of every joint, or of none.
        model: A model of the new survey.
        arm: The arm.
        found: Its reversals, None where there are none.
    """
    if found is None:
        return known
    new, again = flank_widths(model, arm, found), set(found.drive.tolist())
    if not known:
        return new
    return tuple(new[j] if j in again else known[j] for j in range(len(known)))


@dataclass(frozen=True)
class _OneReversal:
    """One reversal: what is left of its k whitened readings, by what is said of it.

    Attributes:
        left: If the joint stayed on its flank, (k,).
        step: What the way to the other flank changes it by, at each width, (w, k).
    """

    left: Floats
    step: Floats


def _compare_widths(model: Model, arm: Arm, found: Reversals, i: int) -> _OneReversal:
    """Compare the steps of a reversal with all widths."""
    own = found.rows[np.arange(found.first[i], found.first[i + 1])]
    states, drive = own.states, int(found.drive[i])
    batch = ArmStates(arm, states)
    turn = (states.q - states.q[0]) @ arm.coupling[drive]
    back = np.abs(turn) / half_widths(model, arm, states.q)[:, drive]
    came = np.tile(states.direction[0], (len(own), 1))
    came[:, drive] = -np.sign(turn[-1])
    whitener = Whitener.build(batch, own.position, model.noise.origin)
    usual = whitener.variance(model.noise).mean(axis=0)
    scale = 1.0 / (model.reading_spread * np.sqrt(usual))

    def predict(side: Floats) -> Floats:
        """Where the tool is, less its mean, in units of a reading's noise."""
        there = np.array(came)
        there[:, drive] = came[:, drive] * side
        moved = model.error(arm, states.with_(direction=there))
        return whiten(batch.walk.tcp + moved)

    def whiten(place: Floats) -> Floats:
        turned = (place @ whitener.turn[0].T) * scale
        return np.asarray(turned - turned.mean(axis=0)).reshape(-1)

    on_flank = predict(np.ones(len(own)))
    by_width = [predict(on_the_way(1.0 - back / w, w)) for w in WIDTHS]
    left = whiten(own.position) - on_flank
    return _OneReversal(left, np.array(by_width) - on_flank)


def _width(tried: list[_OneReversal]) -> Width:
    """Say how wide the flank of a joint may be by its reversals [gaps]."""
    if not tried:
        return UNTOLD
    left = np.concatenate([one.left for one in tried])
    step = np.concatenate([one.step for one in tried], axis=1)
    far = ((left - step) ** 2).sum(axis=1)
    best = int(far.argmin())
    power = float((step[best] ** 2).sum())
    free = len(left) - 3 * len(tried)
    if power * TELLS**2 < 1.0:
        return UNTOLD
    if far[best] > free + EXCESS * np.sqrt(2.0 * free):
        return UNLIKE
    share = float(step[best] @ left) / power
    if abs(share - 1.0) > LIKE + 2.0 / np.sqrt(power):
        return UNLIKE
    may_be = np.array(WIDTHS)[0.5 * (far - far[best]) < CLEAR]
    return float(may_be.min()), float(may_be.max())


_WORDS = {"": "uncertain", "unlike": "not as the model says", "sharp": "sharp"}


def tell_widths(widths: tuple[Width, ...]) -> str:
    """Say in words what reversals tell of the joints; "" where there were none.

    >>> tell_widths((*[(1.0, 1.25)] * 4, (2.0, 6.0), UNTOLD))
    'flanks at stops: joint 1, 2, 3, 4 sharp; joint 5 2 to 6 gaps; joint 6 uncertain'
    """
    if not widths:
        return ""
    joints = dict[str, list[str]]()
    for joint, width in enumerate(widths, start=1):
        word = _WORDS.get(verdict_of(width), f"{width[0]:g} to {width[1]:g} gaps")
        joints.setdefault(word, []).append(str(joint))
    told = (f"joint {', '.join(own)} {word}" for word, own in joints.items())
    return f"flanks at stops: {'; '.join(told)}"


def tell_open(model: Model, arm: Arm, jacobian: Floats) -> str:
    """Say which joints' flanks reversals leave open, and what that costs paths.

    A link whose flank is open may lack a part of its step behind the way of a sharp
    gap: so far, at the most, a path may be off.

    Args:
        model: A model with what reversals say.
        arm: Its arm.
        jacobian: Of the probe at the poses of the survey, (n, 3, 6) [m/rad].

    Returns:
        "" where there were no reversals.
    """
    if not model.flank_widths:
        return ""
    lag = np.array([flank.max_lag for flank in flanks_of(model, arm)])
    elastic = [verdict_of(width) == "elastic" for width in model.flank_widths]
    lever = np.linalg.norm(jacobian, axis=1).max(axis=0)
    size = np.where(elastic, 0.0, lag * lever * 2.0 * half_gap(model, arm))
    joints = [j for j in np.argsort(-size, kind="stable") if size[j] > LITTLE]
    if not joints:
        return "no flank that matters is open"
    cost = ", ".join(f"joint {j + 1} {size[j] / MM:.2f} mm" for j in joints)
    return f"open, with what a path may be off by at the most: {cost}"
