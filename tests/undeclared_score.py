"""When an answer is right, and how sure it claims to be."""

from __future__ import annotations

from collections.abc import Iterable

from tests.calibration.planted import NAMELESS, READINGS
from tests.undeclared_trial import Trial

CLEAR = 1e-3  # p-value of a finding that a reader takes for certain
WITHIN = 1.5  # times the informed fit's error


def ok(t: Trial) -> bool:
    """Tell whether an answer is right."""
    if t.kind == "none":
        return t.verdict == "noise"
    return t.right or (t.kind in NAMELESS and t.verdict == "unexplained")


def groups(trials: Iterable[Trial]) -> list[int]:
    """List the sizes of all groups."""
    return [1 + len(f["group"]) for t in trials for f in t.found]  # type: ignore[arg-type]


def misnamed(t: Trial) -> bool:
    """Tell whether something without a name was given one with confidence."""
    return t.kind in NAMELESS and any(
        not _open(f) and float(str(f["p"])) < CLEAR and t.verdict == "effect"
        for f in t.found
    )


def _open(finding: dict[str, object]) -> bool:
    """Tell whether a finding is a curve, or cannot be told from one."""
    names = [finding["effect"], *(g[0] for g in finding["group"])]  # type: ignore[attr-defined]
    return "curve" in names


def close(t: Trial) -> bool:
    """Tell whether the extension comes close to an informed fit, as a tracker can tell.

    Where the tracker itself errs, and nothing else says where it is, the base stands
    where it seems to stand: one rigid displacement is taken out of either fit.
    """
    registered = any(effect in READINGS for effect, _, _ in t.truth)
    return _within(t.registered_mm if registered else t.true_mm)


def close_as_it_stands(t: Trial) -> bool:
    """Tell the same with nothing taken out."""
    return _within(t.true_mm)


def _within(errors: tuple[float, float, float]) -> bool:
    return errors[1] <= WITHIN * errors[2]


def laws(t: Trial) -> int:
    """Count what was planted; compliance of two joints counts twice."""
    return sum(max(1, len(joints)) for _, joints, _ in t.truth)
