"""Which other causes would explain the same rows just as well.

A name is preferred to a free form that is not clearly ahead of it, but that does not
make the rows speak for the name: such a free form is told with it.
"""

from __future__ import annotations

from dataclasses import dataclass

from postproc.accuracy.diagnosis.choice import ranking
from postproc.accuracy.diagnosis.projection import Projection
from postproc.accuracy.diagnosis.score import Score
from postproc.accuracy.diagnosis.search import Search

NEAR = 3.0  # nats: odds of 20 to 1
MOST_OTHERS = 2


@dataclass(frozen=True)
class Standing:
    """An addition judged with everything else in the model.

    Attributes:
        evidence: What speaks for it [nats].
        p_value: Probability that noise alone reaches that anywhere in the library.
        confusable: Families that explain the same within a few nats, best first.
    """

    evidence: float
    p_value: float
    confusable: tuple[Score, ...]


def stand(found: Search, number: int) -> Standing:
    """Judge one addition of a search against all that could take its place."""
    own = found.additions[number].candidate
    projection = Projection.of(found.fit, without=found.place(number))
    scores = ranking(projection, found.library)
    here = next((s for s in scores if s.family == own.family), None)
    if here is None:
        here = found.additions[number].score
    rivals = []
    names = {(own.family.effect, own.family.joint)}
    for s in scores:
        name = (s.family.effect, s.family.joint)
        if s.evidence >= here.evidence - NEAR and name not in names:
            rivals.append(s)
            names.add(name)
    p_value = found.null.p_value(here.evidence)
    return Standing(here.evidence, p_value, tuple(rivals[:MOST_OTHERS]))
