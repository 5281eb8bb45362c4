"""The plan of a run: which programs belong to which arm, and what goes to a worker."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import Any

from postproc import __version__
from postproc.compensation.options import Options
from postproc.compensation.output.sidecar import path_between, sha256
from postproc.exceptions import CellError, PostprocError
from postproc.files import path_in
from postproc.model.model import Model, load_model
from postproc.robot.arm_file import Strict, read_toml
from postproc.robot.cell import (
    DESIGN,
    MOTIONLESS,
    ArmNumber,
    Cell,
    FrameSection,
    JobSection,
    LimitSection,
    MotionSection,
    load_cell,
)

# Which cell and which model a program is compensated with.


@dataclass(frozen=True)
class JobSetup:
    """A cell, a model and what the user asked for: all but the program itself."""

    cell: Cell
    model: Model
    options: Options

    @cached_property
    def digest(self) -> str:
        """Hash all that decides, beside the sources, what comes out.

        Contents count, places do not: a copy of the same cell file is the same cell.
        It is made in the words that logs began with, so that they are resumed.
        """
        values = self.options.to_dict()
        options = {FIRST_WORDS.get(name, name): value for name, value in values.items()}
        shared = options.pop("shared_points")
        options["clone"] = shared == "clone"  # version 0.1.0 knew mean and clone
        if shared == "leave":
            options["shared_points"] = shared
        if (most := self.cell.limits.averaged_mm) != LimitSection().averaged_mm:
            options["averaged_mm"] = most
        cell = _in_first_words(self.cell.file.model_dump(mode="json"))
        if self.cell.file.motion == MotionSection():
            del cell["motion"]
        if self.cell.file.job == JobSection():
            del cell["job"]
        parts = {
            "version": __version__,
            "cell": cell,
            "arm": self.cell.arm.file.model_dump(mode="json"),
            "model": self.model.id,
            "options": options,
        }
        text = json.dumps(parts, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


NOT_DECIDING = DESIGN | {
    "verify", "compensation", "measurements", "serial_number", "simulation",
    "averaged_mm",
}  # fmt: skip
FIRST_WORDS = {
    **{new: old for section in (LimitSection, FrameSection)
       for old, new in section.RENAMED.items()},
    MOTIONLESS: "still",
    "edit_exported": "shared",
    "assume_motion": "strict_calls",
    "path_tolerance_mm": "path_mm",
    "preload_backlash": "take_up",
    "reapproach": "approach",
}  # fmt: skip


def _in_first_words(content: Any) -> Any:
    """Return what decides of a cell in the words of version 0.1.0."""
    if isinstance(content, dict):
        return {
            FIRST_WORDS.get(key, key): _in_first_words(value)
            for key, value in content.items()
            if key not in NOT_DECIDING
        }
    return FIRST_WORDS[MOTIONLESS] if content == MOTIONLESS else content


def open_setup(
    cell: Path, model: Path, options: Options, changes: Sequence[str] = ()
) -> JobSetup:
    """Load a cell and a model, and refuse a pair that does not belong together.

    Raises:
        CellError: The cell cannot be used, or its controller compensates on its own.
        ModelError: The model cannot be used, or was made for another arm.
    """
    loaded, fitted = load_cell(cell, changes=changes), load_model(model)
    fitted.check_arm(loaded.arm, model)
    if loaded.file.robot.absolute_accuracy:
        raise CellError(
            cell,
            "the controller compensates on its own: this would do it twice",
            "Switch that option off on the controller, then here",
            place="$.robot.absolute_accuracy",
        )
    # Only the name: messages must not depend on where a run was started.
    named = replace(loaded, path=Path(cell.name))
    return JobSetup(named, fitted, options.within(named))


# The plan file: which programs of a tree belong to which arm.


class RuleSection(Strict):
    """One rule of a plan file; paths are relative to the plan file.

    With `arm` it is for programs of that arm of a controller only.
    """

    pattern: str
    arm: ArmNumber | None = None
    cell: str
    model: str


class PlanFile(Strict):
    """A whole plan file."""

    rule: list[RuleSection]


@dataclass(frozen=True)
class BatchPlan:
    """Patterns and what they stand for; the first that fits a program counts.

    Attributes:
        patterns: Matched against the program's path below the source tree, with ``/``.
        arms: Of which arm a program must be for each, None for any.
        which: Index into `setups` of every pattern.
        setups: Each distinct pair of cell and model once.
    """

    patterns: tuple[re.Pattern[str], ...]
    arms: tuple[int | None, ...]
    which: tuple[int, ...]
    setups: tuple[JobSetup, ...]

    def setup_of(self, program: str, arm: int) -> int | None:
        """Return the index of a program's setup, None where no rule fits.

        Args:
            program: Its path below the source tree, with ``/``.
            arm: That of the program (``PROG_ARM``, or its task's in a backup), 0 where
                it is not said: the program is one of arm 1; -1: nobody can tell.
        """
        rules = zip(self.patterns, self.arms, self.which, strict=True)
        for pattern, wanted, index in rules:
            if wanted in (None, arm or 1) and pattern.fullmatch(program):
                return index
        return None


def pattern_from_glob(glob: str) -> re.Pattern[str]:
    """Translate a pattern: ``*`` and ``?`` stay in a folder, ``**`` crosses folders.

    Folders may be separated by backslashes, as on Windows.

    >>> bool(pattern_from_glob("r1/**").fullmatch("r1/weld/JOB.pdl"))
    True
    >>> bool(pattern_from_glob("r1/*.pdl").fullmatch("r1/weld/job.pdl"))
    False
    """
    words = {"**/": "(?:.*/)?", "**": ".*", "*": "[^/]*", "?": "[^/]"}
    parts = re.split(r"(\*\*/|\*\*|\*|\?)", glob.replace("\\", "/"))
    text = "".join(words.get(part, re.escape(part)) for part in parts)
    return re.compile(text, re.IGNORECASE | re.DOTALL)


def make_plan(
    plan: Path | None,
    cell: Path | None,
    model: Path | None,
    options: Options,
    changes: Sequence[str] = (),
) -> BatchPlan:
    """Load every cell and model that a run needs.

    Args:
        plan: Plan file.
        cell: Cell of the programs that no rule fits.
        model: Model of the programs that no rule fits.
        options: What the user asked for.
        changes: Keys of all cells for this run, as `load_cell` takes them.

    Raises:
        PostprocError: Neither a plan nor both files are given, or one cannot be used.
    """
    rules: list[Rule] = []
    if plan is not None:
        file = read_toml(plan, PlanFile, CellError)
        if not file.rule:
            raise CellError(plan, "holds no [[rule]]", "Add one", place="$.rule")
        here = plan.parent
        rules += [
            Rule(r.pattern, r.arm, path_in(here, r.cell), path_in(here, r.model))
            for r in file.rule
        ]
    if (cell is None) != (model is None) or (cell is None and plan is None):
        raise PostprocError(
            "neither --cell and --model nor --plan are given. Name one cell and one "
            "model, or a plan with several; with both, the plan comes first"
        )
    if cell is not None and model is not None:
        rules.append(Rule("**", None, cell, model))
    return _open_rules(rules, options, changes)


@dataclass(frozen=True)
class Rule:
    """One rule of a plan, with the places of its files; see `RuleSection`."""

    pattern: str
    arm: int | None
    cell: Path
    model: Path


def _open_rules(
    rules: Sequence[Rule], options: Options, changes: Sequence[str]
) -> BatchPlan:
    """Open each distinct pair of files once.

    Raises:
        PostprocError: A file cannot be used, or a cell is of another arm than its rule.
    """
    pairs = list(dict.fromkeys((rule.cell, rule.model) for rule in rules))
    setups = tuple(open_setup(cell, model, options, changes) for cell, model in pairs)
    which = tuple(pairs.index((rule.cell, rule.model)) for rule in rules)
    for rule, index in zip(rules, which, strict=True):
        _check_number(rule, setups[index].cell)
    return BatchPlan(
        tuple(pattern_from_glob(rule.pattern) for rule in rules),
        tuple(rule.arm for rule in rules),
        which,
        setups,
    )


def _check_number(rule: Rule, cell: Cell) -> None:
    """Refuse a rule for one arm with the cell of another."""
    if rule.arm not in (None, cell.arm_number):
        raise CellError(
            rule.cell,
            f"is of arm {cell.arm_number}, and a rule of the plan gives it to "
            f"programs of arm {rule.arm}",
            f"Set arm_number = {rule.arm} if that is its arm, or mend the rule",
            place="$.robot.arm_number",
        )


# What travels to a worker and what comes back: bytes, never paths of a disk.


@dataclass(frozen=True)
class Unit:
    """Files that are compensated together, by their paths below the source tree.

    Attributes:
        program: The main program.
        pages: Programs that it imports and nobody else does, in order.
        variables: Its variable file, or None.
        setup: Index of its cell and model in the plan.
        reads: Files that it reads and other programs too: they are not rewritten.
    """

    program: str
    pages: tuple[str, ...]
    variables: str | None
    setup: int
    reads: tuple[str, ...] = ()

    @property
    def programs(self) -> tuple[str, ...]:
        """Return the main program and its pages."""
        return (self.program, *self.pages)

    @property
    def files(self) -> tuple[str, ...]:
        """Return all files, the main program first."""
        return (*self.own, *self.reads)

    @property
    def own(self) -> tuple[str, ...]:
        """Return the files that nobody else reads, the main program first."""
        values = () if self.variables is None else (self.variables,)
        return (*self.programs, *values)


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
    def digests(self) -> dict[str, str]:
        """Return the SHA-256 of its files by their paths from the program's folder."""
        folder = PurePosixPath(self.unit.program).parent
        return {
            path_between(folder, PurePosixPath(place)): sha256(data)
            for place, data in self.files.items()
        }

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


def make_failure(unit: Unit, problem: str, seconds: float = 0.0) -> Result:
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
