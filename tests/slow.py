"""Cases that take long: whole searches, many drawn surveys; `make slow` runs them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import pytest


def slow(cases: Iterable[Any]) -> Iterator[Any]:
    """Mark cases of a parametrized test."""
    for case in cases:
        values = case if isinstance(case, tuple) else (case,)
        yield pytest.param(*values, marks=pytest.mark.slow)
