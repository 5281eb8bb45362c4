"""What travels to a worker and what comes back: bytes, never paths of a disk."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Unit:
    """Files that are compensated together, by their paths below the source tree.

    Attributes:
        program: The main program.
        pages: Programs that it imports and nobody else does, in order.
        variables: Its variable file, or None.
        setup: Index of its cell and model in the plan.
    """

    program: str
    pages: tuple[str, ...]
    variables: str | None
    setup: int

    @property
    def programs(self) -> tuple[str, ...]:
        """Return the main program and its pages."""
        return (self.program, *self.pages)

    @property
    def files(self) -> tuple[str, ...]:
        """Return all files, the main program first."""
        own = () if self.variables is None else (self.variables,)
        return (*self.programs, *own)


@dataclass(frozen=True)
class Task:
    """A unit with its bytes, for a worker anywhere.

    Attributes:
        unit: What it is.
        sources: The bytes of its files, in their order.
    """

    unit: Unit
    sources: tuple[bytes, ...]

    @property
    def files(self) -> dict[str, bytes]:
        """Return the bytes of its files by path."""
        return dict(zip(self.unit.files, self.sources, strict=True))

    @property
    def size(self) -> int:
        """Return the number of bytes, the measure of how long it takes."""
        return sum(map(len, self.sources))


@dataclass(frozen=True)
class Result:
    """What came of a task.

    Attributes:
        unit: What it is.
        exit_code: 0 done, 1 a target was left, 2 nothing came out.
        outputs: New bytes by path below the target tree; none where it failed.
        facts: For the log: counts, figures, findings; or ``error``.
        seconds: How long it took.
    """

    unit: Unit
    exit_code: int
    outputs: Mapping[str, bytes] = field(default_factory=dict)
    facts: Mapping[str, Any] = field(default_factory=dict)
    seconds: float = 0.0


def failed(unit: Unit, problem: str, seconds: float = 0.0) -> Result:
    """Return the result of a unit of which nothing came."""
    return Result(unit, 2, {}, {"error": problem}, seconds)


def digest_of(names: tuple[str, ...], sources: tuple[bytes, ...], setup: str) -> str:
    """Hash what decides an output: the sources, their names, and the setup's digest."""
    sha = hashlib.sha256(setup.encode())
    for name, data in zip(names, sources, strict=True):
        base = name.rpartition("/")[2].encode("utf-8", "surrogateescape")
        sha.update(b"%d:%s:%d:" % (len(base), base, len(data)))
        sha.update(data)
    return sha.hexdigest()
