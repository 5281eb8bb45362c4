"""KRL behind the interface of all languages."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from postproc.exceptions import ProgramError
from postproc.files import FolderListing
from postproc.language import ir
from postproc.language.analysis.task_language import TaskLanguage
from postproc.language.krl import syntax as said
from postproc.language.krl.archive import read_archive
from postproc.language.krl.clones import KrlCloner
from postproc.language.krl.files import KrlFileName
from postproc.language.krl.interpreter import KrlMachine
from postproc.language.krl.other_programs import find_other_programs
from postproc.language.krl.pose_encoding import KRL_DIALECT
from postproc.language.krl.program import KrlFile, read_krl
from postproc.language.krl.symbols import KrlTask
from postproc.language.krl.to_visits import KrlCollector
from postproc.language.krl.user_sources import acting_sources
from postproc.language.text.source import Source

# Switches of the controller's own accuracy model, and the words that switch it off.
_ACCURACY = {
    "$abs_accur": ("#none", "#off", "false"),
    "$abs_convert": ("#none", "#off", "false"),
    "$deactivate_abs_accur": ("true",),
    "$suppress_abs_accur": ("true",),
}


class Krl(TaskLanguage):
    """The language of KUKA controllers."""

    name = "KRL"
    controller = "kuka"
    suffixes = KrlFileName.programs
    comment = ";"
    dialect = KRL_DIALECT
    grammar = "krl"
    cure = "Give the .src of a program"
    read_file = staticmethod(read_krl)
    task = KrlTask
    machine = KrlMachine
    collector = KrlCollector
    clones = KrlCloner
    begins = re.compile(
        rb"(?:\xef\xbb\xbf)?(?:\s|;[^\r\n]*[\r\n])*(?:&\w|(?:GLOBAL\s+)?DEF\s)", re.I
    )
    joints = re.compile(r"[^;\"]*?\{\s*(?:(?:E6)?AXIS\s*:\s*)?A1\s", re.I)
    names = (
        re.compile(
            r"\s*(?:DECL\s+)?(?:GLOBAL\s+)?(?:CONST\s+)?(?:DECL\s+)?"
            r"(?:E6POS|POS|FRAME|E6AXIS|AXIS)\s+([A-Za-z_$]\w*(?:\[[^\]]*\])?)",
            re.I,
        ),
        re.compile(r"\s*([A-Za-z_$]\w*(?:\[[^\]]*\])?)\s*="),
        re.compile(r"\s*([A-Za-z_]\w*)\s+([A-Za-z_$]\w*(?:\[[^\]]*\])?)?"),
    )
    named_as_file = True
    names_numbers = True

    def name_main(self, files: Sequence[KrlFile]) -> tuple[str, str]:
        """Name the first routine, and what a file is called."""
        return f"DEF {files[0].routines[0].head.name}", "program"

    def is_beside(self, source: Source) -> bool:
        """Return True for another program, or its list, that changes shared data."""
        return KrlFileName(source.name).is_apart

    def refuse(self, files: Sequence[KrlFile]) -> None:
        """Refuse submit programs, the controller's own accuracy and second values."""
        if files[0].is_submit:
            problem = "is a submit program, which moves no arm"
            name = files[0].text.source.name
            raise ProgramError(name, problem, "Give the .src of a program")
        _refuse_own_accuracy(files)
        _refuse_doubles(files)

    def reads(self, program: Path, listing: FolderListing) -> tuple[Path, ...]:
        """Return what all share, and what others may move or change of it.

        Sources of packages that people wrote moves in, and other programs.
        """
        named = KrlFileName(str(program))
        if not named.is_program:
            return ()
        shared = (*named.find_shared(listing), *acting_sources(program, listing))
        return (*shared, *find_other_programs(program, listing))

    read_archive = staticmethod(read_archive)


LANGUAGE = Krl


def _refuse_own_accuracy(files: Sequence[KrlFile]) -> None:
    """Refuse a program that switches the controller's own accuracy model on."""
    for file in files:
        for row in file.text.of_kind(lambda one: bool(_switches_on(one))):
            name = _switches_on(file.text.statement(row))
            problem = f"sets {name.upper()}: the controller "
            problem += "compensates on its own, this would do it twice"
            cure = "Switch that off, here and on the controller"
            line = file.text.line(row)
            raise ProgramError(file.text.source.name, problem, cure, line=line)


_OF_MOVES = frozenset("e6pos pos e6axis axis frame fdat ldat pdat load".split())


def _refuse_doubles(files: Sequence[KrlFile]) -> None:
    """Refuse a data list that gives a point, frames or a load of moves two values.

    Raises:
        ProgramError: One does: which of the values holds is not known.
    """
    for file in (one for one in files if not one.routines):
        types = {datum.name: datum.type for datum in file.data if datum.type}
        first: dict[tuple[str, tuple[int, ...]], int] = {}
        for datum in file.data:
            if datum.value is None or types.get(datum.name) not in _OF_MOVES:
                continue
            row = first.setdefault((datum.name, datum.index), datum.row)
            if row != datum.row:
                lines = [file.text.line(at) for at in (row, datum.row)]
                problem = f"gives {datum.name.upper()} a second value, after line "
                cure = "Keep the one that the controller has"
                name, problem = file.text.source.name, f"{problem}{lines[0]}"
                raise ProgramError(name, problem, cure, line=lines[1])


def _switches_on(one: ir.SourceStatement) -> str:
    """Name what a statement switches the accuracy model on with, "" if it does not."""
    match one:
        case said.InterruptDeclared(action=action) | said.PathTrigger(action=action):
            return _switches_on(action)
        case ir.Assignment(target=ir.DataObject(name=name), value=value):
            if name in _ACCURACY and not _is_one_of(value, _ACCURACY[name]):
                return name
    return ""


def _is_one_of(value: ir.Operand, words: Sequence[str]) -> bool:
    match value:
        case said.EnumValue(name=word) | ir.DataObject(name=word, steps=()):
            return word in words
    return False
