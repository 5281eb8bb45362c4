"""What all the rows say about what a fit lacks."""

from __future__ import annotations

from dataclasses import dataclass

from postproc.accuracy.diagnosis.bootstrap import bootstrap
from postproc.accuracy.diagnosis.findings import describe
from postproc.accuracy.diagnosis.groups import Standing, stand
from postproc.accuracy.diagnosis.library import Library
from postproc.accuracy.diagnosis.omnibus import Leftover, leftovers
from postproc.accuracy.diagnosis.projection import Projection
from postproc.accuracy.diagnosis.result import Finding, Verdict
from postproc.accuracy.diagnosis.search import Progress, Search
from postproc.accuracy.diagnosis.withdrawal import investigate
from postproc.accuracy.fitted import Fit

REMAINS = 0.01  # level at which structure is called structure: nothing was added
STILL_REMAINS = 0.001  # ... after something was


def silent(stage: str, share: float) -> None:
    """Tell nobody."""


@dataclass(frozen=True, eq=False)
class Trace:
    """What all the rows say.

    Attributes:
        search: What was added.
        standings: Every addition judged with all others in the model.
        leftovers: What the final residual still shows.
    """

    search: Search
    standings: tuple[Standing, ...]
    leftovers: tuple[Leftover, ...]

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Describe the additions."""
        return describe(self.search, self.standings)

    @property
    def verdict(self) -> Verdict:
        """Decide between an effect, noise, and structure without a name."""
        p_value = min((x.p_value for x in self.leftovers), default=1.0)
        added = [a.candidate.family.effect for a in self.search.additions]
        if not added:
            return "unexplained" if p_value < REMAINS else "noise"
        nameless = "curve" in added or p_value < STILL_REMAINS
        return "unexplained" if nameless else "effect"


def trace(base: Fit, seed: int, progress: Progress = silent) -> Trace:
    """Search a fit's rows for what it lacks, and judge what was found."""
    progress("candidates", 0.0)
    library = Library.of(base)
    progress("threshold of the whole library", 0.05)
    null = bootstrap(Projection.of(base), library, seed)
    found = investigate(base, library, null, progress)
    progress("groups that cannot be told apart", 0.5)
    standings = tuple(stand(found, k) for k in range(len(found.additions)))
    progress("what is left", 0.55)
    left = leftovers(Projection.of(found.fit), seed)
    return Trace(found, standings, left)
