"""Why a planned move must not be compensated."""

from __future__ import annotations

REACHED = ""
NO_TARGET = "where this move goes is not known"
OUT_OF_REACH = "out of reach: check the target, $TOOL, $UFRAME and $BASE"
NO_BRANCH = "no solution for the configuration string: check its flags"
NO_START = (
    "the branch is not known: no configuration string and an unknown start; write one, "
    "or a joint target before it"
)
PATH_REACH = "the path to it leaves the reach: add a point between, or use JOINT"
PATH_JUMP = "the path to it passes through a singularity: lead it round, or use JOINT"
NO_CIRCLE = "the three points of the arc lie on one line: move VIA, or use LINEAR"
ARC_END = "where the arc through it ends is not known"
AMBIGUOUS = "its predecessors lead to different joint angles"
OTHER_BRANCH = "the path to it arrives on another branch or turn than its joint angles"
LIMITS = tuple(
    f"axis {j} beyond its limit: check the target and its turns" for j in range(1, 7)
)
PATH_LIMITS = tuple(f"axis {j} beyond its limit on the way to it" for j in range(1, 7))
WRIST = "at the wrist singularity: turn the tool, or lower wrist_deg in the cell"

REASONS = (
    REACHED, NO_TARGET, OUT_OF_REACH, NO_BRANCH, NO_START, PATH_REACH, PATH_JUMP,
    NO_CIRCLE, ARC_END, AMBIGUOUS, OTHER_BRANCH, *LIMITS, *PATH_LIMITS, WRIST,
)  # fmt: skip
CODE = {reason: code for code, reason in enumerate(REASONS)}
