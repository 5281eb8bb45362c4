"""What came of a program: every visit with its status, and the exit code."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from enum import IntEnum

import numpy as np

from postproc.arrays import Floats, Ints, Signs
from postproc.language.pdl2.effects import NEVER_REACHED
from postproc.language.visits import Diagnostic, Visits
from postproc.model.statistics import ErrorStatistics
from postproc.sidecar import Sidecar

DONE, NOT_ALL, FAILED = 0, 1, 2  # exit codes


class Status(IntEnum):
    """How a visit came out."""

    SAFE = 0  # corrected; every arrival at the literal agrees
    UNSAFE = 1  # arrivals at one literal disagree: left alone
    DISPLAY = 2  # the value is known only at run time
    GUARDED = 3  # the correction is not trusted: left alone
    UNCHANGED = 4  # nothing to correct, or not to be corrected


@dataclass(frozen=True)
class Decisions:
    """What was decided for n visits (structure of arrays).

    Attributes:
        status: `Status`, (n,).
        why: Index into `reasons`, (n,).
        reasons: Texts; reasons[0] is "".
        q: Commanded joint angles of the original program, (n, 6) [rad].
        direction: Arrival direction, (n, 6): +1, -1, or 0 where not known.
        side: Where every joint lies in its play, (n, 6) from -1 to 1.
        corrected: The six numbers in the file after correction, (n, 6).
        correction: Change of the commanded TCP, base frame, (n, 3) [m].
        std_error: Standard error of the model there, per axis, (n, 3) [m].
        turn: Rotation of the commanded tool, base frame, (n, 3) [rad]; empty where
            nobody asked.
    """

    status: Ints
    why: Ints
    reasons: tuple[str, ...]
    q: Floats
    direction: Signs
    side: Floats
    corrected: Floats
    correction: Floats
    std_error: Floats
    turn: Floats = field(default_factory=lambda: np.empty((0, 3)))

    def part(self, rows: slice) -> Decisions:
        """Take the decisions for some visits."""
        own = {
            f.name: getattr(self, f.name)[rows]
            for f in fields(self)
            if f.name != "reasons"
        }
        return replace(self, **own)

    def count(self, status: Status) -> int:
        """Count the visits of one status."""
        return int((self.status == status).sum())


@dataclass(frozen=True)
class Outcome:
    """A compensated program and how it came about.

    Attributes:
        program: Name of the program.
        model: Id of the model.
        outputs: New bytes by file name, the program itself first; a file whose values
            did not change is absent.
        record: What `restore` needs.
        visits: What was found in the program.
        decisions: What was decided for every visit.
        before, after: Predicted error on the visits that could be compensated.
        diagnostics: What else was found, in order of line.
        stages: Seconds spent in every stage, by all processes together.
        position: Where the program wants the TCP at every visit, base frame, (n, 3)
            [m], NaN where it is not known; empty where nobody asked.
        sources: The bytes of the source files by name, for showing lines.
    """

    program: str
    model: str
    outputs: Mapping[str, bytes]
    record: Sidecar
    visits: Visits
    decisions: Decisions
    before: ErrorStatistics
    after: ErrorStatistics
    diagnostics: tuple[Diagnostic, ...]
    stages: Mapping[str, float] = field(default_factory=dict)
    position: Floats = field(default_factory=lambda: np.empty((0, 3)))
    sources: Mapping[str, bytes] = field(default_factory=dict)

    @property
    def sidecar(self) -> str:
        """The record that `restore` needs, as JSON text."""
        return "".join(self.record.to_json())

    @property
    def exit_code(self) -> int:
        """Return 1 where a target could have been compensated and was not."""
        left = (Status.UNSAFE, Status.DISPLAY, Status.GUARDED)
        missed = any(d.code == NEVER_REACHED for d in self.diagnostics)
        return NOT_ALL if missed or np.isin(self.decisions.status, left).any() else DONE

    def summary(self) -> str:
        """Say in one line what came of the program."""
        d = self.decisions
        counts = ", ".join(
            f"{d.count(s)} {s.name.lower()}" for s in Status if d.count(s)
        )
        line = f"{self.program}: {len(d.status)} visits ({counts or 'no targets'})"
        if self.before.n:
            line += (
                f"; predicted error mean {self.before.mean_mm:.3f} -> "
                f"{self.after.mean_mm:.3f} mm, max {self.before.max_mm:.3f} -> "
                f"{self.after.max_mm:.3f} mm"
            )
        return line

    def left_rows(self) -> list[int]:
        """Return the visits that kept their value although they hold a target."""
        left = (Status.UNSAFE, Status.DISPLAY, Status.GUARDED)
        rows: list[int] = np.flatnonzero(np.isin(self.decisions.status, left)).tolist()
        return rows

    def left_alone(self) -> list[str]:
        """List every visit that kept its value although it holds a target."""
        d, v = self.decisions, self.visits
        return [
            f"{v.files[v.file[i]]}:{v.line[i]}: {Status(d.status[i]).name.lower()}: "
            f"{d.reasons[d.why[i]]}"
            for i in self.left_rows()
        ]

    def to_json(self) -> str:
        """Return the whole report as JSON text."""
        from postproc.report_json import report_pieces

        return "".join(report_pieces(self))
