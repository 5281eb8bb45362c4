"""PDL2 behind the interface of all languages."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from postproc.arrays import release_memory
from postproc.exceptions import ProgramError
from postproc.files import FolderListing, base_name
from postproc.language.insert_moves import Splitter
from postproc.language.language import Cloner, JobReading, Language, Start
from postproc.language.pdl2.files import Pdl2FileName
from postproc.language.pdl2.interpreter import resolve
from postproc.language.pdl2.nested import name_parts
from postproc.language.pdl2.other_programs import find_other_programs
from postproc.language.pdl2.pose_encoding import PDL2_DIALECT
from postproc.language.pdl2.program import Program, parse
from postproc.language.pdl2.variable_file import VariableFile, read_variables
from postproc.language.text.grammars import line_parser
from postproc.language.text.number_edits import Skeleton
from postproc.language.text.source import ParsedFiles, Source, parse_once, parse_shared
from postproc.language.visits import never_reached

_WORD = re.compile(rb"[A-Za-z_]\w*")
_NESTED = re.compile(rb"\s*[A-Za-z_]\w*\s+(?:A?REC|PATH)\b", re.I)


class Pdl2(Language):
    """The language of Comau controllers.

    What few programs need is loaded where it is used.
    """

    name = "PDL2"
    controller = "comau"
    suffixes = Pdl2FileName.programs
    comment = "--"
    dialect = PDL2_DIALECT
    via_first = False
    names = (re.compile(r"([A-Za-z_]\w*(?:\[[\d, ]+\])?)\s+[A-Z]{3,4}\b"),)
    goes_on = True

    def recognises(self, text: bytes) -> bool:
        """Tell that a text may be PDL2: what begins as nothing else is taken for it."""
        return True

    def read(
        self,
        sources: Sequence[Source],
        start: Start,
        known: ParsedFiles | None = None,
    ) -> JobReading:
        """Parse a program, its pages and its variable file; see `Language.read`."""
        program = parse_once(known, sources[0], parse)
        if program.main is None and not program.routines:
            problem, cure = "the file holds no BEGIN .. END", "Give a PDL2 program"
            raise ProgramError(sources[0].name, problem, cure)
        _refuse_other_arm(program, start)
        pages: list[Program] = []
        beside: list[Program] = []
        variables: VariableFile | None = None
        texts = [Skeleton.of(program.lines)]
        for source in sources[1:]:
            if Pdl2FileName(source.name).is_variables:
                variables = parse_once(known, source, read_variables)
                texts.append(Skeleton.of(variables.lines))
            elif Pdl2FileName(source.name).is_apart:
                beside.append(parse_shared(parse, source))
                texts.append(Skeleton.of(beside[-1].lines))
            else:
                page = parse_once(known, source, parse)
                # Where its PROGRAM line is not understood, its file names it.
                pages.append(page if page.name else replace(page, name=_file(page)))
                texts.append(Skeleton.of(pages[-1].lines))
        others = _by_name(program, pages)
        release_memory(sum(len(text.numbers) for text in texts))
        found = resolve(program, start, variables, others, beside)
        unreached = never_reached(found.missed, "the start", "program")
        every = (*found.diagnostics, *unreached)
        return replace(found, texts=tuple(texts), diagnostics=every)

    def cloner(self, sources: Sequence[Source]) -> Cloner:
        """Parse the files of a job to clone variables in them."""
        from postproc.language.pdl2.clones import Pdl2Cloner

        own = _list_programs(sources)
        lists = (one for one in sources if Pdl2FileName(one.name).is_variables)
        values = next(lists, None)
        taken = {
            word.decode("ascii").lower()
            for source in sources
            for word in _WORD.findall(source.data)
        }
        return Pdl2Cloner([parse(source) for source in own], values, taken)

    def splitter(self, sources: Sequence[Source]) -> Splitter:
        """Parse the files of a job to put points on the ways of its moves."""
        from postproc.language.pdl2.insert_moves import Pdl2Splitter

        return Pdl2Splitter([parse(source) for source in _list_programs(sources)])

    def target_names(
        self, file: str, lines: Sequence[bytes], wanted: Sequence[int]
    ) -> Iterator[str]:
        """Name variables; in a file with records or paths their parts, too."""
        if any(map(_NESTED.match, lines)):
            return name_parts(Source(file, b"\n".join(lines)), wanted)
        return super().target_names(file, lines, wanted)

    def reads(self, program: Path, listing: FolderListing) -> tuple[Path, ...]:
        """Return other programs that change or call what a program exports."""
        return find_other_programs(program, listing)

    def prepare(self) -> None:
        """Load the parsers of programs and variable files."""
        for grammar in ("pdl2", "lsv"):
            line_parser(grammar, "line")


LANGUAGE = Pdl2


def _list_programs(sources: Sequence[Source]) -> list[Source]:
    """List the program and its pages."""
    names = [(Pdl2FileName(one.name), one) for one in sources]
    return [one for name, one in names if not (name.is_variables or name.is_apart)]


def _refuse_other_arm(program: Program, start: Start) -> None:
    """Refuse a program that says it is another arm's than the cell's."""
    if program.arm not in (0, start.arm):
        problem = (
            f"PROG_ARM = {program.arm}: it is a program of arm {program.arm}, and the "
            f"cell ({start.source}) is of arm {start.arm}"
        )
        cure = (
            f"Give the cell of that arm, with arm_number = {program.arm} under "
            "[robot], and its model"
        )
        name = program.lines.source.name
        raise ProgramError(name, problem, cure, line=program.head)


def _file(program: Program) -> str:
    return base_name(program.lines.source.name)


def _by_name(program: Program, pages: list[Program]) -> dict[str, Program]:
    """Find pages by the names of their files and programs, in their order.

    Raises:
        ProgramError: A name means two of them: their variables could not be told apart.
    """
    own = {_file(program): program, program.name: program}
    found = {_file(page): page for page in pages}
    for page in pages:
        file = _file(page)
        same = [own.get(page.name, page), own.get(file, page), found[file]]
        if any(one is not page for one in (*same, found.setdefault(page.name, page))):
            problem, cure = "its program has the name of another file", "Rename one"
            raise ProgramError(page.lines.source.name, problem, cure)
    return found
