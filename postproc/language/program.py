"""A parsed program: declarations, routines and where each jump leads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from postproc.language import pdl2 as ast
from postproc.language.blocks import Blocks
from postproc.language.diagnostic import Diagnostic
from postproc.language.forms import Formed
from postproc.language.lines import Lines
from postproc.language.variables import Variable, Variables

__all__ = ["Body", "Program", "Variable", "Variables"]


@dataclass(frozen=True)
class Body:
    """A routine or the main part of a program.

    Attributes:
        name: Routine name in lower case, "" for the main part.
        first, last: Rows of its BEGIN and of its END.
        parameters: Formal parameters.
        variables: Its own variables, by lower-case name; the main part has none.
        blocks: Where its jumps lead.
    """

    name: str
    first: int
    last: int
    parameters: tuple[ast.Parameter, ...]
    variables: Variables
    blocks: Blocks

    @cached_property
    def own_names(self) -> frozenset[str]:
        """Return the names that mean something else here than around it."""
        return frozenset(self.variables) | {p.name for p in self.parameters}


@dataclass(frozen=True)
class Program:
    """A parsed program file.

    Attributes:
        name: Program name in lower case.
        lines: Its logical lines.
        statements: What each shape says; parallel to `lines.shapes`.
        main: Its main part, None where it has none.
        routines: Routines with a body, by lower-case name.
        outside: Routines exported from other programs: name to program.
        variables: Declared variables, by lower-case name.
        imports: Files named by IMPORT.
        arm: ``PROG_ARM``, 0 where it is not said.
        diagnostics: What was found while reading.
        nodes: Standard fields that types of nodes declare, all in lower case.
    """

    name: str
    lines: Lines
    statements: Formed[ast.Statement]
    main: Body | None
    routines: Mapping[str, Body]
    outside: Mapping[str, str]
    variables: Variables
    imports: tuple[str, ...]
    arm: int
    diagnostics: tuple[Diagnostic, ...]
    nodes: Mapping[str, frozenset[str]]

    def statement(self, row: int) -> ast.Statement:
        """Return what a logical line says."""
        return self.statements[int(self.lines.shape[row])]
