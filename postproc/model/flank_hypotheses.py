"""What a joint may do between its flanks, and how likely each of it is.

A model of a survey knows how far apart the flanks of a joint are. How the link gets
from one to the other is one of six hypotheses. Each has a prior weight, and what was
read multiplies it: at arrivals from both sides, in reversals, along a measured path.
A seventh one speaks of fast stops, at which a link may run on: surveys arrive slowly.
A weight is never scaled up when another hypothesis is excluded: knowing more closes
hypotheses and opens none, but where readings contradict what the model says.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

import numpy as np

from postproc.arrays import Floats
from postproc.model.backlash_width import SHARP, ahead, on_the_way
from postproc.model.model import CONFIRMED, UNLIKE, UNTOLD, Model, Width
from postproc.robot.arm import Arm

OPEN = 0.05  # weight of a hypothesis that counts
GIVES = 4.0  # gaps over which a flank goes at the most, where no reversals tell


class FlankKind(Enum):
    """What a link does as its drive turns back."""

    SHARP = "changes its flank as a sharp gap does"
    ELASTIC = "gives way elastically"
    EARLIER = "changes its flank earlier"
    LATER = "changes its flank later"
    NEVER = "does not change its flank"
    PUSHED = "is pushed by its drive in motion, as all that run on at stops"
    RAN_ON = "ran on at the fast stop where the move begins"
    START = "begins on the other flank"
    HELD = "is held by friction against more weight"
    WEIGHED = "gives way to less weight"
    UNDESCRIBED = "errs as no effect of the model describes"  # of the arm, not a joint


_ORDER = (FlankKind.SHARP, FlankKind.ELASTIC, FlankKind.EARLIER, FlankKind.LATER,
          FlankKind.NEVER, FlankKind.PUSHED)  # fmt: skip
PRIOR = 0.52, 0.23, 0.06, 0.06, 0.07, 0.06
"""Of the six kinds, in their order, before anything is read.

The last one is another one only for links that rest ahead of their drives at stops: by
braking they run on, and on the way their drives push them.
"""

RUNS_ON = 0.06
"""Weight of a link that runs on at a fast stop, before a measured path tells.

Surveys and reversals move slowly, and do not tell. A model of links that rest ahead of
their drives says so of all stops.
"""

WEIGHS_OTHER = 0.06
"""Weight of a gear that friction holds against more weight, or less, than was fitted.

The weights of an arm file are estimates.
"""
ANOTHER = 1.2  # times what was fitted: so much more, or less

Likelihood = tuple[float, float, float, float, float, float]
_EQUAL: Likelihood = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
# How likely readings are by each kind, beside the one that fits best; more than 1 where
# they speak against what the model predicts.
_BEHIND: Likelihood = (1.0, 1.0, 0.2, 0.7, 0.4, 0.0)  # links are pushed at all arrivals
_AHEAD: Likelihood = (0.5, 0.5, 1.0, 1.0, 1.0, 4.0)  # they run on, or weight does it
_AT_STOPS: dict[str, Likelihood] = {
    "sharp": (1.0, 0.01, 1.0, 0.2, 0.02, 0.02),
    "between": (1.0, 1.0, 1.0, 1.0, 0.02, 0.02),
    "elastic": (0.01, 1.0, 1.0, 0.5, 0.02, 0.02),
    "unlike": (0.1, 0.2, 5.0, 1.0, 2.0, 2.0),  # the steps are not those of the model
}
_RAN_ON = {CONFIRMED: 0.1, "refuted": 4.0}
_IN_MOTION: dict[str, Likelihood] = {
    CONFIRMED: (1.0, 0.1, 0.1, 0.1, 0.01, 0.01),
    "refuted": (0.05, 1.0, 4.0, 4.0, 4.0, 4.0),
    "elsewhere": (0.05, 1.0, 4.0, 4.0, 0.1, 0.1),
}


@dataclass(frozen=True)
class FlankOfJoint:
    """What is known of how one joint changes its flank.

    Attributes:
        weight: Of every kind but `START`; they do not add up to 1.
        nominal: Gaps over which the joint is predicted to go, 1 for a sharp gap.
        widths: .. and the least and the most if it is elastic.
    """

    weight: Mapping[FlankKind, float]
    nominal: float
    widths: Width

    def is_open(self, kind: FlankKind) -> bool:
        """Return True if a hypothesis counts."""
        return self.weight[kind] > OPEN

    @property
    def open_kinds(self) -> tuple[FlankKind, ...]:
        """Return how the joint may cross its gap beside what is predicted."""
        return tuple(
            kind
            for kind in _ORDER
            if self.is_open(kind) and (kind is not FlankKind.SHARP or self.nominal > 1)
        )

    @property
    def max_lag(self) -> float:
        """Return what share of its step the link may lack behind a sharp gap's way."""
        if self.is_open(FlankKind.LATER) or self.is_open(FlankKind.NEVER):
            return 1.0
        most = self.widths[1] if self.is_open(FlankKind.ELASTIC) else 1.0
        return float((1.0 + on_the_way(1.0 - 2.0 / most, most)) / 2.0)

    @property
    def usually(self) -> float:
        """Return the weight of what is predicted."""
        usual = FlankKind.SHARP if self.nominal == 1.0 else FlankKind.ELASTIC
        return self.weight[usual]


def flanks_of(model: Model, arm: Arm) -> tuple[FlankOfJoint, ...]:
    """Return what is known of the flanks of joints 1 to 6.

    Args:
        model: A fitted model, with what reversals and measured paths say.
        arm: Its arm.
    """
    leads = ahead(model, arm).tolist()
    widths = model.flank_widths or [None] * 6
    return tuple(
        _of_joint(lead, width, model.in_motion.get(str(joint), ""))
        for joint, (lead, width) in enumerate(zip(leads, widths, strict=True), start=1)
    )


def _of_joint(leads: bool, width: Width | None, in_motion: str) -> FlankOfJoint:
    """Multiply prior and likelihoods of one joint."""
    stops = verdict_of(width)
    weight = np.array(PRIOR) * (_AHEAD if leads else _BEHIND)
    weight *= _AT_STOPS.get(stops, _EQUAL)
    found = _IN_MOTION.get(in_motion, _EQUAL)
    if stops == "elastic" and in_motion == CONFIRMED:
        found = _EQUAL  # steps along a path are too coarse to tell a flank's width
    weight *= found
    least, most = UNTOLD if width is None or stops in ("", "unlike") else width
    most = most if np.isfinite(most) else max(GIVES, least)
    nominal = float(np.sqrt(least * most)) if stops == "elastic" else 1.0
    weights = dict(zip(_ORDER, weight.tolist(), strict=True))
    runs_on = RUNS_ON * _RAN_ON.get(in_motion, 1.0)
    weights[FlankKind.RAN_ON] = 0.0 if leads else runs_on
    return FlankOfJoint(weights, nominal, (least, most))


def verdict_of(width: Width | None) -> str:
    """Return what reversals say of a joint.

    Returns:
        "sharp", "between", "elastic", "unlike", or "" where they do not tell.
    """
    if width is None or (width != UNLIKE and not np.isfinite(width[1])):
        return ""
    if width == UNLIKE:
        return "unlike"
    if width[1] <= SHARP:
        return "sharp"
    return "elastic" if width[0] > SHARP else "between"


def nominal_widths(flanks: tuple[FlankOfJoint, ...]) -> Floats:
    """Return the gaps over which every joint is predicted to go, (6,)."""
    return np.array([flank.nominal for flank in flanks])
