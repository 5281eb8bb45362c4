"""The verdict on a compensated program in one sentence, and its exceptions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Indices
from postproc.compensation.findings.findings import SURE
from postproc.compensation.findings.tolerance import ToleranceCheck, Verdict
from postproc.compensation.solver.expected_error import ExpectedErrors
from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language.visits import Visits
from postproc.robot.pose import MM

FAR = 2.0  # times what is usual: an error that is larger is an exception
OUTSIDE = Reason(Code.OUTSIDE_SURVEY, "the target is outside of what was surveyed")
UNCERTAIN = Reason(Code.DIRECTION_UNCERTAIN, "the approach direction is uncertain")


@dataclass(frozen=True, eq=False)
class ProgramErrors:
    """What is known of the errors of a compensated program of n visits.

    Attributes:
        visits: The visits.
        corrected: Which of them were corrected, (n,).
        kept: Which kept their value although they hold a target, (n,).
        why: Index into `reasons`, (n,).
        reasons: Why visits keep their values.
        side: Where every joint lies in its play, (n, 6) from -1 to 1.
        expected: The expected errors.
        tolerance: Their verdict against a tolerance, None without one.
    """

    visits: Visits
    corrected: Bools
    kept: Bools
    why: Indices
    reasons: tuple[Reason, ...]
    side: Floats
    expected: ExpectedErrors
    tolerance: ToleranceCheck | None

    def exceptional(self) -> Bools:
        """Return which visits `list_exceptions` lists, (n,)."""
        errors = self.expected
        if self.tolerance is not None:
            return np.isin(self.tolerance.verdict, (Verdict.FAIL, Verdict.UNKNOWN))
        found = errors.unknown | errors.outside | self.kept
        if errors.known.any():
            found |= errors.high > FAR * np.median(errors.high[errors.known])
        return np.asarray(found & errors.judged)

    def reason_of(self, row: int) -> Reason:
        """Return why a visit is an exception, false where only its size says so."""
        reason: Reason = self.reasons[self.why[row]]
        if self.kept[row] or reason:
            return reason
        if self.expected.outside[row]:
            return OUTSIDE
        side = self.side[row]
        return UNCERTAIN if ((-SURE < side) & (side < SURE)).any() else NO_REASON

    def describe(self, row: int) -> TargetException:
        """Describe a visit as an exception."""
        v, errors = self.visits, self.expected
        place = f"{v.file_name(row)}:{v.place.line[row]} {v.target_name(row)}"
        return TargetException(
            row=row,
            place=place.rstrip(),
            reason=self.reason_of(row),
            corrected=not self.kept[row],
            expected_mm=float(errors.after[row]) / MM,
            bound_mm=float(errors.high[row]) / MM,
        )


@dataclass(frozen=True)
class TargetException:
    """A visit that needs a look; lengths in mm, NaN where not known.

    Attributes:
        row: Which visit.
        place: Its file and line, and the name of its target.
        reason: Why it is one, false where nothing but its size says so.
        corrected: Whether it was corrected all the same.
        expected_mm, bound_mm: Its expected true error and the 95 % bound.
    """

    row: int
    place: str
    reason: Reason
    corrected: bool
    expected_mm: float
    bound_mm: float

    def __str__(self) -> str:
        """Write it as a line, place first."""
        return f"{self.place}: {self.size()}{self.why()}"

    def size(self) -> str:
        """Write the expected error."""
        if np.isnan(self.bound_mm):
            return "error not known"
        return f"{self.expected_mm:.3f} mm expected, 95 % bound {self.bound_mm:.3f} mm"

    def why(self) -> str:
        """Write why it is an exception, nothing where only its size says so."""
        what = "" if self.corrected else "not corrected, "
        return f": {what}{self.reason}" if self.reason else ""


def list_exceptions(
    program: ProgramErrors, most: int | None = None
) -> tuple[TargetException, ...]:
    """List the visits to look at: first those of unknown error, then the largest bound.

    With a tolerance those are the ones that do not pass it. Else they are the ones that
    were not corrected, are outside of the survey, or have twice the usual bound.

    Args:
        program: Its errors.
        most: How many to list; default: all.
    """
    rows = np.flatnonzero(program.exceptional())
    size = np.nan_to_num(program.expected.high[rows], nan=np.inf)
    rows = rows[np.argsort(-size, kind="stable")][:most]
    return tuple(map(program.describe, rows.tolist()))


@dataclass(frozen=True)
class Headline:
    """The expected true error of a program in figures; lengths in mm.

    Attributes:
        targets: Visits that hold a target.
        corrected: How many of them were corrected.
        unknown: How many have no known error.
        before_mm, after_mm: Mean expected error without and with the corrections.
        median_mm: The median of the latter.
        below_before_mm, below_mm: What 95 % of all true errors are below.
        largest_mm: The largest expected error of a target.
        bound_mm: The largest 95 % bound of a target.
        worst: The target with that bound, None where none is known.
    """

    targets: int
    corrected: int
    unknown: int
    before_mm: float
    after_mm: float
    median_mm: float
    below_before_mm: float
    below_mm: float
    largest_mm: float
    bound_mm: float
    worst: TargetException | None

    def __str__(self) -> str:
        """Write the expected true error before and after."""
        if self.worst is None:
            text = "expected true error not known" if self.targets else ""
        elif not self.corrected:
            text = (
                f"expected true error mean {self.before_mm:.3f} mm, 95 % of arrivals "
                f"within {self.below_before_mm:.3f} mm"
            )
        else:
            text = (
                f"expected true error mean {self.before_mm:.3f} -> "
                f"{self.after_mm:.3f} mm, 95 % of arrivals within {self.below_mm:.3f} "
                f"mm, worst target within {self.bound_mm:.3f} mm (its 95 % bound)"
            )
        if self.worst is not None and self.unknown:
            text += f", not known at {self.unknown} visits"
        if self.targets and not self.corrected:
            text = f"nothing was corrected; {text}"
        return text

    def verdict(self, check: ToleranceCheck | None = None) -> str:
        """Write the verdict on the program in a few sentences.

        Args:
            check: The verdict of its targets against a tolerance.
        """
        if not self.targets:
            return "The program holds no target."
        said = [] if self.corrected else ["Nothing was corrected."]
        if check is not None:
            said.append(_against(check, self.targets))
        if self.first:
            said.append(f"{self.first[0].upper()}{self.first[1:]}.")
        if self.worst is None:
            said.append("The expected true errors are not known.")
        elif self.corrected:
            said.append(
                f"The mean expected true error falls from {self.before_mm:.3f} mm to "
                f"{self.after_mm:.3f} mm. 95 % of arrivals stay within "
                f"{self.below_mm:.3f} mm, and the worst target stays within "
                f"{self.bound_mm:.3f} mm (its 95 % bound)."
            )
        else:
            said.append(
                f"The mean expected true error is {self.before_mm:.3f} mm. 95 % of "
                f"arrivals stay within {self.below_before_mm:.3f} mm."
            )
        if self.worst is not None and self.unknown:
            said.append(f"The error of {self.unknown} targets is not known.")
        return " ".join(said)

    @property
    def first(self) -> str:
        """Name the worst target, "" where it is no worse than is usual."""
        if self.worst is None or not self.corrected:
            return ""
        usual = self.below_mm if self.worst.corrected else self.median_mm
        if self.worst.expected_mm <= FAR * usual:
            return ""
        return f"worst target {self.worst}"


def _against(check: ToleranceCheck, targets: int) -> str:
    """Write how many targets pass a tolerance."""
    sizes = " to ".join(f"{size:g}" for size in check.range_mm)
    if check.passes:
        return f"All {targets} targets pass the tolerance of {sizes} mm."
    fail, unknown = check.count(Verdict.FAIL), check.count(Verdict.UNKNOWN)
    return (
        f"{fail + unknown} of {targets} targets do not pass the tolerance of {sizes} "
        f"mm: {fail} fail, {unknown} are not known."
    )


def headline(program: ProgramErrors) -> Headline:
    """Put the verdict into figures."""
    errors = program.expected
    known = np.flatnonzero(errors.known)
    sizes, worst = np.full(5, np.nan), None
    if len(known):
        before, after = errors.before[known], errors.after[known]
        last = int(known[np.argmax(errors.high[known])])
        means = before.mean(), after.mean(), np.median(after), after.max()
        sizes = np.array([*means, errors.high[last]]) / MM
        worst = program.describe(last)
    return Headline(
        targets=int(errors.judged.sum()),
        corrected=int((program.corrected & errors.judged).sum()),
        unknown=int(errors.unknown.sum()),
        before_mm=float(sizes[0]),
        after_mm=float(sizes[1]),
        median_mm=float(sizes[2]),
        below_before_mm=errors.below_before / MM,
        below_mm=errors.below / MM,
        largest_mm=float(sizes[3]),
        bound_mm=float(sizes[4]),
        worst=worst,
    )
