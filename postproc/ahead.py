"""Windows of a program worked through by several processes, to the same bytes.

A window depends on those before only through where the arm stands at its beginning. A
process that works ahead foretells that from the targets right before: the joints take
up their play within a few moves, and what was before is forgotten. Whether it was
right, to the last bit, is seen when the windows before are done; where it was not, its
windows are done again from where the arm does stand. So the result is that of one
process.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import fields, is_dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any, Protocol, TypeVar, cast

import numpy as np

from postproc.clock import Clock, silent
from postproc.forked import can_fork, in_child

W_contra = TypeVar("W_contra", contravariant=True)
K_co = TypeVar("K_co", covariant=True)
W = TypeVar("W")
S = TypeVar("S")
K = TypeVar("K")

DIGITS = 12  # of [rad] and [m]: sums in blocks of other lengths differ behind these


class Work(Protocol[W_contra, S, K_co]):
    """What is done with windows W, between stops S, for results K."""

    def correct(self, window: W_contra, begin: S, clock: Clock) -> tuple[K_co, S]:
        """Work through one window; return its result, and how it ends."""

    def foretell(self, window: W_contra) -> S | None:
        """Tell from where a window will begin; None where that cannot be told."""


def in_processes(
    work: Work[W, S, K],
    windows: Sequence[W],
    begin: S,
    clock: Clock,
    processes: int,
) -> Iterator[K]:
    """Work through windows, a part of them in every process; yield the results.

    Args:
        work: What is to be done.
        windows: In their order.
        begin: From where the first one begins.
        clock: Given the seconds of all processes.
        processes: How many at the most, this one included.

    Raises:
        PostprocError: As the work does, for the first window that fails.
    """
    own, *others = shared_out(windows, processes if can_fork() else 1)
    with ExitStack() as children:
        ahead = [
            children.enter_context(in_child(partial(_ahead, work, part), len(part) + 1))
            for part in others
        ]
        stop = begin
        for window in own:
            kept, stop = work.correct(window, stop, clock)
            yield kept
        for part, found in zip(others, ahead, strict=True):
            right = is_same(next(found), stop)
            for window in part:
                if right:
                    kept, stop, seconds = next(found)
                    clock.add(seconds)
                else:
                    kept, stop = work.correct(window, stop, clock)
                yield kept


def shared_out(windows: Sequence[W], processes: int) -> list[Sequence[W]]:
    """Give every process its part, each one window at least.

    >>> shared_out("abcde", 2)
    ['ab', 'cde']
    """
    k = max(min(processes, len(windows)), 1)
    ends = [len(windows) * i // k for i in range(k + 1)]
    return [windows[a:b] for a, b in pairwise(ends)]


def _ahead(work: Work[W, S, K], part: Sequence[W]) -> Iterator[Any]:
    """Foretell where some windows begin, and work through them; yield both.

    First the stop that was foretold, or None; then, for every window, its result, its
    end and the seconds of its stages.
    """
    stop = work.foretell(part[0])
    yield stop
    if stop is None:
        return
    for window in part:
        clock = Clock(silent)
        kept, stop = work.correct(window, stop, clock)
        yield kept, stop, clock.stages


def steady(stop: S) -> S:
    """Round a tree of dataclasses and arrays to `DIGITS`."""
    found: Any = stop
    if isinstance(found, np.ndarray):
        found = np.round(found, DIGITS)
    elif is_dataclass(found) and not isinstance(found, type):
        own = {f.name: steady(getattr(found, f.name)) for f in fields(found)}
        found = replace(found, **own)
    return cast(S, found)


def is_same(a: Any, b: Any) -> bool:
    """Tell whether two trees of dataclasses and arrays agree, to the last bit."""
    if type(a) is not type(b):
        return False
    if is_dataclass(a) and is_dataclass(b):
        return all(is_same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    if isinstance(a, np.ndarray):
        if a.dtype != b.dtype or a.shape != b.shape:
            return False
        return a.tobytes() == np.asarray(b).tobytes()
    return bool(a == b)
