"""What a language does for all else: files to visits, and back; one class each."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar

from postproc.arrays import Floats, Ints
from postproc.files import FolderListing
from postproc.language.insert_moves import Splitter
from postproc.language.measuring_program import MeasuringProgram, refuse_other_name
from postproc.language.pose_encoding import Dialect
from postproc.language.text.comment_directives import (
    AT_APPROACH,
    AT_VIA,
    insertion_mark,
)
from postproc.language.text.number_edits import Skeleton
from postproc.language.text.source import Edit, ParsedFiles, Source, Span, check_length
from postproc.language.visits import Diagnostic, Literals, Visits

Record = tuple[float, ...] | None


@dataclass(frozen=True)
class Start:
    """What the cell says about the moment at which the program starts.

    Attributes:
        tool, base, uframe: Position records (6,) [mm, deg], None where unknown.
        routines: Outside routine to ``motionless``, ``moves`` or ``sets-frames``.
        motionless: Patterns of outside routines, ``name`` or ``program.name``, that
            neither move the arm nor set frames.
        constant: Patterns of exported variables, ``name`` or ``program.name``, that no
            other program changes.
        assume_motion: The shipped list of such routines does not count.
        frame_tables: Outside routine to arguments (``"1,2"``) to the records of the
            frames (``tool``, ``base``, ``uframe``) that it sets.
        aux: Auxiliary axis to ``gun``, ``track`` or ``positioner``.
        taught: Names of points that were taught with the robot.
        taught_records: Frames of the cell that were.
        arm: Number of our arm.
        linear_speed: Of the TCP [m/s] where a program sets none, None where unknown.
        override: Likewise, of all speeds [%].
        source: The cell file, for messages.
    """

    tool: Record = (0.0,) * 6
    base: Record = (0.0,) * 6
    uframe: Record = (0.0,) * 6
    routines: Mapping[str, str] = field(default_factory=dict)
    motionless: tuple[str, ...] = ()
    assume_motion: bool = False
    constant: tuple[str, ...] = ()
    frame_tables: Mapping[str, Mapping[str, Mapping[str, Record]]] = field(
        default_factory=dict
    )
    aux: Mapping[int, str] = field(default_factory=dict)
    taught: Collection[str] = frozenset()
    taught_records: Collection[Record] = frozenset()
    arm: int = 1
    linear_speed: float | None = None
    override: float | None = None
    source: str = ""

    def __post_init__(self) -> None:
        """No language tells cases apart: keep names in lower case."""
        for field_ in ("routines", "frame_tables"):
            lower = {name.lower(): said for name, said in getattr(self, field_).items()}
            object.__setattr__(self, field_, lower)
        for field_, kind in (("motionless", tuple), ("constant", tuple),
                             ("taught", frozenset)):  # fmt: skip
            names = kind(name.lower() for name in getattr(self, field_))
            object.__setattr__(self, field_, names)

    def effect_of(self, *names: str) -> str:
        """Return what the cell says that a routine does, "" where it says nothing.

        What it says by name comes before what it says by pattern.

        Args:
            names: Of the routine: ``name``, ``program.name``.
        """
        said = (self.routines[name] for name in names if name in self.routines)
        still = "motionless" if matches(self.motionless, names) else ""
        return next(said, still)


@lru_cache(maxsize=8192)
def matches(patterns: tuple[str, ...], names: tuple[str, ...]) -> bool:
    """Return True if a pattern with ``*``, ``?`` means one of some names."""
    return any(fnmatchcase(name, pattern) for name in names for pattern in patterns)


@dataclass(frozen=True)
class JobReading:
    """The files of a job as its language understands them.

    Attributes:
        texts: Every file as it was read, in the order of `Visits.files`.
        visits: Every arrival at a target.
        diagnostics: What else was found.
        missed: Lines of moves that are never reached, by file.
        untouched: Names of files that are read, and never rewritten.
    """

    texts: tuple[Skeleton, ...]
    visits: Visits
    diagnostics: tuple[Diagnostic, ...]
    missed: Mapping[str, Ints] = field(default_factory=dict)
    untouched: frozenset[str] = frozenset()


@dataclass(frozen=True)
class NamedPoint:
    """A variable that a move names as its destination.

    Attributes:
        place: File, module and routine that declare it, "" for none, and its name.
        name: As it is spelt.
        file: Index of the move's file.
        span: Of the name in the move.
    """

    place: tuple[int, str, str, str]
    name: str
    file: int
    span: Span

    @property
    def key(self) -> str:
        """A text that tells variables apart."""
        return ":".join(map(str, self.place))

    def rename(self, source: Source, name: str) -> tuple[int, Edit]:
        """Let the move name another variable.

        Args:
            source: The move's file.
            name: Of the other variable.

        Raises:
            CloneError: Its line would get too long.
        """
        start, end = self.span
        line = source.line_text(source.line_of(start))
        check_length(source, len(line) + len(name) - (end - start))
        return self.file, Edit(self.span, name.encode("latin-1"))


class Cloner(ABC):
    """The files of a job, to give variables of their own to moves that share one."""

    @abstractmethod
    def target(self, file: int, line: int, via: bool, name: str) -> NamedPoint:
        """Find the variable that a move goes to, as far as it can be cloned.

        Args:
            file: Where the move stands.
            line: Its line there.
            via: Its VIA point is meant, not its end.
            name: Owner of the value that it goes to.

        Raises:
            CloneError: The move names no variable that can be.
        """

    @abstractmethod
    def find_declaration(self, named: NamedPoint) -> int:
        """Return the 1-based line that declares a variable."""

    @abstractmethod
    def clone(
        self, literals: Literals, named: Sequence[NamedPoint], rows: Sequence[int]
    ) -> tuple[str, list[tuple[int, Edit]]]:
        """Give some moves a variable of their own with the value of the one they share.

        Args:
            literals: Where the values stand.
            named: Where the moves name the old variable; all mean the same one.
            rows: Literals that it may hold there.

        Returns:
            The new name, and edits with the index of their file.

        Raises:
            CloneError: A value stands where it cannot be given twice.
        """


@dataclass(frozen=True)
class Archive:
    """What the archive of a controller gives.

    Attributes:
        place: Of the list of frames, below the folder that was asked for.
        entries: Numbers of what is set, by the plural that names it.
        load: The first load: mass [kg] and centre [mm], () for none.
        home: Joint angles of the home position [deg], () where there is none.
        root: Base of the arm as a position record, () where it is not known.
        external: Its external axes by number, and what the archive calls them, if
            anything.
    """

    place: str
    entries: Mapping[str, tuple[int, ...]]
    load: tuple[float, ...]
    home: tuple[float, ...]
    root: tuple[float, ...]
    external: Mapping[int, str]


class Language(ABC):
    """A language of robot programs.

    Attributes:
        name: As its users call it.
        controller: Whose controllers run it, as arm files and cells name them.
        suffixes: Of program files, in lower case, the usual one first.
        comment: What a comment begins with.
        dialect: What the numbers of its targets mean.
        tells_accuracy: Programs or controllers show whether the controller compensates
            on its own; else the cell must say so itself.
        named_as_file: Controllers take a program only under the name of its file.
        names_numbers: Positions stand in braces, with a name before every number.
        via_first: The point on the way of an arc stands before its end.
        names: What lines begin with that name a point, tried in order.
        goes_on: What names a point may stand on a line before its numbers.
    """

    name: str
    controller: str
    suffixes: tuple[str, ...]
    comment: str
    dialect: Dialect
    tells_accuracy: bool = True
    named_as_file: bool = False
    names_numbers: bool = False
    via_first: bool = True
    names: ClassVar[Sequence[re.Pattern[str]]]
    goes_on: ClassVar[bool] = False

    @abstractmethod
    def recognises(self, text: bytes) -> bool:
        """Tell whether a text without a name begins as programs of this language do."""

    @abstractmethod
    def read(
        self,
        sources: Sequence[Source],
        start: Start,
        known: ParsedFiles | None = None,
    ) -> JobReading:
        """Parse the files of a job and resolve its visits.

        Args:
            sources: First the program itself, then those that belong to it.
            start: What the cell says.
            known: Files that were parsed before, and are not parsed again as long as
                they are the same; these become known.

        Raises:
            ProgramError: A file is no program text, or the program is another arm's.
        """

    @abstractmethod
    def cloner(self, sources: Sequence[Source]) -> Cloner:
        """Parse the files of a job to clone variables in them."""

    @abstractmethod
    def splitter(self, sources: Sequence[Source]) -> Splitter:
        """Parse the files of a job to put points on the ways of its moves."""

    def is_inserted(self, line: bytes) -> bool:
        """Return True if a line is a point that a `Splitter` wrote."""
        return insertion_mark(line, self.comment) is not None

    def is_approach(self, line: bytes) -> bool:
        """Return True if such a line is a stop from which a target is approached."""
        return insertion_mark(line, self.comment) == AT_APPROACH

    def ends_at_via(self, line: bytes) -> bool:
        """Return True if such a line leads to the point on the way of an arc."""
        return insertion_mark(line, self.comment) == AT_VIA

    def holds_joints(self, line: str) -> bool:
        """Tell whether the numbers of a line are joint angles, as far as it shows."""
        return False

    def target_names(
        self, file: str, lines: Sequence[bytes], wanted: Sequence[int]
    ) -> Iterator[str]:
        """Name the targets on some lines of a file, "" for those without a name.

        Args:
            file: Its name.
            lines: All of them.
            wanted: 1-based lines, ascending but for 0: those that it does not have.
        """
        name, seen = "", 0
        for line in wanted:
            if line:
                first = seen if self.goes_on else line - 1
                before = (self._name(lines[k]) for k in range(line - 1, first - 1, -1))
                name, seen = next(filter(None, before), name * self.goes_on), line
            yield name if line else ""

    def _name(self, line: bytes) -> str:
        """Name what a line begins, "" where it goes on with what another began."""
        text = line.decode("latin-1")
        found = next(filter(None, (one.match(text) for one in self.names)), None)
        return " ".join(filter(None, found.groups())) if found else ""

    def read_archive(self, folder: Path) -> Archive | None:
        """Return what the archive of a controller gives, None for any other folder."""
        return None

    def reads(self, program: Path, listing: FolderListing) -> tuple[Path, ...]:
        """Return what a program reads of its archive, and other programs too.

        It is not rewritten.
        """
        return ()

    def list_placed_arms(self, program: Path) -> tuple[tuple[str, Floats], ...]:
        """Return the arms of an archive, and their poses (4, 4) [m] in the world."""
        return ()

    def load_part(self, name: str) -> Any:
        """Load a module of the language that few programs need."""
        package = type(self).__module__.rpartition(".")[0]
        return import_module(f"{package}.{name}")

    def write_measuring(self, program: MeasuringProgram, file: Path) -> str:
        """Write a measuring program as a controller takes it.

        Args:
            program: What it does.
            file: Where it goes.

        Raises:
            ProgramError: It cannot be called as its file.
        """
        if self.named_as_file:
            refuse_other_name(program, file.name, file.stem)
        return str(self.load_part("measuring_program").write(program))

    def prepare(self) -> None:  # noqa: B027 - most have nothing to load
        """Load what reading the first program takes."""
