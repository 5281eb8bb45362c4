"""Tasks in chunks that last about a second each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from postproc.batch.task import Task

LASTING = 1.0  # [s] of a chunk: long against sending it, short against the whole run
MOST = 256  # tasks of a chunk
FIRST = 8_000  # bytes of a chunk while nothing is known of the speed

Chunk = tuple[Task, ...]


@dataclass
class Pace:
    """How fast a worker is, learned from what it has done.

    Attributes:
        size: Bytes done, those of long ago counted less.
        seconds: Seconds that they took.
    """

    size: float = 0.0
    seconds: float = 0.0

    def learn(self, size: int, seconds: float) -> None:
        """Take in a chunk that is done."""
        self.size = 0.8 * self.size + size
        self.seconds = 0.8 * self.seconds + seconds

    @property
    def chunk(self) -> float:
        """Return the bytes that take about `LASTING` seconds."""
        return LASTING * self.size / self.seconds if self.seconds > 0 else FIRST


def chunks(tasks: Iterator[Task], pace: Pace) -> Iterator[Chunk]:
    """Join tasks of the same setup, as many as last about a second by now."""
    waiting: list[Task] = []
    size = 0
    for task in tasks:
        other = bool(waiting) and task.unit.setup != waiting[0].unit.setup
        full = size + task.size > pace.chunk or len(waiting) == MOST
        if waiting and (other or full):
            yield tuple(waiting)
            waiting, size = [], 0
        waiting.append(task)
        size += task.size
    if waiting:
        yield tuple(waiting)
