"""What came of a program: every visit with its status, and the exit code."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from postproc.arrays import (
    Bools,
    Floats,
    Indices,
    Signs,
    columns_of,
    data_frame,
)
from postproc.compensation.output.sidecar import (
    Sidecar,
    sidecar_path,
)
from postproc.diagnostics import Code, Reason
from postproc.exceptions import PostprocError
from postproc.files import (
    Content,
    check_places,
    is_stream,
    make_folder,
    write_all,
)
from postproc.language.languages import file_named
from postproc.language.visits import (
    NOT_FOLLOWED,
    Diagnostic,
    Visits,
)
from postproc.model.statistics import ErrorStatistics
from postproc.robot.pose import MM

if TYPE_CHECKING:  # it loads all of the planning, which a record does not want
    from postproc.arrays import DataFrame
    from postproc.compensation.findings.headline import ProgramErrors
    from postproc.compensation.findings.timing_comparison import InTime
    from postproc.compensation.findings.tolerance import JobTolerance, ToleranceCheck
    from postproc.compensation.solver.arrivals import ArrivalStates
    from postproc.compensation.solver.expected_error import ExpectedErrors
    from postproc.verify.opinion import Opinion

# What came of a program: every visit with its status, and the exit code.

DONE, NOT_ALL, FAILED = 0, 1, 2  # exit codes
SHARED = 40_000  # visits up to which reports tell the shares of the effects


class Status(IntEnum):
    """How a visit came out."""

    CORRECTED = 0  # corrected; every arrival at the literal agrees
    CONFLICT = 1  # arrivals at one literal disagree: left alone
    RUNTIME = 2  # the value is known only at run time
    REJECTED = 3  # the correction is not trusted: left alone
    UNCHANGED = 4  # nothing to correct, or not to be corrected


LEFT_ALONE = (Status.CONFLICT, Status.REJECTED, Status.RUNTIME)


@dataclass(frozen=True)
class Decisions:
    """What was decided for n visits (structure of arrays).

    Attributes:
        status: `Status`, (n,).
        why: Index into `reasons`, (n,).
        reasons: Why visits keep their values; reasons[0] is `NO_REASON`.
        q: Commanded joint angles of the original program, (n, 6) [rad].
        direction: Arrival direction, (n, 6): +1, -1, or 0 where not known.
        side: Where every joint lies in its play, (n, 6) from -1 to 1.
        corrected: The numbers in the file after correction, (n, w).
        correction: Change of the commanded TCP, base frame, (n, 3) [m].
        std_error: Standard error of the model there, per axis, (n, 3) [m].
        turn: Rotation of the commanded tool, base frame, (n, 3) [rad]; empty where
            nobody asked.
    """

    status: Signs
    why: Indices
    reasons: tuple[Reason, ...]
    q: Floats
    direction: Signs
    side: Floats
    corrected: Floats
    correction: Floats
    std_error: Floats
    turn: Floats = field(default_factory=lambda: np.empty((0, 3)))

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
        before, after: Predicted error on the visits that could be compensated. After
            is the residual of the correction: what the arm will miss is `expected`.
        diagnostics: What else was found, in order of line.
        stages: Seconds spent in every stage, by all processes together.
        motion: The largest change on the ways between targets: ``joint_deg``,
            ``elbow_mm``, ``wrist_centre_mm``, ``tcp_mm``.
        position: Where the program wants the TCP at every visit, base frame, (n, 3)
            [m], NaN where it is not known; empty where nobody asked.
        sources: The bytes of the source files by name, for showing lines.
        arrivals: The states that the visits are corrected for, with the shares of the
            effects in their errors; None where nobody knows.
        expected: Their expected true errors; None likewise.
        in_time: The program run in time, before and after; None where nobody asked.
        opinion: A second opinion on it; None where nobody asked.
        tolerance: Expected true errors against a tolerance; None where nobody asked.
        inputs: Files that it was read from, which `save` must not write over.
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
    motion: Mapping[str, float] = field(default_factory=dict)
    position: Floats = field(default_factory=lambda: np.empty((0, 3)))
    sources: Mapping[str, bytes] = field(default_factory=dict)
    arrivals: ArrivalStates | None = None
    expected: ExpectedErrors | None = None
    in_time: InTime | None = None
    opinion: Opinion | None = None
    tolerance: ToleranceCheck | None = None
    inputs: tuple[Path, ...] = ()

    def __str__(self) -> str:
        """Say what came of it; see `summary`."""
        said = [self.summary()]
        if self.in_time is not None:
            said.append(self.in_time.summary(self.visits))
        return "\n".join(said)

    def save(self, folder: str | Path) -> list[Path]:
        """Write the program, what changed of its files, and the records of them.

        Args:
            folder: Where to; it is made unless it is there. Files keep their names.

        Returns:
            The files written, the program last.

        Raises:
            OutputError: One would be written over what it was read from, or cannot be
                written.
        """
        names = {name: Path(folder, Path(name).name) for name in self.outputs}
        values = file_named(self.program).variables
        own = [n for n in (values, self.program) if n in names]
        files: dict[Path, Content] = {}
        for name in reversed([name for name in names if name not in own]):
            files |= self.name_files({name: names[name]}, names[name])
        files |= self.name_files({n: names[n] for n in own}, names[self.program])
        make_folder(Path(folder))
        check_places(files, self.inputs)
        write_all(files)
        return list(files)

    def name_files(self, places: Mapping[str, Path], main: Path) -> dict[Path, Content]:
        """Name the files of one program, behind the record that undoes them.

        Args:
            places: Where outputs go, by name.
            main: The place beside which the record lies; none lies beside a pipe.
        """
        names = {name: place.name for name, place in places.items()}
        record = self.record.rename_files(names).to_json()
        files = {place: self.outputs[name] for name, place in places.items()}
        return {**({} if is_stream(main) else {sidecar_path(main): record}), **files}

    def to_frame(self) -> DataFrame:
        """Return a data frame, one row a visit, in the order of the program.

        Columns: file, line, target, status, code, reason, then the correction of the
        TCP in the base frame (``dx_mm`` ..), its standard error (``std_x_mm`` ..) and
        the commanded joint angles before correction (``q1_deg`` ..).
        """
        v, d = self.visits, self.decisions
        return data_frame(
            {
                "file": [v.files[k] for k in v.place.file.tolist()],
                "line": v.place.line,
                "target": [v.target.names[k] for k in v.target.name.tolist()],
                "status": [Status(k).name.lower() for k in d.status.tolist()],
                "code": [d.reasons[k].name for k in d.why.tolist()],
                "reason": [d.reasons[k].text for k in d.why.tolist()],
                **columns_of(("dx_mm", "dy_mm", "dz_mm"), d.correction / MM),
                **columns_of(("std_x_mm", "std_y_mm", "std_z_mm"), d.std_error / MM),
                **columns_of([f"q{k}_deg" for k in range(1, 7)], np.rad2deg(d.q)),
            }
        )

    @property
    def sidecar(self) -> str:
        """The record that `restore` needs, as JSON text."""
        return b"".join(self.record.to_json()).decode("ascii")

    @property
    def reported(self) -> Outcome:
        """Return what reports tell: of a long program no shares of effects.

        They cost more than all else that a report says of a target, up to four times
        as much.
        """
        return self if len(self.visits) <= SHARED else replace(self, arrivals=None)

    @property
    def exit_code(self) -> int:
        """Return 1 where a target could have been compensated and was not.

        Also where the compensated program does not run as the original does, a second
        opinion disagrees, or a visit does not pass the tolerance.
        """
        left = (Status.CONFLICT, Status.RUNTIME, Status.REJECTED)
        missed = any(d.code in NOT_FOLLOWED for d in self.diagnostics)
        missed |= self.in_time is not None and self.in_time.falls_short
        missed |= self.opinion is not None and not self.opinion.agrees
        missed |= self.tolerance is not None and not self.tolerance.passes
        far = [one.code is Code.ARRIVALS_FAR_APART for one in self.decisions.reasons]
        missed |= bool(np.array(far)[self.decisions.why].any())
        return NOT_ALL if missed or np.isin(self.decisions.status, left).any() else DONE

    def with_tolerance(self, tolerance: JobTolerance | None) -> Outcome:
        """Judge every visit by its expected true error, see `check_tolerance`.

        Raises:
            PostprocError: How the arm arrives is not known.
        """
        if tolerance is None:
            return self
        from postproc.compensation.findings.tolerance import check_tolerance

        if self.expected is None:
            raise PostprocError("--tolerance: how the arm arrives is not known")
        found = check_tolerance(self.expected, tolerance.of_visits(self.visits))
        record = replace(self.record, tolerance=found.to_record())
        return replace(self, tolerance=found, record=record)

    @property
    def errors(self) -> ProgramErrors | None:
        """What is known of its expected errors; None where they are not known."""
        if self.expected is None:
            return None
        from postproc.compensation.findings.headline import ProgramErrors

        d = self.decisions
        return ProgramErrors(
            visits=self.visits,
            corrected=np.asarray(d.status == Status.CORRECTED),
            kept=np.isin(d.status, LEFT_ALONE),
            why=d.why,
            reasons=d.reasons,
            side=d.side,
            expected=self.expected,
            tolerance=self.tolerance,
        )

    def summary(self) -> str:
        """Say what came of the program, the worst first."""
        from postproc.compensation.findings.headline import headline

        d = self.decisions
        counts = ", ".join(
            f"{d.count(s)} {s.name.lower()}" for s in Status if d.count(s)
        )
        errors = self.errors
        lines: list[str] = []
        parts = [f"{len(d.status)} visits ({counts or 'no targets'})"]
        if errors is not None:
            found = headline(errors)
            parts.append(str(found))
            lines += filter(None, [found.first])
        if self.before.n:
            parts.append(f"residual of the correction {self.after.max_mm:.4f} mm")
        lines.append(f"{self.program}: {'; '.join(filter(None, parts))}")
        return "\n".join(lines)

    def list_uncorrected_rows(self) -> list[int]:
        """Return the visits that kept their value although they hold a target."""
        left = (Status.CONFLICT, Status.RUNTIME, Status.REJECTED)
        rows: list[int] = np.flatnonzero(np.isin(self.decisions.status, left)).tolist()
        return rows

    def list_uncorrected(self) -> list[str]:
        """List every visit that kept its value although it holds a target."""
        d, v = self.decisions, self.visits
        return [
            f"{v.file_name(i)}:{v.place.line[i]}: {Status(d.status[i]).name.lower()}: "
            f"{d.reasons[d.why[i]]}"
            for i in self.list_uncorrected_rows()
        ]


def largest_motion(departure: Floats) -> dict[str, float]:
    """Name the largest changes of motion.

    Args:
        departure: Changes of a joint [rad], elbow, wrist centre and TCP [m], (n, 4).
    """
    largest = np.fmax.reduce(departure, axis=0, initial=0.0)
    joint, elbow, wrist, tcp = np.append(np.rad2deg(largest[:1]), largest[1:] / MM)
    return {
        "joint_deg": float(joint),
        "elbow_mm": float(elbow),
        "wrist_centre_mm": float(wrist),
        "tcp_mm": float(tcp),
    }


def find_judged(visits: Visits, decisions: Decisions) -> Bools:
    """Return which visits have a target that they can miss, (n,)."""
    changed = decisions.status != Status.UNCHANGED
    return np.asarray(changed | (visits.target.literal >= 0))
