"""Seconds spent in every stage."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from time import perf_counter

Progress = Callable[[str], None]


def silent(stage: str) -> None:
    """Tell nobody."""


class Clock:
    """Seconds spent in every stage; tells the stages to whom it may concern."""

    def __init__(self, progress: Progress) -> None:
        """Start with no stage."""
        self.stages: dict[str, float] = {}
        self._progress = progress

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Add the time of a block to a stage."""
        self._progress(stage)
        start = perf_counter()
        yield
        self.add({stage: perf_counter() - start})

    def add(self, seconds: Mapping[str, float]) -> None:
        """Add stages that ran elsewhere, such as in another process."""
        for stage, spent in seconds.items():
            self.stages[stage] = self.stages.get(stage, 0.0) + spent
