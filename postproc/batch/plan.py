"""The plan file: which programs of a tree belong to which arm."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from postproc.batch.setup import Setup, open_setup
from postproc.compensation.options import Options
from postproc.exceptions import CellError, PostprocError
from postproc.robot.arm_file import Strict, read_toml


class RuleSection(Strict):
    """One rule of a plan file; paths are relative to the plan file."""

    pattern: str
    cell: str
    model: str


class PlanFile(Strict):
    """A whole plan file."""

    rule: list[RuleSection]


@dataclass(frozen=True)
class Plan:
    """Patterns and what they stand for; the first that fits a program counts.

    Attributes:
        patterns: Matched against the program's path below the source tree, with ``/``.
        which: Index into `setups` of every pattern.
        setups: Each distinct pair of cell and model once.
    """

    patterns: tuple[re.Pattern[str], ...]
    which: tuple[int, ...]
    setups: tuple[Setup, ...]

    def setup_of(self, program: str) -> int | None:
        """Return the index of a program's setup, None where no pattern fits.

        Args:
            program: Its path below the source tree, with ``/``.
        """
        for pattern, index in zip(self.patterns, self.which, strict=True):
            if pattern.fullmatch(program):
                return index
        return None


def pattern_from_glob(glob: str) -> re.Pattern[str]:
    """Translate a pattern: ``*`` and ``?`` stay in a folder, ``**`` crosses folders.

    >>> bool(pattern_from_glob("r1/**").fullmatch("r1/weld/JOB.pdl"))
    True
    >>> bool(pattern_from_glob("r1/*.pdl").fullmatch("r1/weld/job.pdl"))
    False
    """
    words = {"**/": "(?:.*/)?", "**": ".*", "*": "[^/]*", "?": "[^/]"}
    parts = re.split(r"(\*\*/|\*\*|\*|\?)", glob)
    text = "".join(words.get(part, re.escape(part)) for part in parts)
    return re.compile(text, re.IGNORECASE | re.DOTALL)


def make_plan(
    plan: Path | None, cell: Path | None, model: Path | None, options: Options
) -> Plan:
    """Load every cell and model that a run needs.

    Args:
        plan: Plan file.
        cell: Cell of the programs that no rule fits.
        model: Model of the programs that no rule fits.
        options: What the user asked for.

    Raises:
        PostprocError: Neither a plan nor both files are given, or one cannot be used.
    """
    rules: list[tuple[str, Path, Path]] = []
    if plan is not None:
        rules += _read_rules(plan)
    if (cell is None) != (model is None) or (cell is None and plan is None):
        raise PostprocError("Give --cell and --model, or --plan, or all three")
    if cell is not None and model is not None:
        rules.append(("**", cell, model))
    return _open_rules(rules, options)


def _read_rules(path: Path) -> list[tuple[str, Path, Path]]:
    """Read the rules of a plan file.

    Raises:
        CellError: The file cannot be read, or a key is wrong.
    """
    file = read_toml(path, PlanFile, CellError)
    if not file.rule:
        raise CellError(path, "holds no [[rule]]", "Add one", place="$.rule")
    here = path.parent
    return [(r.pattern, here / r.cell, here / r.model) for r in file.rule]


def _open_rules(rules: Sequence[tuple[str, Path, Path]], options: Options) -> Plan:
    """Open each distinct pair of files once."""
    pairs = list(dict.fromkeys((cell, model) for _, cell, model in rules))
    setups = tuple(open_setup(cell, model, options) for cell, model in pairs)
    return Plan(
        tuple(pattern_from_glob(pattern) for pattern, _, _ in rules),
        tuple(pairs.index((cell, model)) for _, cell, model in rules),
        setups,
    )
