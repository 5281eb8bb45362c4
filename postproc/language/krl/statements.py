"""Statements of a KRL file."""

from __future__ import annotations

from postproc import _native
from postproc.language.ir import SourceStatement
from postproc.language.krl.parser import parse_statement
from postproc.language.text.source import Source
from postproc.language.text.statement_table import StatementText, read_text

KrlText = StatementText[SourceStatement]


def read_krl_statements(source: Source) -> KrlText:
    """Read the statements of a KRL file: lines, without their comments.

    Raises:
        ProgramError: A string does not end.
    """
    return read_text(source, _native.scan_krl, parse_statement)
