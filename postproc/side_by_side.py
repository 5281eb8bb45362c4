"""Long work on two cores: some of it in a forked child, the results as if it were not.

What is short is done here: a child would cost more than it gains.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

from postproc.arrays import Each
from postproc.forked import available, in_child

K = TypeVar("K")
T = TypeVar("T")

LONG = 20  # tasks from which on they are shared out


def sharing(processes: int) -> Each:
    """Return how to make something of every task with so many processes at most."""
    return map if processes < 2 else in_turns


def in_turns(make: Callable[[K], T], tasks: Sequence[K], every: int = 2) -> Iterator[T]:
    """Make something of every task, in order.

    Both processes go through the tasks together, so that neither holds much of what
    the other has to wait for.

    Args:
        make: Makes it; a child does so for most tasks, and sends what it made.
        tasks: Each is worth some milliseconds.
        every: Every second, third.. task is done here; more of them leave more time
            here for what is done with the results.
    """
    if len(tasks) < LONG or available() < 2:
        yield from map(make, tasks)
        return
    theirs = [task for number, task in enumerate(tasks) if number % every]
    with in_child(lambda: map(make, theirs)) as made:
        for number, task in enumerate(tasks):
            yield next(made) if number % every else make(task)


@contextmanager
def meanwhile(work: Callable[[], T], *, worth: bool) -> Iterator[Callable[[], T]]:
    """Begin work that nothing waits for yet; yield how to ask for its result, once.

    Args:
        work: What to do; what it raises is raised when its result is asked for.
        worth: It takes long enough for a process of its own.
    """
    if not worth or available() < 2:
        yield work
        return
    with in_child(lambda: [work()]) as made:
        yield lambda: next(made)
