"""Policies of an effect: when it is fitted, searched for, and named."""

from __future__ import annotations

from enum import Enum, auto


class FitPolicy(Enum):
    """When `fit` takes an effect where no effects are asked for.

    Attributes:
        ON_REQUEST: Only where it is asked for.
        ALWAYS: In every fit.
        IF_EVIDENT: Where the rows give evidence for it.
        LAST: Where they do so for what all other effects leave.
        WITH_TRACKER: The same, where the place of the tracker is known.
    """

    ON_REQUEST = auto()
    ALWAYS = auto()
    IF_EVIDENT = auto()
    LAST = auto()
    WITH_TRACKER = auto()


class SearchPolicy(Enum):
    """Whether `fit` searches for an effect in its residual, as `diagnose` does.

    When it began or how fast it turns is not known before.

    Attributes:
        NEVER: It does not.
        ALWAYS: It does.
        ALONE: Where no free form holds a part of it.
        RIVAL: Only so that nothing else is taken for it: it is not added.
    """

    NEVER = auto()
    ALWAYS = auto()
    ALONE = auto()
    RIVAL = auto()


class NamingPolicy(Enum):
    """What a report says where `diagnose` adds an effect.

    Attributes:
        NAMED: The physical effect.
        UNEXPLAINED: That an error is there which no physical effect explains.
    """

    NAMED = auto()
    UNEXPLAINED = auto()
