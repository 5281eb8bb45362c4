"""Before an upload: is all of a tree compensated, current, and as it was written?"""

from __future__ import annotations

import json
import os
import posixpath
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from postproc.arrays import data_frame
from postproc.batch.plan import BatchPlan, make_plan
from postproc.compensation.options import DEFAULT_OPTIONS
from postproc.compensation.outcome import LEFT_ALONE
from postproc.compensation.output.line_outcomes import add_uncorrected
from postproc.compensation.output.sidecar import (
    FileRecord,
    LeftLine,
    Sidecar,
    path_between,
    read_sidecar,
    read_without_edits,
    sha256,
    sidecar_path,
)
from postproc.compensation.pages import program_arm, read_head
from postproc.diagnostics import Code
from postproc.exceptions import PostprocError, ProgramError
from postproc.files import (
    TEMPORARY,
    FolderListing,
    read_input,
    schema,
)
from postproc.language.languages import file_named, language_of
from postproc.language.text.stamp import Stamp, read_stamp
from postproc.language.visits import line_ranges
from postproc.model.model import Model, load_model
from postproc.robot.cell import load_cell

if TYPE_CHECKING:
    from postproc.arrays import DataFrame

_EDITED = (
    "was changed after it was compensated: make the change in its source, and "
    "compensate that again"
)
_UNDO = "undo that, or make the change in the source tree and compensate it again"
_SOURCE_CHANGED = "its source has changed since: compensate it again"
_EITHER_CHANGED = (
    "differs from its source, and its record does not tell which of them was changed: "
    "compare them, then compensate the source again"
)

Current = Callable[[str], str | None]  # program -> id of the model it should have


@dataclass(frozen=True, order=True)
class CheckFinding:
    """Why a file must not be uploaded as it is.

    Attributes:
        place: Its path below the checked folder, with ``/``.
        code: What kind of trouble it is.
        message: The trouble, and what to do.
    """

    place: str
    code: Code
    message: str

    def __str__(self) -> str:
        """Write it as a line."""
        return f"{self.place}: {self.code}: {self.message}"


@dataclass(frozen=True)
class Checked:
    """What a check has found.

    Attributes:
        programs: Number of programs looked at.
        findings: Sorted by file.
    """

    programs: int
    findings: tuple[CheckFinding, ...]

    @property
    def exit_code(self) -> int:
        """Return 0 where all may be uploaded, 1 where something must not."""
        return 1 if self.findings else 0

    def __str__(self) -> str:
        """Say what was found, a line a finding, and how many programs there are."""
        lines = map(str, self.findings)
        count = f"{self.programs} programs, {len(self.findings)} findings"
        return "\n".join([*lines, count])

    def to_frame(self) -> DataFrame:
        """Return a data frame of the findings: place, code, message."""
        names = ("place", "code", "message")
        found = self.findings
        return data_frame({name: [getattr(f, name) for f in found] for name in names})

    def allow_uncorrected(self) -> Checked:
        """Return it without targets left alone: somebody has looked at them."""
        kept = tuple(f for f in self.findings if f.code != Code.LEFT_ALONE)
        return Checked(self.programs, kept)

    def to_json(self, opinion: Mapping[str, Any] | None = None) -> str:
        """Return it as JSON text, with a second opinion where there is one."""
        rows = [asdict(finding) for finding in self.findings]
        told = {**schema("check"), "programs": self.programs, "findings": rows}
        if opinion is not None:
            told["second_opinion"] = opinion
        return json.dumps(told) + "\n"


def check(
    folder: str | Path,
    *,
    model: Model | str | Path | None = None,
    plan: str | Path | None = None,
    source: str | Path | None = None,
    cell: str | Path | None = None,
    changes: Sequence[str] = (),
) -> Checked:
    """Check a tree of compensated programs before it is uploaded.

    Args:
        folder: The tree.
        model: The model that all programs should be made with, or its file.
        plan: Or the plan file that tells the model of each of them.
        source: The tree that it was made from.
        cell: The cell of programs that no rule of the plan fits. Where assume_motion
            of [compensation] holds, programs with calls of routines that were assumed
            motionless are found.
        changes: Keys of all cells for this run, as `load_cell` takes them.

    Raises:
        ProgramError: A folder or a file cannot be read.
        PostprocError: The plan or the model cannot be used.
    """
    folder = Path(folder)
    if changes and cell is None and plan is None:
        raise PostprocError("--set: no cell is given. Give --cell or --plan")
    made, cells = None, []
    if plan is not None:
        made = make_plan(Path(plan), None, None, DEFAULT_OPTIONS, changes)
        cells += [setup.cell for setup in made.setups]
    if cell is not None:
        cells.append(load_cell(cell, changes=changes))
    strict = any(one.compensation.assume_motion for one in cells)
    current = _current_model(folder, model, made)
    return check_tree(folder, current, None if source is None else Path(source), strict)


def _current_model(
    folder: Path, model: Model | str | Path | None, made: BatchPlan | None
) -> Current:
    """Tell which model a program of a tree should have been made with."""
    if made is not None:
        ids = [setup.model.id for setup in made.setups]

        def current_of(place: str) -> str | None:
            which = made.setup_of(place, program_arm(folder / place))
            return None if which is None else ids[which]

        return current_of
    if model is None:
        return lambda place: None
    current = (model if isinstance(model, Model) else load_model(model)).id
    return lambda place: current


def check_tree(
    folder: Path,
    current: Current = lambda place: None,
    source: Path | None = None,
    assume_motion: bool = False,
) -> Checked:
    """Check a tree of compensated programs, see `check`.

    Args:
        folder: The tree.
        current: Tells the model that a program should be made with, None: any.
        source: The tree that it was made from.
        assume_motion: Find calls of routines that were assumed motionless.

    Raises:
        ProgramError: A folder or a file cannot be read.
    """
    for root in (folder, source):
        if root is not None and not root.is_dir():
            raise ProgramError(root, "is no folder", "Give a tree of programs")
    places = list(_places(folder))
    names = {place.lower(): place for place in places}
    listing = FolderListing(None if source is None else source.absolute())
    look = _Look(folder, source, current, names, assume_motion, listing=listing)
    findings = [f for place in places for f in look.at(place)]
    findings += _find_mixed_models(
        folder, [place for place in places if current(place) is None]
    )
    if source is not None:
        findings += _absent(source, set(places))
    programs = sum(file_named(place).is_program for place in places)
    return Checked(programs, tuple(sorted(findings)))


def _places(root: Path) -> Iterator[str]:
    """Yield the files of a tree, by their paths below it.

    Raises:
        ProgramError: A folder cannot be read.
    """

    def fail(exc: OSError) -> None:
        problem = f"cannot be read ({exc.strerror})"
        raise ProgramError(exc.filename, problem, "Check its rights") from None

    for parent, _, names in os.walk(root, onerror=fail):
        for name in sorted(names):
            yield (Path(parent) / name).relative_to(root).as_posix()


def _find_mixed_models(root: Path, places: Sequence[str]) -> Iterator[CheckFinding]:
    """Find modules of a task, and sources with data lists, of different models."""
    models: dict[str, dict[str, str]] = {}
    for place in places:
        file = file_named(place)
        if file.is_program or file.is_data_list:
            stamp = read_stamp(read_head(root / place))
            if stamp is not None:
                models.setdefault(file.job, {}).setdefault(stamp.model, place)
    for found in models.values():
        (model, place), *others = found.items()
        for other, at in others:
            text = (
                f"was written with model {other}, and {place} of the same job with "
                f"{model}. Compensate the job again"
            )
            yield CheckFinding(at, Code.MIXED_MODELS, text)


def _absent(source: Path, places: set[str]) -> list[CheckFinding]:
    """Find programs of which there is no output."""
    return [
        CheckFinding(
            place, Code.ABSENT, "is in the source tree only: it was not compensated"
        )
        for place in _places(source)
        if file_named(place).is_program and place not in places
    ]


@dataclass(frozen=True)
class _Digests:
    """Digests of files that many programs read, each found once.

    Attributes:
        files: Of files, "" where they are not there.
        sources: Of what outputs were made from.
    """

    files: dict[Path, str]
    sources: dict[Path, str]

    def of(self, path: Path) -> str:
        """Return the digest of a file, "" where it is not there."""
        if path not in self.files:
            self.files[path] = sha256(read_input(path)) if path.is_file() else ""
        return self.files[path]

    def of_source(self, path: Path) -> str:
        """Return the digest of the source of an output, of another file its own."""
        if path not in self.sources:
            record = sidecar_path(path)
            sidecar = read_without_edits(record) if record.exists() else None
            source = None if sidecar is None else sidecar.source_of(path.name)
            self.sources[path] = source or self.of(path)
        return self.sources[path]


@dataclass(frozen=True)
class _Look:
    """A look at the files of a tree.

    Attributes:
        root: The tree.
        source: The tree that it was made from, or None.
        current: Tells the model that a program should be made with.
        places: All files, by their paths in lower case.
        assume_motion: No routine is motionless because the shipped list says so.
        digests: Digests of what programs read.
        listing: What the folders of the source tree hold.
    """

    root: Path
    source: Path | None
    current: Current
    places: Mapping[str, str]
    assume_motion: bool = False
    digests: _Digests = field(default_factory=lambda: _Digests({}, {}))
    listing: FolderListing = field(default_factory=FolderListing)

    def at(self, place: str) -> Iterator[CheckFinding]:
        """Find what is wrong with a file."""
        file = file_named(place)
        program = self._existing(file.program)
        if place.endswith(TEMPORARY):
            yield CheckFinding(
                place, Code.UNFINISHED, "is a temporary file of a run that was killed"
            )
        elif file.is_program or (file.is_data_list and (program or self._has(place))):
            if not file_named(self.root / (program or place)).is_system():
                yield from self._program(place)
        elif file.is_variables and not program:
            if file.holds_targets(read_input(self.root / place)):
                yield CheckFinding(
                    place, Code.UNCOMPENSATED, "its program is not beside it"
                )
        elif file.is_compiled and program:
            if self.source is not None and (self.source / place).is_file():
                if read_input(self.source / place) == read_input(self.root / place):
                    text = "is compiled from the uncompensated program: translate it "
                    yield CheckFinding(place, Code.UNCOMPENSATED, f"{text}again")

    def _has(self, place: str) -> bool:
        """Return True if a file has a record."""
        return sidecar_path(self.root / place).exists()

    def _existing(self, place: str) -> str | None:
        """Return the file of a name, whatever its case."""
        return self.places.get(place.lower())

    def _program(self, place: str) -> Iterator[CheckFinding]:
        """Check a program and the variable file that was written with it."""
        data = read_input(self.root / place)
        stamp = read_stamp(data)
        record_path = sidecar_path(self.root / place)
        if not record_path.exists():
            if stamp is None:
                yield CheckFinding(
                    place, Code.UNCOMPENSATED, "carries no stamp and no record"
                )
            else:
                text = "its record is missing: it cannot be checked or restored"
                yield CheckFinding(place, Code.NO_RECORD, text)
            return
        try:
            sidecar = read_sidecar(record_path)
        except ProgramError as exc:
            yield CheckFinding(place, Code.NO_RECORD, str(exc))
            return
        yield from self._model(place, sidecar)
        yield from _find_missed(place, sidecar)
        if self.assume_motion:
            for file, line, message in sidecar.assumed:
                text = f"line {line} of {file}: {message}; compensate it with "
                code = Code.ROUTINE_ASSUMED_MOTIONLESS
                yield CheckFinding(place, code, f"{text}assume_motion")
        yield from self._content(place, data, sidecar)
        if values := self._existing(file_named(place).variables):
            yield from self._content(values, read_input(self.root / values), sidecar)
        yield from self._read(place, sidecar)
        yield from self._new(place, sidecar)

    def _model(self, place: str, sidecar: Sidecar) -> Iterator[CheckFinding]:
        """Check that a program was made with the model it should be made with."""
        wanted = self.current(place)
        if wanted is not None and sidecar.model != wanted:
            text = f"was written with model {sidecar.model}, the current is {wanted}"
            yield CheckFinding(place, Code.OLDER_MODEL, f"{text}: compensate it again")

    def _content(
        self, place: str, data: bytes, sidecar: Sidecar
    ) -> Iterator[CheckFinding]:
        """Check a file against its record, and the record against the source."""
        name = place.rpartition("/")[2]
        record = sidecar.files.get(name)
        stamp = read_stamp(data)
        if record is None:
            if stamp is not None:
                text = "is stamped, and its record does not name it"
                yield CheckFinding(place, Code.NO_RECORD, text)
            yield from _find_uncorrected(place, {}, sidecar.list_uncorrected_in(name))
            source = sidecar.source_of(name)
            if stamp is None and source not in (None, sha256(data)):
                yield CheckFinding(place, Code.CHANGED, _EDITED)
            yield from self._source(place, source, sha256(data))
            return
        if sha256(data) != record.output_sha256:
            yield CheckFinding(place, Code.CHANGED, _EDITED)
        elif not _is_stamp_right(stamp, record, sidecar):
            yield CheckFinding(
                place, Code.NO_RECORD, "its stamp is not that of its record"
            )
        yield from _find_uncorrected(
            place, record.targets, sidecar.list_uncorrected_in(name)
        )
        yield from self._source(place, record.source_sha256, "")

    def _source(
        self, place: str, digest: str | None, unedited: str
    ) -> Iterator[CheckFinding]:
        """Check that a file was made from what is in the source tree now.

        Args:
            place: The file.
            digest: Of its source; None where the record is older, and does not tell.
            unedited: Its digest, which is its source's unless somebody has edited it.
        """
        if self.source is None:
            return
        path = self.source / place
        if not path.is_file():
            yield CheckFinding(place, Code.NO_SOURCE, "is not in the source tree")
        elif sha256(read_input(path)) != (digest or unedited):
            text = _SOURCE_CHANGED if digest else _EITHER_CHANGED
            yield CheckFinding(place, Code.SOURCE_CHANGED, text)

    def _read(self, place: str, sidecar: Sidecar) -> Iterator[CheckFinding]:
        """Check that the other files that a program was read from are as they were."""
        if sidecar.source_of(posixpath.basename(place)) is None:
            return  # the record of another program
        own = (place, self._existing(file_named(place).variables))
        for name, digest in sidecar.read.items():
            path = posixpath.normpath(posixpath.join(posixpath.dirname(place), name))
            if self._existing(path) in own:
                continue
            if self._source_of(path) not in (None, digest):
                text = (
                    f"{name}, which its job reads, has changed in the source tree since"
                )
                text = f"{text}: compensate it again"
                yield CheckFinding(place, Code.SOURCE_CHANGED, text)
            elif self._origin_of(path) not in (None, digest):
                text = f"{name}, which its job reads, was changed in this tree since"
                yield CheckFinding(place, Code.CHANGED, f"{text}: {_UNDO}")

    def _new(self, place: str, sidecar: Sidecar) -> Iterator[CheckFinding]:
        """Find what a program would read of its sources now, and was not read with."""
        name = posixpath.basename(place)
        if self.source is None or next(iter(sidecar.read), "") != name:
            return  # a page of another program, or an older record
        root = self.source.absolute()
        if not (root / place).is_file():
            return
        for path in language_of(name).reads(root / place, self.listing):
            read = path_between((root / place).parent, path)
            if root in path.parents and read not in sidecar.read:
                text = f"{read} of the source tree changes now what its job reads"
                text = f"{text}: compensate it again"
                yield CheckFinding(place, Code.SOURCE_CHANGED, text)

    def _source_of(self, path: str) -> str | None:
        """Return the digest of a file of the source tree, "" where it is not there.

        None where there is no source tree, or it does not reach there.
        """
        if self.source is None:
            return None
        found = self.digests.of(self.source / path)
        return None if path.startswith("../") and not found else found

    def _origin_of(self, path: str) -> str | None:
        """Return the digest of what a file of the tree was made from.

        Of what is no output that is its own; None where it is not there.
        """
        place = self._existing(path)
        return None if place is None else self.digests.of_source(self.root / place)


def _find_missed(place: str, sidecar: Sidecar) -> Iterator[CheckFinding]:
    """Find targets that do not pass the tolerance that they were held against."""
    counts = {name: int(sidecar.tolerance.get(name, 0)) for name in ("fail", "unknown")}
    if any(counts.values()):
        sizes = sidecar.tolerance.get("tolerance_mm", ())
        size = " to ".join(f"{float(size):g}" for size in sizes)
        text = (
            f"{counts['fail']} targets fail and {counts['unknown']} are not known "
            f"against a tolerance of {size} mm. Look at each in the report"
        )
        yield CheckFinding(place, Code.TOLERANCE_MISSED, text)


def _find_uncorrected(
    place: str, targets: Mapping[str, Any], left: tuple[LeftLine, ...]
) -> Iterator[CheckFinding]:
    """Find targets that could have been compensated and kept their value."""
    told = add_uncorrected(targets, left)
    codes = "".join(str(int(status)) for status in LEFT_ALONE)
    columns = (told["status"], told["line"], told["reason"])
    rows = [row for row in zip(*columns, strict=False) if row[0] in codes]
    if rows:
        lines = line_ranges(sorted(line for _, line, _ in rows))
        text = f"{len(rows)} visits are not corrected, lines {lines} of the source"
        cure = "check them, then pass --allow-uncorrected"
        yield CheckFinding(
            place, Code.LEFT_ALONE, f"{text}: {cure}; {_by_reason(rows, told)}"
        )


def _by_reason(rows: list[tuple[str, int, int]], told: Mapping[str, Any]) -> str:
    """Say why lines were left, a reason at a time."""
    lines: dict[int, list[int]] = {}
    for _, line, why in rows:
        lines.setdefault(why, []).append(line)
    reasons = told.get("reasons", ())
    return "; ".join(
        f"{reasons[why]} (lines {line_ranges(sorted(own))})"
        for why, own in lines.items()
        if why < len(reasons)
    )


def _is_stamp_right(stamp: Stamp | None, record: FileRecord, sidecar: Sidecar) -> bool:
    """Return True if a stamp and a record say the same.

    A program in which nothing was corrected has no stamp.
    """
    if stamp is None:
        return record.source_sha256 == record.output_sha256
    return (stamp.source, stamp.model) == (record.source_sha256, sidecar.model)
